"""Every sentence a participant reads, in one table; `[texts]` of a study file overrides by key.

A blank line starts a new paragraph. `{question}`, `{trials}`, `{minutes}` and the like are filled in
where the table says so; texts are escaped, so they cannot carry markup.
"""

from __future__ import annotations

TEXTS: dict[str, str] = {
    # consent
    "consent_heading": "Before you begin",
    "consent_body": (
        "You are invited to take part in a research study about how people see computer-generated "
        "human motion. You will watch {trials} pairs of short, silent video clips and say each time "
        "which of the two you prefer. It takes about {minutes} minutes.\n\n"
        "Taking part is voluntary. You may stop at any time by closing the page, and you may have "
        "your answers deleted until the study is closed, without giving a reason.\n\n"
        "We store your answers, how long they took, how the clips were played, and the size of the "
        "clips on your screen. We do not store your name, your address on the network, or anything "
        "else that would identify you. The answers may be published without any link to you."
    ),
    "consent_agree": "I have read this and agree to take part",
    "consent_version": "1",
    # instructions
    "instructions_heading": "How it works",
    "instructions_body": (
        "Each page shows two clips of the same room. In both of them the same kind of movement is "
        "carried out by a virtual person; each clip shows the scene from several sides at once.\n\n"
        "Watch both clips to the end. You can replay them as often as you like. Then answer: "
        "{question}\n\n"
        "Look at the whole: does the body touch what it should touch, such as the floor, a chair or "
        "a bed? Does it pass through things? Does the movement fit the place? There is no right or "
        "wrong; we would like to know what you see. The clips have no sound."
    ),
    "instructions_keys_heading": "Keys, if you like them",
    "begin": "Begin",
    "check_small": "Your window is {width} x {height} pixels; this study asks for at least "
    "{min_width} x {min_height}. Please enlarge the window or use a larger screen.",
    "check_no_video": "This browser cannot play the clips (H.264 video in MP4). Please use a "
    "current version of Chrome, Edge, Firefox or Safari.",
    "check_slow": "Your connection carries about {kbit} kbit/s at the moment; this study needs about "
    "{min_kbit}. Please use another connection, or load this page again later.",
    "check_measuring": "Looking at your connection; this takes a few seconds.",
    "check_continue": "Continue",
    # comprehension
    "comprehension_heading": "One question before you start",
    "comprehension_question": "What are you asked to judge on every page?",
    "comprehension_right": "Which of the two clips looks more realistic as a whole",
    "comprehension_wrong_1": "Which clip was loaded faster",
    "comprehension_wrong_2": "Which clip has the better music",
    "comprehension_retry": "Not quite. Please read the instructions once more and try again.",
    "comprehension_submit": "Answer",
    # trials
    "trial_heading": "Pair {number} of {total}",
    "practice_heading": "Practice {number} of {total}",
    "label_first_stacked": "Above",
    "label_second_stacked": "Below",
    "label_first_side_by_side": "Left",
    "label_second_side_by_side": "Right",
    "play_both": "Play both",
    "play": "Play",
    "replay": "Replay",
    "watch_first": "Watch both clips to the end; then you can choose.",
    "choose_now": "Choose one, then confirm.",
    "confirm": "Confirm",
    "loading": "Loading the clips",
    "slow": "Your connection is slow at the moment. The clips will start as soon as they are loaded; "
    "nothing is lost.",
    "offline": "No connection at the moment. Your answer is kept and will be sent as soon as the "
    "connection is back.",
    "hidden": "The page was hidden while a clip was running. Please watch that clip once more.",
    "clip_failed": "A clip could not be loaded.",
    "clip_retry": "Try again",
    "clip_skip": "Skip this pair",
    "practice_good": "Right: that is how every page works.",
    "practice_gross": "Look again: in the other clip the body stands or lies on something; in the "
    "one you chose it floats in the air. In the study itself there will be no such hints.",
    "no_script": "Scripts are switched off in this browser. You can still take part: play both clips "
    "to the end, choose one, and confirm.",
    "keys_on": "Keyboard shortcuts",
    "key_choose": "Choose a clip",
    "progress_label": "Progress",
    "blocked": "Your browser did not start the clips by itself. Please press play once more.",
    # break
    "break_heading": "Time for a short break",
    "break_body": "You have finished {done} of {total} pairs. Rest your eyes for a moment.",
    "break_continue": "Continue",
    # demographics
    "demographics_heading": "About you",
    "demographics_body": "Both questions are voluntary; leave them empty if you like.",
    "demographics_age": "Age group",
    "demographics_experience": "How familiar are you with computer animation?",
    "demographics_levels": "Not at all|Somewhat|Professionally",
    # comments
    "comments_heading": "Anything to add?",
    "comments_body": "If you noticed something, tell us here. This is voluntary; please do not write "
    "anything that identifies you.",
    "comments_submit": "Send",
    "comments_thanks": "Thank you, your note is stored.",
    # done
    "done_heading": "Thank you",
    "done_body": "You have answered all pairs, and everything is stored. The study asks how people "
    "judge different ways of placing human motion into rooms; each pair you saw compared two of them.",
    "done_code": "Your completion code",
    "done_return": "Return to where you came from",
    # resume and withdraw
    "resume_hint": "To go on later or on another device, keep this personal link:",
    "withdraw_link": "Stop and delete my answers",
    "withdraw_heading": "Stop and delete?",
    "withdraw_body": "All your answers will be deleted now. We keep only the fact that one person "
    "withdrew. This cannot be undone.",
    "withdraw_confirm": "Delete my answers",
    "withdraw_cancel": "Go back to the study",
    "withdrawn_heading": "Your answers were deleted",
    "withdrawn_body": "Thank you for your time. You can close this page.",
    # states
    "closed_heading": "This study is closed",
    "closed_body": "It no longer takes answers. Thank you for your interest.",
    "unopened_heading": "This study has not started yet",
    "unopened_body": "Please come back later.",
    "not_found_heading": "This page does not exist",
    "not_found_body": "Please check the link that you were given.",
    "error_heading": "Something went wrong on our side",
    "error_body": "Nothing of what you answered is lost. Please load this page again in a moment.",
    "bad_request_heading": "That did not work",
    "bad_request_body": "The page may have been open for too long, or was opened in another window. "
    "Go back to the study and continue where you were.",
    "busy_heading": "One moment, please",
    "busy_body": "Too many requests came from this window. Wait a minute, then go on.",
    "back_to_study": "Back to the study",
}


def study_texts(overrides: dict[str, str]) -> dict[str, str]:
    """The table with a study's own wording on top."""
    return TEXTS | overrides

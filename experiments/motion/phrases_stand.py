"""Phrases of standing: at ease, looking about, reaching, leaning on a table, picking something up."""

from __future__ import annotations

import numpy as np

from experiments.motion.score import Score


def shift_weight(score: Score, at: float, side: float, amount: float = 1.0) -> None:
    """Take the weight onto the left (side 1) or right (-1) leg within about a second, `at` s after the beat.

    The hip moves over the leg, the pelvis drops on the free side and that knee gives way.
    """
    _, y, _ = score.last("hip")
    height = score.figure.hip_height
    base = score.beat + at
    score.put("hip", (0.45, (0.022 * side * amount, y + 0.004, height - 0.003)),
              (1.1, (0.042 * side * amount, y, height - 0.004)), at=base)  # fmt: skip
    score.put("roll", (1.1, -2.6 * side * amount), at=base + 0.05)
    score.put("bend", (1.2, 2.4 * side * amount), at=base + 0.1)
    score.put("yaw", (1.2, -3.0 * side * amount), at=base)


def look_about(score: Score, seconds: float, side: float = 1.0) -> None:
    """Stand and look to one side, then down and to the other, the shoulders following the eyes."""
    t = seconds
    score.put("gaze", (0.08 * t, (5.0, 2.0 * side)), (0.18 * t, (3.0, 38.0 * side)),
              (0.36 * t, (6.0, 42.0 * side)), (0.48 * t, (16.0, 8.0 * side)),
              (0.58 * t, (10.0, -4.0 * side)), (0.70 * t, (2.0, -30.0 * side)),
              (0.84 * t, (-6.0, -33.0 * side)), (t, (5.0, 0.0)))  # fmt: skip
    score.put("twist", (0.1 * t, 0.0), (0.26 * t, 9.0 * side), (0.38 * t, 8.0 * side),
              (0.56 * t, 0.5 * side), (0.76 * t, -7.0 * side), (0.86 * t, -6.0 * side), (t, 0.0))  # fmt: skip
    score.wait(seconds)


def reach_for(
    score: Score,
    height: float,
    distance: float,
    hold: float,
    hand: str = "right",
    tiptoe: float = 0.0,
) -> None:
    """Reach for something on a shelf at this height and distance (m) and come back; the feet stay.

    `tiptoe` lifts both heels by that many degrees for a shelf that is high.

    Gaze first; trunk twist and shoulder carry the hand; the weight moves forward and the heel of the
    other side lifts; the other arm swings back.
    """
    sign = 1.0 if hand == "left" else -1.0
    other = "right" if hand == "left" else "left"
    x, y, z = score.last("hip")
    goal = ((0.13 + 0.10 * max(0.0, height - 1.45)) * sign, y - distance, height)
    chest = score.figure.shoulder_height - 0.12
    near = (0.22 * sign, y - max(0.66 * distance, 0.50), min(height - 0.12, chest))
    up = max(0.0, height - 1.45)
    # On the toes the ankles rise by the way from toe joint to ankle times the sine of the lift.
    rise = float(np.sin(np.radians(tiptoe))) * float(np.linalg.norm(score.figure.ball[1:]))
    back = 1.15 + hold
    score.put("gaze", (0.30, (20.0 - 45.0 * (height - 1.1), 7.0 * sign)),
              (back + 0.1, (14.0 - 40.0 * (height - 1.1), 9.0 * sign)), (back + 0.7, (24.0, 10.0 * sign)),
              (back + 1.7, (6.0, 0.0)))  # fmt: skip
    score.put("hip", (0.30, (x, y, z)), (1.05, (x - 0.012 * sign, y - 0.075, z - 0.006 + rise)),
              (back, (x - 0.012 * sign, y - 0.078, z - 0.006 + rise)), (back + 1.1, (x, y, z)))  # fmt: skip
    score.put("twist", (0.25, 0.0), (1.05, -15.0 * sign), (back, -16.0 * sign), (back + 1.1, 1.5 * sign),
              (back + 1.6, 0.0))  # fmt: skip
    score.put("yaw", (0.3, 0.0), (1.1, -5.0 * sign), (back, -5.0 * sign), (back + 1.2, 0.0))
    score.put(
        "flex", (0.3, 4.0), (1.0, 9.0 - 22.0 * up), (back, 10.0 - 22.0 * up), (back + 1.1, 4.0)
    )
    score.put(
        "bend", (0.4, 0.0), (1.1, -10.0 * sign * up), (back, -10.0 * sign * up), (back + 1.0, 0.0)
    )
    score.put("pitch", (0.3, 2.0), (1.05, 5.0), (back, 5.0), (back + 1.1, 2.0))
    score.put(f"{hand}_protract", (0.35, 0.0), (1.05, 13.0), (back, 14.0), (back + 0.8, 0.0))
    score.put(f"{hand}_shrug", (0.4, 0.0), (1.0, 4.0), (back, 4.0), (back + 0.9, 0.0))
    score.start(f"{hand}_hand", *near)
    score.put(f"{hand}_hand", (0.7, near), (1.2, goal), (back, goal), (back + 0.5, near))
    score.put(f"{hand}_reach", (0.28, 0.0), (0.95, 1.0), (back + 0.25, 1.0), (back + 1.15, 0.0))
    score.put(f"{hand}_pronation", (0.4, 24.0), (1.1, 45.0), (back, 45.0), (back + 1.1, 24.0))
    score.put(f"{hand}_wrist", (0.35, 4.0), (0.75, -10.0), (1.15, 10.0), (back, 8.0), (back + 0.5, -8.0),
              (back + 1.2, 4.0))  # fmt: skip
    score.put(f"{hand}_swivel", (0.4, 24.0), (1.1, 34.0 - 50.0 * up), (back + 0.8, 24.0))
    score.put(f"{other}_hang", (0.4, (9.0, 3.0, 17.0, 18.0)), (1.15, (13.0, -9.0, 22.0, 18.0)),
              (back + 0.2, (13.0, -8.0, 22.0, 18.0)), (back + 1.3, (8.5, 5.0, 16.0, 18.0)),
              (back + 1.8, (9.0, 3.0, 17.0, 18.0)))  # fmt: skip
    score.put(
        f"{hand}_heel", (0.45, 0.0), (1.1, 9.0 + tiptoe), (back, 9.0 + tiptoe), (back + 0.8, 0.0)
    )
    if tiptoe:
        score.put(f"{other}_heel", (0.5, 0.0), (1.12, tiptoe), (back, tiptoe), (back + 0.85, 0.0))
    score.wait(back + 1.7)


def lean_on_table(score: Score, height: float, hold: float) -> None:
    """Both hands onto a table top in front, look at it and about, push off again."""
    x, y, z = score.last("hip")
    back = 1.3 + hold
    front = y - 0.50
    score.put("gaze", (0.35, (38.0, 0.0)), (1.3, (48.0, 3.0)), (1.3 + 0.25 * hold, (46.0, 14.0)),
              (1.3 + 0.45 * hold, (24.0, 32.0)), (1.3 + 0.62 * hold, (28.0, 28.0)),
              (1.3 + 0.80 * hold, (45.0, -16.0)), (back + 0.2, (36.0, -4.0)),
              (back + 1.4, (6.0, 0.0)))  # fmt: skip
    score.put("hip", (0.3, (x, y, z)), (1.25, (x + 0.01, y + 0.085, z - 0.022)),
              (1.3 + 0.5 * hold, (x - 0.012, y + 0.08, z - 0.024)), (back, (x, y + 0.085, z - 0.022)),
              (back + 1.3, (x, y, z)))  # fmt: skip
    score.put("pitch", (0.25, 2.0), (1.25, 33.0), (back, 32.0), (back + 1.25, 2.0))
    score.put(
        "flex", (0.3, 4.0), (1.35, 19.0), (1.3 + 0.5 * hold, 15.0), (back, 18.0), (back + 1.35, 4.0)
    )
    score.put(
        "twist", (1.3, 0.0), (1.3 + 0.45 * hold, 6.0), (1.3 + 0.8 * hold, -3.0), (back + 0.8, 0.0)
    )
    score.put("roll", (1.3, 0.0), (1.3 + 0.5 * hold, -2.0), (back, 0.0))
    for sign, side, lag in ((1.0, "left", 0.12), (-1.0, "right", 0.0)):
        place = (0.24 * sign, front - (0.03 if side == "left" else 0.0), height + 0.032)
        above = (0.25 * sign, front + 0.05, height + 0.14)
        score.start(f"{side}_hand", *above)
        score.put(f"{side}_hand", (0.85 + lag, above), (1.25 + lag, place), (back + lag, place),
                  (back + 0.45 + lag, above))  # fmt: skip
        score.put(f"{side}_reach", (0.25 + lag, 0.0), (1.05 + lag, 1.0), (back + 0.15 + lag, 1.0),
                  (back + 1.1 + lag, 0.0))  # fmt: skip
        score.start(f"{side}_palm_frame", -14.0 * sign, 0.0, 0.0)
        score.put(f"{side}_palm", (0.6 + lag, 0.0), (1.2 + lag, 1.0), (back + lag, 1.0),
                  (back + 0.6 + lag, 0.0))  # fmt: skip
        score.put(f"{side}_swivel", (0.4, 24.0), (1.2, 40.0), (back, 40.0), (back + 1.0, 24.0))
    score.wait(back + 1.6)


def pick_up(score: Score, height: float, hand: str = "right") -> None:
    """Bend hips and knees, take something low in front, rise and look at it, let the arm sink."""
    sign = 1.0 if hand == "left" else -1.0
    other = "right" if hand == "left" else "left"
    x, y, z = score.last("hip")
    deep = min(1.0, max(0.2, (0.62 - height) / 0.45))
    low = z - 0.16 - 0.14 * deep
    goal = (0.07 * sign, y - 0.44, height)
    near = (0.16 * sign, y - 0.40, height + 0.14)
    held = (0.15 * sign, y - 0.29, z + 0.20)
    lifted = (0.14 * sign, y - 0.36, 0.55 * z + 0.5 * height)
    score.put("gaze", (0.35, (42.0, 3.0 * sign)), (1.6, (52.0, 2.0 * sign)), (2.3, (44.0, 4.0 * sign)),
              (3.0, (36.0, 8.0 * sign)), (4.2, (34.0, 7.0 * sign)), (5.0, (6.0, 0.0)))  # fmt: skip
    score.put("hip", (0.3, (x, y + 0.01, z - 0.01)), (0.85, (x, y + 0.13, 0.45 * z + 0.55 * low)),
              (1.45, (x - 0.015 * sign, y + 0.15, low)), (1.75, (x - 0.015 * sign, y + 0.15, low)),
              (2.3, (x, y + 0.09, 0.5 * z + 0.5 * low)), (3.0, (x, y, z)))  # fmt: skip
    score.put("pitch", (0.25, 3.0), (0.95, 30.0), (1.5, 44.0 + 8.0 * deep), (1.8, 44.0 + 8.0 * deep),
              (2.4, 26.0), (3.1, 2.0))  # fmt: skip
    score.put(
        "flex",
        (0.35, 6.0),
        (1.0, 20.0),
        (1.55, 33.0),
        (1.85, 33.0),
        (2.5, 17.0),
        (3.2, 5.0),
        (4.4, 4.0),
    )
    score.put("twist", (0.6, 0.0), (1.5, -9.0 * sign), (1.85, -8.0 * sign), (2.9, 0.0))
    score.put("bend", (0.7, 0.0), (1.5, 3.0 * sign), (2.6, 0.0))
    score.start(f"{hand}_hand", *near)
    score.put(
        f"{hand}_hand",
        (1.1, near),
        (1.5, goal),
        (1.82, goal),
        (2.45, lifted),
        (3.25, held),
        (4.1, held),
    )
    score.put(f"{hand}_reach", (0.55, 0.0), (1.25, 1.0), (4.0, 1.0), (4.9, 0.0))
    score.put(
        f"{hand}_pronation",
        (0.7, 24.0),
        (1.4, 50.0),
        (1.9, 45.0),
        (2.9, -20.0),
        (4.0, -18.0),
        (4.8, 24.0),
    )
    score.put(f"{hand}_wrist", (0.8, 0.0), (1.4, 14.0), (1.8, -6.0), (2.9, -8.0), (4.6, 4.0))
    score.put(f"{hand}_protract", (0.8, 0.0), (1.5, 10.0), (2.6, 0.0))
    score.put(f"{other}_hang", (0.7, (12.0, 8.0, 22.0, 20.0)), (1.5, (15.0, 16.0, 34.0, 26.0)),
              (2.3, (11.0, 4.0, 22.0, 18.0)), (3.1, (8.5, 0.0, 14.0, 18.0)),
              (3.9, (9.0, 3.0, 17.0, 18.0)))  # fmt: skip
    score.both("splay", (1.3, 13.0), (1.8, 13.0), (2.9, 3.0), lag=0.06)
    score.both("heel", (0.9, 0.0), (1.5, 7.0 * deep), (1.8, 7.0 * deep), (2.5, 0.0), lag=0.05)
    score.wait(5.1)

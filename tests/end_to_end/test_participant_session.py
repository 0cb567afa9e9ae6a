"""Whole sessions in a real browser, with clips that really play, over the real server."""

from __future__ import annotations

import csv
import json
import os
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
STUDY = """
study_id = "tiny"
title = "Human motion in rooms"
question = "In which clip does the person look more realistic?"
target = "pace"
baselines = ["paak"]
trials_per_cell = 2
seed = 3
[extra_trials]
practice = 1
catch = 1
[checks]
break_every = 3
"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        yield browser
        browser.close()


def pace(*words: object) -> str:
    command = [sys.executable, "-m", "pace_study", *map(str, words)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


class Study:
    """A study under way: its database, its address, its answers."""

    def __init__(
        self, folder: Path, stimuli: Path, extra: str = "", opened: bool = True, **env: str
    ) -> None:
        self.folder = folder
        self.where = ("--database", f"sqlite:///{folder}/study.sqlite")
        (folder / "study.toml").write_text(STUDY + extra)
        pace("study", "create", folder / "study.toml", "--catalogue", stimuli, *self.where)
        if opened:
            self.open()
        words = ["-m", "pace_study", "serve", "--port", "0", "--json", *self.where]
        self.server = subprocess.Popen(
            [sys.executable, *words],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | env,
        )
        assert self.server.stdout is not None
        self.url = json.loads(self.server.stdout.readline())["url"] + "/s/tiny"

    def open(self) -> None:
        pace("study", "open", "tiny", *self.where)

    def sql(self, command: str) -> None:
        with closing(sqlite3.connect(self.folder / "study.sqlite")) as connection:
            connection.execute(command)
            connection.commit()

    def answers(self) -> list[dict[str, str]]:
        pace("study", "export", "tiny", "--out", self.folder / "out", *self.where)
        with (self.folder / "out" / "responses.csv").open(newline="") as stream:
            return list(csv.DictReader(stream))

    def stop(self) -> None:
        self.server.terminate()
        self.server.wait(20)
        assert self.server.stdout is not None
        self.server.stdout.close()


@pytest.fixture
def new_study(tmp_path: Path, playing_stimuli: Path) -> Iterator[Callable[..., Study]]:
    """Starts a study with other checks or settings; at the end its counters must be right."""
    running: list[Study] = []

    def start(*words: Any, **settings: Any) -> Study:
        running.append(Study(tmp_path, playing_stimuli, *words, **settings))
        return running[-1]

    yield start
    for one in running:
        one.stop()
        told = json.loads(pace("study", "doctor", "tiny", "--json", *one.where))
        assert told["findings"] == []


@pytest.fixture
def study(new_study: Callable[..., Study]) -> Study:
    return new_study()


@pytest.fixture
def visit(chromium: Browser) -> Iterator[Callable[..., Page]]:
    """Opens a page in a fresh browser profile; any script error fails the test."""
    contexts: list[BrowserContext] = []
    faults: list[str] = []

    def open_page(url: str, **options: Any) -> Page:
        context = chromium.new_context(**options)
        context.set_default_timeout(30_000)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(url)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert faults == []


def begin(page: Page) -> None:
    page.get_by_test_id("consent-agree").click()
    page.get_by_test_id("begin").click()
    page.get_by_test_id("play-both").wait_for()


def trial_of(page: Page) -> str | None:
    return page.locator("#trial").get_attribute("data-trial")


def leave(page: Page, trial: str | None) -> None:
    """Wait until the next page has come."""
    page.wait_for_function(
        "old => { const t = document.querySelector('#trial'); return !t || t.dataset.trial !== old; }",
        arg=trial,
    )


def choose(page: Page, position: str = "first") -> None:
    """Play both clips, choose, confirm."""
    trial = trial_of(page)
    page.get_by_test_id("play-both").click()
    page.get_by_test_id(f"choose-{position}").click()
    page.get_by_test_id("confirm").click()
    leave(page, trial)


def test_a_participant_plays_and_answers_a_whole_session(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url, viewport={"width": 1366, "height": 700})
    begin(page)
    for _ in range(6):
        expect(page.get_by_test_id("progress")).to_be_visible()
        choose(page)
    expect(page.get_by_test_id("completion-code")).to_have_text(
        r := page.get_by_test_id("completion-code").inner_text()
    )
    assert len(r) == 8
    rows = study.answers()
    assert [row["trial_kind"] for row in rows].count("main") == 4 and len(rows) == 6
    assert {(row["viewed_first"], row["viewed_second"]) for row in rows} == {("proven", "proven")}
    assert {(row["layout"], row["plays_first"], row["late"]) for row in rows} == {
        ("side_by_side", "1", "false")
    }
    assert all(int(row["response_time_ms"]) >= 900 for row in rows)


def test_choosing_opens_only_after_both_clips_were_played_to_the_end(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url)
    begin(page)
    expect(page.get_by_test_id("choose-first")).to_be_disabled()
    page.get_by_test_id("play-first").click()
    expect(page.locator("#seen-first")).to_have_text("✓")
    expect(page.get_by_test_id("choose-first")).to_be_disabled()
    # Seeking to the end fires `ended` at once; it must not count as seen.
    page.locator("#video-second").evaluate("v => { v.currentTime = v.duration; return v.play(); }")
    page.wait_for_function("() => document.querySelector('#video-second').ended")
    expect(page.get_by_test_id("choose-first")).to_be_disabled()
    page.get_by_test_id("play-second").click()
    expect(page.get_by_test_id("choose-first")).to_be_enabled()
    expect(page.get_by_test_id("confirm")).to_be_disabled()


def test_fast_playback_is_not_watching(study: Study, visit: Callable[..., Page]) -> None:
    page = visit(study.url)
    begin(page)
    page.evaluate(
        "() => document.querySelectorAll('video').forEach(v =>"
        " v.addEventListener('playing', () => { v.playbackRate = 4; }))"
    )
    page.get_by_test_id("play-both").click()
    page.wait_for_function("() => [...document.querySelectorAll('video')].every(v => v.ended)")
    expect(page.get_by_test_id("choose-first")).to_be_disabled()


def test_the_keys_do_everything_and_can_be_switched_off(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url)
    begin(page)
    trial = trial_of(page)
    page.keyboard.press("Space")
    expect(page.get_by_test_id("choose-second")).to_be_enabled()
    page.keyboard.press("2")
    expect(page.get_by_test_id("choose-second")).to_be_checked()
    page.keyboard.press("1")
    page.keyboard.press("Enter")
    leave(page, trial)
    page.get_by_label("Keyboard shortcuts").uncheck()
    page.keyboard.press("Space")
    page.wait_for_timeout(300)
    assert page.evaluate("() => document.querySelector('#video-first').paused")
    page.reload()
    expect(page.get_by_label("Keyboard shortcuts")).not_to_be_checked()
    assert [row["chosen_position"] for row in study.answers()] == ["first"]


def test_a_reload_in_mid_trial_and_a_second_tab_stay_on_the_same_trial(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url)
    begin(page)
    trial = trial_of(page)
    page.get_by_test_id("play-both").click()
    page.wait_for_timeout(300)
    page.reload()
    assert trial_of(page) == trial
    other = page.context.new_page()
    other.goto(study.url)
    assert trial_of(other) == trial
    choose(page, "first")
    other.get_by_test_id("play-both").click()
    other.get_by_test_id("choose-second").click()
    other.get_by_test_id("confirm").click()
    leave(other, trial)
    assert trial_of(other) == trial_of(page)
    assert [row["chosen_position"] for row in study.answers()] == ["first"]


def test_an_answer_survives_a_line_that_is_down_and_a_reload(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url)
    begin(page)
    trial = trial_of(page)
    page.get_by_test_id("play-both").click()
    page.get_by_test_id("choose-second").click()
    page.context.set_offline(True)
    page.get_by_test_id("confirm").click()
    expect(page.locator("#status")).to_contain_text("No connection")
    page.context.set_offline(False)
    leave(page, trial)
    assert [row["chosen_position"] for row in study.answers()] == ["second"]


def test_a_clip_that_cannot_be_had_is_told_and_may_be_skipped_after_a_second_try(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url)
    page.get_by_test_id("consent-agree").click()
    page.route("**/m/*", lambda route: route.fulfill(status=404))
    page.get_by_test_id("begin").click()
    trial = trial_of(page)
    expect(page.locator("#status")).to_have_text("A clip could not be loaded.")
    expect(page.locator("#skip")).to_be_hidden()
    page.locator("#retry").click()
    page.locator("#skip").click()
    leave(page, trial)
    assert study.answers() == []


class Inspector:
    """axe, the width, and a screenshot of a page in both themes."""

    def __init__(self, page: Page, folder: Path) -> None:
        self.page, self.folder = page, folder
        self.checked: set[str] = set()

    def __call__(self, name: str) -> None:
        from axe_playwright_python.sync_playwright import Axe

        for scheme in ("light", "dark"):
            self.page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
            found = Axe().run(self.page).response["violations"]
            assert [(name, scheme, f["id"], f["nodes"][0]["html"]) for f in found] == []
            self.page.screenshot(path=self.folder / f"{name}-{scheme}.png", full_page=True)
        width = self.page.evaluate("() => document.documentElement.scrollWidth")
        assert width <= self.page.viewport_size["width"], f"{name} is {width} px wide"
        self.checked.add(name)


def test_every_page_on_the_way_is_accessible_in_both_themes_on_a_narrow_phone(
    tmp_path: Path, new_study: Callable[..., Study], visit: Callable[..., Page]
) -> None:
    study = new_study("comprehension = true\ndemographics = true\n")
    page = visit(study.url, viewport={"width": 320, "height": 640})
    check = Inspector(page, tmp_path)
    check("consent")
    page.get_by_test_id("consent-agree").click()
    page.wait_for_function("() => document.querySelector('[name=kbit]').value > 0")
    check("instructions")
    page.set_viewport_size({"width": 320, "height": 300})
    expect(page.get_by_test_id("begin")).to_be_disabled()
    check("instructions-small")
    page.set_viewport_size({"width": 320, "height": 640})
    page.get_by_test_id("begin").click()
    check("demographics")
    page.get_by_test_id("demographics-submit").click()
    check("comprehension")
    page.get_by_label("music").check()
    page.get_by_test_id("comprehension-submit").click()
    check("comprehension-again")
    page.get_by_test_id("comprehension-right").check()
    page.get_by_test_id("comprehension-submit").click()
    page.get_by_test_id("play-both").wait_for()
    check("trial")
    for _ in range(6):
        choose(page)
        for mark in ("[data-testid=practice-feedback]", "#pause"):
            if page.locator(mark).count():
                check("trial-" + ("break" if mark == "#pause" else "practised"))
    check("done")
    page.locator("textarea").fill("All fine")
    page.get_by_test_id("comments-submit").click()
    check("done-noted")
    page.goto(study.url + "/withdraw")
    check("withdraw")
    page.get_by_test_id("withdraw-confirm").click()
    check("withdrawn")
    assert len(check.checked) == 13


def test_every_page_of_trouble_is_accessible_in_both_themes_and_helps(
    tmp_path: Path, new_study: Callable[..., Study], visit: Callable[..., Page]
) -> None:
    study = new_study(opened=False, PACE_REQUESTS_PER_MINUTE="100")
    page = visit(study.url, viewport={"width": 320, "height": 640})
    check = Inspector(page, tmp_path)

    def meet(name: str, path: str, status: int, words: str) -> None:
        reply = page.goto(study.url + path)
        assert reply is not None and reply.status == status
        expect(page.locator("main")).to_contain_text(words)
        check(name)

    meet("unopened", "", 409, "has not started yet")
    study.open()
    meet("not-found", "/none", 404, "check the link")
    meet("stranger", "/withdraw", 400, "Go back to the study")
    page.goto(study.url)
    page.get_by_test_id("consent-agree").click()
    study.sql("ALTER TABLE study_version RENAME TO away")
    meet("database-away", "/session", 503, "Nothing of what you answered is lost")
    study.sql("ALTER TABLE away RENAME TO study_version")
    page.get_by_text("Back to the study").click()
    page.get_by_test_id("begin").wait_for()
    page.evaluate("async () => { for (let i = 0; i < 101; i += 1) await fetch('withdraw'); }")
    meet("busy", "/withdraw", 429, "Wait a minute")
    page.get_by_test_id("begin").or_(page.get_by_text("Back to the study")).click()
    pace("study", "close", "tiny", *study.where)
    meet("closed", "/session", 409, "no longer takes answers")
    assert len(check.checked) == 6


def test_a_clip_that_cannot_be_decoded_is_told(study: Study, visit: Callable[..., Page]) -> None:
    page = visit(study.url)
    page.get_by_test_id("consent-agree").click()
    page.route(
        "**/m/*", lambda route: route.fulfill(body=b"no video" * 99, content_type="video/mp4")
    )
    page.get_by_test_id("begin").click()
    expect(page.locator("#status")).to_have_text("A clip could not be loaded.")
    page.unroute("**/m/*")
    page.locator("#retry").click()
    choose(page)
    assert len(study.answers()) == 1


def test_a_hidden_page_a_blocked_start_and_a_jumping_clock_spoil_nothing_for_good(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url)
    begin(page)
    trial = trial_of(page)
    page.evaluate(BLOCK_ONCE)
    page.get_by_test_id("play-first").click()
    expect(page.locator("#status")).to_contain_text("did not start the clips")
    page.get_by_test_id("play-both").click()
    page.wait_for_function("() => document.querySelector('#video-first').currentTime > 0.2")
    page.evaluate(HIDE, True)
    assert page.evaluate("() => [...document.querySelectorAll('video')].every(v => v.paused)")
    page.evaluate(HIDE, False)
    expect(page.locator("#status")).to_contain_text("was hidden")
    expect(page.get_by_test_id("choose-first")).to_be_disabled()
    page.evaluate("() => { const now = Date.now; Date.now = () => now() + 864e5; }")
    choose(page)
    assert trial_of(page) != trial
    row = study.answers()[0]
    assert (row["viewed_first"], row["plays_first"]) == ("proven", "2")
    assert int(row["response_time_ms"]) < 60_000


BLOCK_ONCE = """() => {
  const video = document.querySelector('#video-first');
  video.play = () => {
    delete video.play;
    return Promise.reject(new DOMException('no gesture', 'NotAllowedError'));
  };
}"""
HIDE = """(hidden) => {
  Object.defineProperty(document, 'hidden', { configurable: true, get: () => hidden });
  document.dispatchEvent(new Event('visibilitychange'));
}"""


def test_a_slow_line_is_told_and_too_slow_a_one_is_turned_away_with_the_reason(
    new_study: Callable[..., Study], visit: Callable[..., Page]
) -> None:
    study = new_study("min_kbit_s = 1000\n")
    page = visit(study.url)
    devtools = page.context.new_cdp_session(page)
    slow = {"offline": False, "latency": 50, "uploadThroughput": -1, "downloadThroughput": 40_000}
    devtools.send("Network.enable")
    devtools.send("Network.emulateNetworkConditions", slow)
    page.get_by_test_id("consent-agree").click()
    expect(page.locator("#screen-message")).to_contain_text("takes a few seconds")
    expect(page.locator("#screen-message")).to_contain_text("needs about 1000", timeout=15_000)
    expect(page.get_by_test_id("begin")).to_be_disabled()
    devtools.send("Network.emulateNetworkConditions", slow | {"downloadThroughput": -1})
    page.reload()
    page.get_by_test_id("begin").click()
    trial = trial_of(page)
    page.route("**/m/*", lambda route: None)
    page.reload()
    assert trial_of(page) == trial
    expect(page.locator("#status")).to_contain_text("slow at the moment", timeout=10_000)
    page.unroute_all(behavior="ignoreErrors")


def test_the_back_button_leads_to_the_trial_that_is_due(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url)
    begin(page)
    choose(page)
    due = trial_of(page)
    for _ in range(2):
        page.go_back()
        page.goto(study.url)
        assert trial_of(page) == due
    page.go_back(wait_until="load")
    page.wait_for_function(f"() => document.querySelector('#trial')?.dataset.trial === '{due}'")
    assert len(study.answers()) == 1


def test_a_database_that_is_locked_for_a_while_loses_and_doubles_nothing(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url)
    begin(page)
    trial = trial_of(page)
    page.get_by_test_id("play-both").click()
    page.get_by_test_id("choose-second").click()
    lock = sqlite3.connect(study.folder / "study.sqlite")
    lock.execute("BEGIN EXCLUSIVE")
    page.get_by_test_id("confirm").click()
    expect(page.locator("#status")).to_contain_text("No connection", timeout=25_000)
    lock.rollback()
    lock.close()
    leave(page, trial)
    assert [row["chosen_position"] for row in study.answers()] == ["second"]


def test_clips_that_run_apart_are_brought_back_in_step(
    study: Study, visit: Callable[..., Page]
) -> None:
    page = visit(study.url)
    begin(page)
    page.get_by_test_id("play-both").click()
    page.wait_for_function("() => document.querySelector('#video-first').currentTime > 0.2")
    page.locator("#video-second").evaluate("v => { v.currentTime = 0; }")
    apart = page.evaluate(MEASURE_DRIFT)
    assert apart < 0.08, "they ended within about a frame of each other"


MEASURE_DRIFT = """() => new Promise((resolve) => {
  const [one, two] = document.querySelectorAll('video');
  let last = 1;
  const look = () => {
    if (one.ended || two.ended) resolve(last);
    else if (!one.seeking && !two.seeking) last = Math.abs(one.currentTime - two.currentTime);
    if (!one.ended && !two.ended) requestAnimationFrame(look);
  };
  look();
})"""

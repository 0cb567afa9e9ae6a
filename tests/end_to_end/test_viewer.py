"""The 3D page in a real browser, opened from the disk, against the body model's own numbers."""

from __future__ import annotations

import dataclasses
import functools
import http.server
import json
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect, sync_playwright

from experiments.body.embedded import load_body
from experiments.motion.library import load_motion, trim
from experiments.motion.motion import Motion
from experiments.placement.placement import Placement, read_placement, write_placement
from experiments.scene.baking import load_room
from experiments.view import skin_marks
from renderer.gltf import UNMARKED

ROOT = Path(__file__).resolve().parents[2]
FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",  # the processor draws: no graphics card is needed
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
FRAMES = 24
READY = "html[data-state=ready]"


def place(motion: Motion, method: str, stem: Path) -> Path:
    placement = Placement(
        "bedroom", motion.motion_id, method, np.zeros(3), 0.0, motion, False,
        np.ones(motion.n_frames), {"total": 0.0}, 1, "0" * 16,
    )  # fmt: skip
    return write_placement(placement, stem)[1]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """A page of two placements: one as the motion is, one turned to the side and 30 mm in the floor."""
    folder = tmp_path_factory.mktemp("viewer")
    sitting = trim(load_motion("sit_stay_stand"), FRAMES / 30)
    above = dataclasses.replace(sitting, transl=sitting.transl + np.array([2.0, 2.2, 0.0]))
    sunk = dataclasses.replace(sitting, transl=sitting.transl + np.array([2.6, 1.6, -0.03]))
    stems = {
        "pace": place(above, "pace", folder / "a"),
        "posa_t": place(sunk, "posa_t", folder / "b"),
    }
    command = [sys.executable, "-m", "pace_study", "view", *map(str, stems.values())]
    command += ["--out", str(folder / "page"), "--json"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    motions = {key: read_placement(stem).motion for key, stem in stems.items()}
    return SimpleNamespace(out=folder / "page", told=json.loads(done.stdout), motions=motions)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        yield browser
        browser.close()


def opened(chromium: Browser, address: str, wait_for: str = READY, **options: Any) -> Page:
    context = chromium.new_context(**{"viewport": {"width": 900, "height": 420}, **options})
    page = context.new_page()
    heard: list[str] = []
    page.on("console", lambda message: heard.append(message.text))
    page.on("pageerror", lambda error: heard.append(str(error)))
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(address)
    page.wait_for_selector(wait_for, timeout=120_000)
    page.heard, page.asked = heard, asked  # type: ignore[attr-defined]
    return page


@pytest.fixture(scope="module")
def shared_page(chromium: Browser, made: SimpleNamespace) -> Iterator[Page]:
    page = opened(chromium, (made.out / "index.html").as_uri())
    yield page
    page.context.close()


@pytest.fixture
def page(shared_page: Page) -> Page:
    """The page as it is when opened: stopped at frame 0, first method, nothing switched on."""
    state = shared_page.evaluate("paceViewer.state()")
    for key, on in (("c", state["overlay"]), ("g", state["ghosts"]), ("f", state["follow"])):
        if on:
            shared_page.keyboard.press(key)
    shared_page.locator("#canvas").focus()
    for key in ("1", "Home", "r"):
        shared_page.keyboard.press(key)
    while shared_page.evaluate("paceViewer.state().walls") != "cutaway":
        shared_page.keyboard.press("x")
    return shared_page


def state(page: Page) -> dict[str, Any]:
    found: dict[str, Any] = page.evaluate("paceViewer.state()")
    return found


def settled(page: Page) -> None:
    """Wait for two drawn frames."""
    page.evaluate(
        "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )


@pytest.mark.parametrize("method", ["pace", "posa_t"])
@pytest.mark.parametrize("frame", [0, 11, FRAMES - 1])
def test_vertices_stand_where_the_body_model_puts_them(
    page: Page, made: SimpleNamespace, method: str, frame: int
) -> None:
    body, motion = load_body("male_slim"), made.motions[method]
    pose, transl = torch.as_tensor(motion.pose[[frame]]), torch.as_tensor(motion.transl[[frame]])
    exact = body.posed(pose, transl).vertices[0].numpy()
    chosen = np.random.default_rng(frame).integers(0, body.n_vertices, 300).tolist()
    script = "([m, f, vs]) => vs.map(v => paceViewer.vertex(m, f, v))"
    seen = np.array(page.evaluate(script, [method, frame, chosen]))
    gap = 1000 * np.linalg.norm(seen - exact[chosen], axis=1)
    stated = made.told["bodies"][method]
    assert gap.max() <= stated["error_max_mm"] + 0.05
    assert np.percentile(gap, 98) <= stated["error_p99_mm"] + 0.05
    assert np.median(gap) < 0.05
    assert stated["error_p99_mm"] <= 1.0 and stated["error_max_mm"] <= 10.0


def test_what_is_drawn_is_what_the_numbers_say(page: Page) -> None:
    page.evaluate("paceViewer.seek(7)")
    drawn = page.evaluate("[0, 500, 9000].map(v => paceViewer.drawnVertex('pace', v))")
    told = page.evaluate("[0, 500, 9000].map(v => paceViewer.vertex('pace', 7, v))")
    assert np.allclose(drawn, told, atol=1e-6)


def test_between_frames_the_body_turns_on_evenly(page: Page) -> None:
    early, middle, late = (
        np.array(page.evaluate("f => paceViewer.vertex('pace', f, 5000)", frame))
        for frame in (5, 5.5, 6)
    )
    assert np.linalg.norm(middle - (early + late) / 2) < 0.1 * np.linalg.norm(late - early) + 1e-5


def test_play_moves_the_clock_and_pause_stops_on_a_whole_frame(page: Page) -> None:
    page.locator("#speed").select_option("0.1")
    page.locator("#play").click()
    page.wait_for_function("paceViewer.state().frame >= 2")
    assert state(page)["playing"]
    expect(page.locator("#play-label")).to_have_text("Pause")
    page.keyboard.press("Space")
    stopped = state(page)["frame"]
    page.wait_for_timeout(400)
    assert state(page)["frame"] == stopped and not state(page)["playing"]
    page.locator("#speed").select_option("1")


def test_frames_step_by_button_and_by_key_and_stop_at_the_ends(page: Page) -> None:
    page.locator("#forward").click()
    page.locator("#forward").click()
    page.locator("#back").click()
    assert state(page)["frame"] == 1
    for key, frame in [
        ("ArrowRight", 2), ("Shift+ArrowRight", 12), ("End", FRAMES - 1),
        ("ArrowRight", FRAMES - 1), ("ArrowLeft", FRAMES - 2), ("Home", 0), ("ArrowLeft", 0),
    ]:  # fmt: skip
        page.keyboard.press(key)
        assert state(page)["frame"] == frame, key


def test_the_scrubber_goes_to_a_frame_and_shows_it(page: Page) -> None:
    page.locator("#scrub").fill("17")
    settled(page)
    assert state(page)["frame"] == 17
    expect(page.locator("#frame")).to_have_text(f"Frame 18 / {FRAMES}")


def test_switching_methods_keeps_the_clock(page: Page) -> None:
    page.keyboard.press("End")
    before = page.locator("#canvas").screenshot()
    page.locator("#methods").get_by_text("POSA-T").click()
    assert (state(page)["method"], state(page)["frame"]) == ("posa_t", FRAMES - 1)
    settled(page)
    assert page.locator("#canvas").screenshot() != before
    page.keyboard.press("1")
    assert state(page)["method"] == "pace"


@pytest.mark.parametrize("method", ["pace", "posa_t"])
def test_the_overlay_paints_what_the_signed_distance_says(
    page: Page, made: SimpleNamespace, method: str
) -> None:
    marks = skin_marks(made.motions[method], load_room("bedroom"), 10.0)[9]
    touching = np.flatnonzero((marks != UNMARKED) & (marks >= -100))
    inside = np.flatnonzero(marks < -100)
    page.keyboard.press("c")
    page.locator(f"#methods label:has(input[value={method}])").click()
    page.evaluate("paceViewer.seek(9)")
    expect(page.locator("#now-contacts")).to_have_text(f"{len(touching):,}")
    expect(page.locator("#now-penetrations")).to_have_text(f"{len(inside):,}")
    told = dict(page.evaluate("m => paceViewer.marks(m, 9)", method))
    assert sorted(told) == sorted([*touching, *inside])
    assert np.allclose([told[v] for v in inside], -marks[inside] / 10)
    for vertex in (touching[:1], inside[:1]):
        for v in vertex.tolist():
            red, green, _ = page.evaluate("([m, v]) => paceViewer.colour(m, v)", [method, v])
            assert (green > red) == (v in touching)
    clean = int(np.flatnonzero(marks == UNMARKED)[0])
    colour = page.evaluate("([m, v]) => paceViewer.colour(m, v)", [method, clean])
    assert max(colour) - min(colour) < 0.1
    assert method == "pace" or len(inside) > 100


def test_the_legend_names_the_tolerance_only_while_the_overlay_is_on(page: Page) -> None:
    expect(page.locator("#legend")).to_be_hidden()
    page.locator("#overlay").click()
    expect(page.locator("#legend")).to_contain_text("within 10 mm of a surface")
    assert state(page)["overlay"]


def test_walls_are_cut_away_seen_through_or_solid(page: Page) -> None:
    groups = {"wall:n", "wall:e", "wall:s", "wall:w"}
    cut = state(page)
    assert 0 < len(groups & set(cut["visible"])) < 4
    page.locator("#walls").get_by_text("X-ray").click()
    settled(page)
    xray = state(page)
    assert xray["walls"] == "xray" and "room" in xray["faded"] and "floor" not in xray["faded"]
    page.keyboard.press("x")
    settled(page)
    solid = state(page)
    assert groups <= set(solid["visible"]) and solid["faded"] == []


def test_the_view_turns_by_dragging_and_comes_back(page: Page) -> None:
    settled(page)
    home = np.array(state(page)["eye"])
    page.mouse.move(200, 200)
    page.mouse.down()
    page.mouse.move(300, 210, steps=4)
    page.mouse.up()
    settled(page)
    turned = np.array(state(page)["eye"])
    assert np.linalg.norm(turned - home) > 0.3
    target = np.array(state(page)["target"])
    assert np.isclose(np.linalg.norm(turned - target), np.linalg.norm(home - target), rtol=1e-3)
    page.wait_for_timeout(600)  # the turn runs out
    page.keyboard.press("r")
    assert np.allclose(state(page)["eye"], home, atol=1e-6)


def test_the_views_of_the_clips_stand_around_the_body(page: Page) -> None:
    eyes = []
    for _ in range(4):
        eyes.append(np.subtract(state(page)["eye"], state(page)["target"])[:2])
        page.keyboard.press("v")
    angles = np.sort(np.degrees([np.arctan2(y, x) for x, y in eyes]) % 360)
    assert np.allclose(np.diff(angles), 90, atol=0.5)


def test_following_keeps_the_body_in_the_middle(page: Page) -> None:
    page.keyboard.press("f")
    for frame in (0, 20):
        page.evaluate("f => paceViewer.seek(f)", frame)
        pelvis = np.array(page.evaluate("paceViewer.drawnVertex('pace', 5000)"))
        assert np.linalg.norm(pelvis - state(page)["target"]) < 1.2
    assert state(page)["follow"]


def test_nothing_is_fetched_and_nothing_complained(shared_page: Page) -> None:
    heard, asked = shared_page.heard, shared_page.asked  # type: ignore[attr-defined]
    assert heard == []
    assert {url.split(":", 1)[0] for url in asked} <= {"file", "blob", "data"}


def test_the_page_also_works_from_a_plain_web_server(
    chromium: Browser, made: SimpleNamespace
) -> None:
    handler = functools.partial(_Quiet, directory=str(made.out))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        origin = f"http://127.0.0.1:{server.server_port}"
        page = opened(chromium, f"{origin}/index.html#method=posa_t&frame=5&overlay=1")
        found, asked = state(page), page.asked  # type: ignore[attr-defined]
        page.context.close()
        server.shutdown()
    assert (found["method"], found["frame"], found["overlay"]) == ("posa_t", 5, True)
    assert {url.split("/index")[0].split("/data/")[0] for url in asked if url[:4] == "http"} == {
        origin
    }


def test_a_missing_data_file_is_named(
    chromium: Browser, made: SimpleNamespace, tmp_path: Path
) -> None:
    shutil.copytree(made.out, tmp_path / "page")
    (tmp_path / "page" / "data" / "posa_t.js").unlink()
    page = opened(chromium, (tmp_path / "page/index.html").as_uri(), "html[data-state=error]")
    expect(page.locator("#cover")).to_contain_text("data/posa_t.js is missing")
    page.context.close()


def test_a_damaged_data_file_is_named(
    chromium: Browser, made: SimpleNamespace, tmp_path: Path
) -> None:
    shutil.copytree(made.out, tmp_path / "page")
    (tmp_path / "page/data/pace.js").write_text('paceViewerData("pace", "H4sIAAAAAAAA");\n')
    page = opened(chromium, (tmp_path / "page/index.html").as_uri(), "html[data-state=error]")
    expect(page.locator("#cover")).to_contain_text("data/pace.js is damaged")
    page.context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_narrow_screen_shows_everything_and_all_can_use_it(
    chromium: Browser, made: SimpleNamespace, scheme: str
) -> None:
    address = (made.out / "index.html").as_uri() + "#overlay=1"
    size = {"width": 390, "height": 844}
    page = opened(chromium, address, viewport=size, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    expect(page.locator("#play")).to_be_in_viewport()
    boxes = [page.locator(f).bounding_box() for f in (".buttons", ".reading", "#speed")]
    edges = [(box["x"], box["x"] + box["width"]) for box in boxes if box]
    assert all(one[1] <= two[0] for one, two in pairwise(edges))
    found = Axe().run(page).response["violations"]
    page.context.close()
    assert [(fault["id"], fault["help"]) for fault in found] == []


class _Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves a folder and says nothing."""

    def log_message(self, *_: Any) -> None:
        return

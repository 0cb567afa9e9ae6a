"""Clips end to end: what is written, what is refused, what repeats."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from renderer import offscreen
from renderer.files import InputError, file_sha256
from renderer.render import open_session, output_frames, render_clip, render_still
from renderer.video import probe

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "tests" / "data" / "renderer" / "still.png"
TOLERANCE = 0.02
"""Relative error of a still against its stored reference; another Mesa draws edges a bit otherwise."""


@pytest.fixture(scope="module")
def clip(synthetic, stage, rig, tmp_path_factory):
    folder = tmp_path_factory.mktemp("clip")
    seen: list[tuple[int, int]] = []
    made = render_clip(
        stage, rig, synthetic.small, folder / "a.mp4", folder / "a.png",
        lambda done, total: seen.append((done, total)),
    )  # fmt: skip
    return made, folder, seen


def test_a_clip_is_what_its_record_says(clip):
    made, folder, _ = clip
    found = probe(folder / made.file)
    assert (found.width, found.height) == (made.width, made.height) == (640, 360)
    assert found.n_frames == made.n_frames == 5 and found.fps == made.fps == 30.0
    assert (found.codec, found.pixel_format, found.tags) == ("h264", "yuv420p", ())
    assert made.sha256 == file_sha256(folder / made.file)
    assert made.duration_s == pytest.approx(found.duration_s)


def test_progress_counts_every_frame(clip):
    assert clip[2] == [(k, 5) for k in range(1, 6)]


def test_the_poster_is_the_first_frame(synthetic, stage, rig, clip):
    made, folder, _ = clip
    poster = np.asarray(Image.open(folder / made.poster))
    still = render_still(stage, rig, "view-1", 0, synthetic.small)
    assert (poster[:179, :319] == still[:179, :319]).all()


def test_the_index_stands_in_front_of_the_data(clip):
    content = (clip[1] / clip[0].file).read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")


@pytest.mark.parametrize("threads", ["0", "1", "2"])
def test_another_process_and_other_thread_counts_give_the_same_bytes(clip, threads, tmp_path):
    program = (
        "import importlib.util, sys; from pathlib import Path\n"
        "spec = importlib.util.spec_from_file_location('room', sys.argv[1])\n"
        "room = importlib.util.module_from_spec(spec); spec.loader.exec_module(room)\n"
        "from renderer.render import render_clip\n"
        "stage = room.make_stage(); out = Path(sys.argv[2])\n"
        "made = render_clip(stage, room.make_rig(stage), room.SMALL, out / 'b.mp4', out / 'b.png')\n"
        "print(made.sha256, made.frames_sha256)\n"
    )
    room = str(Path(__file__).with_name("conftest.py"))
    result = subprocess.run(
        [sys.executable, "-c", program, room, str(tmp_path)], cwd=ROOT, text=True,
        capture_output=True, env={**os.environ, "LP_NUM_THREADS": threads},
    )  # fmt: skip
    assert result.stdout.split() == [clip[0].sha256, clip[0].frames_sha256], result.stderr


@pytest.mark.parametrize("platform", ["osmesa", "egl"])
def test_a_still_looks_like_its_reference_on_both_platforms(platform, tmp_path):
    """Remake the reference with tests/renderer/make_reference.py after a wanted change of look."""
    made = tmp_path / "made.png"
    script = Path(__file__).with_name("make_reference.py")
    result = subprocess.run(
        [sys.executable, str(script), "--platform", platform, str(made)],
        cwd=ROOT, text=True, capture_output=True,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert REFERENCE.is_file(), f"{REFERENCE} is missing: make it with {script.name}"
    ours, wanted = (np.asarray(Image.open(p), dtype=np.float64) for p in (made, REFERENCE))
    error = np.linalg.norm(ours - wanted) / np.linalg.norm(wanted)
    if error >= TOLERANCE:
        wrong = ROOT / "out" / f"wrong-still-{platform}.png"
        wrong.parent.mkdir(exist_ok=True)
        wrong.write_bytes(made.read_bytes())
    assert error < TOLERANCE, f"compare out/wrong-still-{platform}.png with {REFERENCE}"


def test_single_shows_the_best_view_alone(synthetic, stage, rig, tmp_path):
    settings = dataclasses.replace(synthetic.tiny, tiling="single")
    made = render_clip(stage, rig, settings, tmp_path / "a.mp4", tmp_path / "a.png")
    still = render_still(stage, rig, rig.best().name, 0, settings)
    assert (made.width, made.height) == (96, 54)
    assert (np.asarray(Image.open(tmp_path / "a.png")) == still).all()


def test_a_room_is_drawn_once_for_the_clips_that_share_it(synthetic, stage, rig):
    from renderer.session import _Kept

    moved = dataclasses.replace(stage, vertices=stage.vertices[::-1].copy())
    with open_session(stage, rig.views, synthetic.tiny) as session:
        first, room = session.frame(stage.vertices[0])[0], _Kept.room
    with open_session(moved, rig.views, synthetic.tiny) as session:
        again = session.frame(moved.vertices[-1])[0]
        assert _Kept.room is room
    assert (first == again).all()


def test_a_session_with_other_furniture_does_not_see_the_old_room(synthetic, stage, rig):
    bare = dataclasses.replace(stage, parts=stage.parts[:1])
    full, empty = (render_still(s, rig, "view-1", 0, synthetic.tiny) for s in (stage, bare))
    assert (full != empty).any(axis=-1).mean() > 0.2


@pytest.mark.parametrize(("fps", "wanted"), [(30.0, [0, 1, 2, 3, 4]), (15.0, [0, 2, 4])])
def test_frames_are_taken_by_time(fps, wanted):
    assert output_frames(5, 30.0, fps).tolist() == wanted


def test_a_motion_at_120_hertz_keeps_its_duration_at_30():
    index = output_frames(481, 120.0, 30.0)
    assert len(index) == 121 and index[-1] == 480


def broken(stage, **changes):
    return dataclasses.replace(stage, **changes)


def test_what_cannot_be_drawn_is_named_and_leaves_nothing(synthetic, stage, rig, tmp_path):
    holed = stage.vertices.copy()
    holed[2, 7] = np.inf
    textured = dataclasses.replace(stage.parts[0], uv=None)
    bent = dataclasses.replace(stage.parts[1], corners=stage.parts[1].corners * np.nan)
    faults = {
        "not finite in frame 2": broken(stage, vertices=holed),
        "0 frames": broken(stage, vertices=stage.vertices[:0]),
        "faces: got 99999": broken(stage, faces=np.array([[0, 1, 99999]])),
        "floor: uv": broken(stage, parts=(textured, *stage.parts[1:])),
        "wall:n: corners": broken(stage, parts=(bent, *stage.parts[2:])),
        "parts: got 0": broken(stage, parts=()),
    }
    for message, fault in faults.items():
        with pytest.raises(InputError, match=message):
            render_clip(fault, rig, synthetic.tiny, tmp_path / "a.mp4", tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_degenerate_faces_and_missing_normals_are_drawn_without_a_trace(synthetic, stage, rig):
    floor = stage.parts[0]
    flat = np.repeat(floor.corners[:3, :1], 3, axis=1)
    more = dataclasses.replace(
        floor,
        corners=np.concatenate([floor.corners, flat]),
        normals=np.concatenate([floor.normals, np.full_like(flat, np.nan)]),
        colours=np.concatenate([floor.colours, np.ones_like(flat)]),
        occlusion=np.concatenate([floor.occlusion, np.ones_like(flat[..., 0])]),
        uv=np.concatenate([floor.uv, np.zeros_like(flat[..., :2])]),
    )
    lost = dataclasses.replace(more, normals=np.zeros_like(more.normals))
    pictures = [
        render_still(broken(stage, parts=(p, *stage.parts[1:])), rig, "view-2", 1, synthetic.tiny)
        for p in (floor, more, lost)
    ]
    assert (pictures[0] == pictures[1]).all() and (pictures[0] == pictures[2]).all()


def test_a_body_that_is_wound_inwards_looks_the_same(synthetic, stage, rig):
    turned = broken(stage, faces=np.ascontiguousarray(stage.faces[:, ::-1]))
    ours, theirs = (render_still(s, rig, "view-1", 2, synthetic.tiny) for s in (stage, turned))
    assert (ours == theirs).all()


def test_a_body_with_degenerate_faces_is_drawn(synthetic, stage, rig):
    faces = np.concatenate([stage.faces, [[3, 3, 3], [4, 4, 5]]])
    ours, theirs = (
        render_still(s, rig, "view-1", 2, synthetic.tiny)
        for s in (stage, broken(stage, faces=faces))
    )
    assert (ours == theirs).all()


def test_two_renderers_at_once_are_refused(synthetic, stage, rig):
    with (
        open_session(stage, rig.views, synthetic.tiny),
        pytest.raises(InputError, match="a second renderer in this process"),
    ):
        render_still(stage, rig, "view-1", 0, synthetic.tiny)
    assert render_still(stage, rig, "view-1", 0, synthetic.tiny).shape == (54, 96, 3)


def test_after_a_release_the_same_picture_comes_again(synthetic, stage, rig):
    before = render_still(stage, rig, "view-3", 1, synthetic.tiny)
    offscreen.release()
    assert (render_still(stage, rig, "view-3", 1, synthetic.tiny) == before).all()


def test_an_error_in_mid_clip_leaves_neither_clip_nor_poster(synthetic, stage, rig, tmp_path):
    def stop(done: int, total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_clip(stage, rig, synthetic.tiny, tmp_path / "a.mp4", tmp_path / "a.png", stop)
    assert list(tmp_path.iterdir()) == []


def test_a_frames_hash_is_that_of_the_raw_pictures(synthetic, stage, rig, tmp_path):
    settings = dataclasses.replace(synthetic.tiny, tiling="single")
    made = render_clip(stage, rig, settings, tmp_path / "a.mp4", tmp_path / "a.png")
    best = rig.best().name
    digest = hashlib.sha256()
    for frame in range(5):
        digest.update(render_still(stage, rig, best, frame, settings).tobytes())
    assert digest.hexdigest() == made.frames_sha256

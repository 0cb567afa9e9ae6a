"""Camera paths: closed-form places, smoothness, and files that are refused."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest

from renderer.camera_path import follow, orbit, read_path, same_cutaway
from renderer.cameras import single_camera
from renderer.files import InputError
from renderer.framing import look_from
from renderer.render import render_clip, render_path
from renderer.video import probe

BOX = np.array([[1.0, 2.0, 0.0], [3.0, 4.0, 1.8]])
ASPECT = 16 / 9


def nothing(eye: np.ndarray) -> frozenset[str]:
    return frozenset()


def write(folder, keys, **more):
    path = folder / "pose.json"
    path.write_text(json.dumps({"schema_version": 1, "keys": keys, **more}))
    return path


def corners_in_frame(view) -> np.ndarray:
    corners = np.array(np.meshgrid(*BOX.T)).reshape(3, -1).T
    local = (corners - view.matrix[:3, 3]) @ view.matrix[:3, :3]
    up = math.tan(view.yfov / 2)
    return np.abs(local[:, :2] / -local[:, 2:]) <= np.array([up * ASPECT, up])


def test_an_orbit_is_a_level_circle_around_the_box_that_never_loses_it():
    views = orbit(BOX, 10.0, 48, ASPECT, nothing)
    eyes = np.array([view.matrix[:3, 3] for view in views]) - BOX.mean(0)
    angles = np.unwrap(np.arctan2(eyes[:, 1], eyes[:, 0]))
    assert np.ptp(eyes[:, 2]) < 1e-9 and np.ptp(np.linalg.norm(eyes, axis=1)) < 1e-9
    assert np.allclose(np.diff(angles), 2 * math.pi / 48)
    assert all(corners_in_frame(view).all() for view in views)


def test_an_orbit_cuts_away_by_quarters_of_the_room():
    views = orbit(BOX, 0.0, 40, ASPECT, lambda eye: frozenset({f"{eye[0] > 2}{eye[1] > 3}"}))
    runs = list(same_cutaway(views))
    assert [len(run) for run in runs] == [10, 10, 10, 10]
    assert [run[0].hidden for run in runs] == [
        ("TrueTrue",), ("FalseTrue",), ("FalseFalse",), ("TrueFalse",),
    ]  # fmt: skip


def test_a_follower_keeps_direction_and_distance_to_a_body_that_stands():
    view = single_camera(look_from(30.0, 30.0), 0.6).views[0]
    views = follow(np.tile([1.0, 2.0, 0.9], (20, 1)), 30.0, view, 1.0, ASPECT)
    for made in views:
        back = made.matrix[:3, 3] - [1.0, 2.0, 0.9]
        assert np.allclose(back, view.matrix[:3, 2] / math.sin(0.3))
        assert np.array_equal(made.matrix[:3, :3], view.matrix[:3, :3])


def test_a_follower_does_not_shake_with_the_steps_of_a_walk():
    time = np.arange(180) / 30
    walk = np.stack([time, 0 * time, 0.9 + 0.03 * np.sin(4 * math.pi * time)], axis=1)
    view = single_camera(look_from(0.0, 30.0), 0.6).views[0]
    eyes = np.array([v.matrix[:3, 3] for v in follow(walk, 30.0, view, 1.0, ASPECT)])
    assert np.ptp(eyes[75:105, 2]) < 0.003
    assert np.allclose(np.diff(eyes[75:105, 0]), 1 / 30, atol=1e-4)


def test_a_path_passes_its_keys_and_never_overshoots_them(tmp_path):
    places = [[0.0, -3.0, 1.0], [0.0, -3.0, 2.0], [0.0, -3.0, 2.0]]
    keys = [
        {"time": t, "position": place, "target": [0.0, 0.0, 1.0]}
        for t, place in zip([0.0, 1.0, 2.0], places, strict=True)
    ]
    views = read_path(write(tmp_path, keys), np.arange(31) / 10, nothing)
    heights = np.array([view.matrix[2, 3] for view in views])
    assert heights[[0, 10, 20, 30]] == pytest.approx([1.0, 2.0, 2.0, 2.0])
    assert heights.min() >= 1.0 - 1e-9 and heights.max() <= 2.0 + 1e-9


def test_a_path_looks_at_its_target(tmp_path):
    key = {"position": [4.0, -1.0, 3.0], "target": [1.0, 2.0, 0.5]}
    view = read_path(write(tmp_path, [key], fov_deg=40), np.zeros(1), nothing)[0]
    local = np.linalg.inv(view.matrix) @ [1.0, 2.0, 0.5, 1.0]
    assert np.allclose(local[:2], 0.0, atol=1e-9) and local[2] < 0
    assert view.yfov == pytest.approx(math.radians(40))


@pytest.mark.parametrize(
    ("keys", "more", "field"),
    [
        ([], {}, "keys"),
        ([{"position": [0, 0, 1], "target": [0, 0, 1]}], {}, "target"),
        ([{"position": [0, 0], "target": [0, 0, 1]}], {}, "keys[0].position"),
        ([{"position": [0, 0, 1], "target": [0, 0, float("nan")]}], {}, "keys[0].target"),
        ([{"position": [0, 0, 1], "target": [1, 0, 1], "roll": 3}], {}, "keys[0]"),
        ([{"position": [0, 0, 1], "target": [1, 0, 1], "time": "1"}], {}, "keys[0].time"),
        (2 * [{"time": 1, "position": [0, 0, 1], "target": [1, 0, 1]}], {}, "keys[1].time"),
        ([{"position": [0, 0, 1], "target": [1, 0, 1]}], {"fov_deg": 170}, "fov_deg"),
        ([{"position": [0, 0, 1], "target": [1, 0, 1]}], {"lens": 35}, "lens"),
        ([{"position": [0, 0, 1], "target": [1, 0, 1]}], {"schema_version": 9}, "schema_version"),
    ],
)
def test_a_camera_file_that_cannot_be_flown_is_refused_by_name(tmp_path, keys, more, field):
    with pytest.raises(InputError) as refusal:
        read_path(write(tmp_path, keys, **more), np.zeros(2), nothing)
    assert refusal.value.field == field


def test_a_standing_camera_draws_what_the_fixed_view_draws(synthetic, stage, rig, tmp_path):
    best, settings = rig.best(), synthetic.tiny
    frames = np.arange(len(stage.vertices))
    moving = render_path(
        stage, (best,) * len(frames), frames, settings, tmp_path / "m.mp4", tmp_path / "m.png"
    )
    single = dataclasses.replace(settings, tiling="single")
    fixed = render_clip(stage, rig, single, tmp_path / "f.mp4", tmp_path / "f.png")
    assert moving.frames_sha256 == fixed.frames_sha256
    assert probe(tmp_path / "m.mp4").n_frames == len(frames)


def test_a_path_through_several_cutaways_draws_every_frame_once(synthetic, stage, rig, tmp_path):
    views = (*rig.views, *rig.views)
    frames, seen = np.zeros(8, dtype=np.int64), []
    made = render_path(
        stage, views, frames, synthetic.tiny, tmp_path / "m.mp4", tmp_path / "m.png",
        lambda done, total: seen.append((done, total)),
    )  # fmt: skip
    assert made.n_frames == 8 and (made.width, made.height) == (96, 54)
    assert seen == [(k, 8) for k in range(1, 9)]

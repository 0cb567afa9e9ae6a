"""Windows: cutting, augmentation, and the frames in which something carries the body."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from experiments.motion.figure import figure_of
from experiments.motion.library import load_motion
from experiments.motion.resample import mirror
from experiments.synthesis.training_clips import ClipMotion
from experiments.synthesis.windows import (
    LENGTH,
    WARP,
    Window,
    cut_windows,
    markers,
    pose_window,
)


def _clip(name: str) -> ClipMotion:
    motion = load_motion(name)
    return ClipMotion(motion, np.ones(motion.n_frames, dtype=bool))


def test_windows_start_at_the_origin_every_stride() -> None:
    windows = list(cut_windows(_clip("walk_straight"), 10, 3, np.random.default_rng(0)))
    starts = np.round([30 * window.start_s for window in windows])
    assert np.array_equal(starts, 3 + 10 * np.arange(len(windows)))
    for window in windows:
        assert window.pose.shape == (LENGTH, 22, 3)
        assert window.transl[0, :2] == pytest.approx(0.0)


def test_the_pace_changes_by_fifteen_percent_at_most_and_both_ways() -> None:
    clip = _clip("walk_straight")
    path = np.concatenate(
        [[0], np.linalg.norm(np.diff(clip.motion.transl, axis=0), axis=1).cumsum()]
    )
    ways = []
    for window in cut_windows(clip, 2, 0, np.random.default_rng(1)):
        way = np.linalg.norm(np.diff(window.transl, axis=0), axis=1).sum()
        start = window.start_s
        at = np.interp(
            start + np.array([1 - WARP, 1 + WARP]) * (LENGTH - 1) / 30, clip.motion.times, path
        )
        before = np.interp(start, clip.motion.times, path)
        assert at[0] - before - 0.02 <= way <= at[1] - before + 0.02
        usual = np.interp(start + (LENGTH - 1) / 30, clip.motion.times, path) - before
        ways.append(way - usual)
    assert min(ways) < -0.01 and max(ways) > 0.01


def test_some_windows_are_mirrored_exactly() -> None:
    clip = _clip("walk_turn_right")
    turned = ClipMotion(mirror(clip.motion), clip.on_floor)
    pairs = zip(
        cut_windows(clip, 8, 0, np.random.default_rng(2)),
        cut_windows(turned, 8, 0, np.random.default_rng(2)),
        strict=True,
    )
    for one, two in pairs:
        assert np.allclose(two.transl, one.transl * [-1, 1, 1], atol=1e-9)


def test_no_window_contains_a_frame_off_the_floor() -> None:
    clip = _clip("walk_straight")
    off = 75
    on_floor = np.arange(clip.motion.n_frames) != off
    found = list(cut_windows(ClipMotion(clip.motion, on_floor), 1, 0, np.random.default_rng(3)))
    shortest = (1 - WARP) * (LENGTH - 1) / 30
    assert found
    for window in found:
        assert window.start_s > off / 30 or window.start_s + shortest <= off / 30


def test_a_seated_window_finds_its_seat_and_a_walk_finds_none() -> None:
    figure = figure_of("male_slim")
    marked = markers(figure.body)
    sit, walk = load_motion("sit_stay_stand"), load_motion("walk_straight")
    seated = Window(sit.pose[80:142], sit.transl[80:142], 0.0)
    posed = pose_window(seated, "seat", figure, marked)
    assert posed.support == "seat"
    assert posed.points[posed.frame, posed.rows, 2].mean() == pytest.approx(0.45, abs=0.06)
    moving = Window(walk.pose[40:102], walk.transl[40:102], 0.0)
    assert pose_window(moving, "seat", figure, marked).frame == -1


def test_a_reaching_window_finds_the_hand_that_reaches() -> None:
    figure = figure_of("male_slim")
    marked = markers(figure.body)
    reach = load_motion("reach_forward")
    start = 50
    posed = pose_window(
        Window(reach.pose[start : start + 62], reach.transl[start : start + 62], 0.0),
        "hands",
        figure,
        marked,
    )
    assert posed.support == "hands"
    assert np.array_equal(posed.rows, marked.palms[1])
    palm = posed.points[posed.frame, posed.rows].mean(axis=0)
    assert palm[2] == pytest.approx(1.40, abs=0.12)


def test_markers_are_where_the_body_model_puts_them() -> None:
    figure = figure_of("female_slim")
    walk = load_motion("walk_straight", "female_slim")
    window = Window(walk.pose[:62], walk.transl[:62], 0.0)
    marked = markers(figure.body)
    posed = pose_window(window, "none", figure, marked)
    whole = figure.body.posed(
        torch.from_numpy(window.pose[5:6]).float(), torch.from_numpy(window.transl[5:6]).float()
    )
    assert np.allclose(posed.points[5], whole.vertices[0, marked.ids].numpy(), atol=1e-5)

"""Seams, joins and walks from standing to standing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from experiments.motion.checks import largest_joint_step, peak_root_acceleration
from experiments.motion.compose import best_seam, heading, join, rotate
from experiments.motion.figure import Figure
from experiments.motion.gait import MIRRORED_WALK, TURN_LEFT, TURN_RIGHT, WALK, gait
from experiments.motion.motion import Motion
from experiments.motion.resample import window


@pytest.fixture(scope="module")
def steps(figure: Figure) -> Motion:
    return gait(figure, WALK * 3)


def test_a_motion_cut_in_two_is_joined_where_it_was_cut(steps: Motion, figure: Figure) -> None:
    first, second = window(steps, 0, 41), window(steps, 40, steps.n_frames)
    assert best_seam(first, second, figure, 5) == (40, 0)
    joined = join(first, second, figure, search=5)
    np.testing.assert_allclose(joined.pose, steps.pose, atol=1e-6)
    np.testing.assert_allclose(joined.transl[:, 2], steps.transl[:, 2], atol=0.01)


def test_the_second_clip_goes_on_where_and_how_the_first_one_faces(
    steps: Motion, figure: Figure
) -> None:
    turned = rotate(steps, np.full(steps.n_frames, 1.1))
    moved = dataclasses.replace(turned, transl=turned.transl + np.array([5.0, -3.0, 0.0]))
    joined = join(window(steps, 0, 45), window(moved, 38, steps.n_frames), figure)
    assert np.abs(np.diff(joined.transl, axis=0)).max() < 0.06
    assert np.abs(np.diff(heading(joined))).max() < 0.1
    assert largest_joint_step(joined) < 16.0


def test_turning_a_motion_turns_its_heading(steps: Motion) -> None:
    turned = rotate(steps, np.linspace(0.0, 1.0, steps.n_frames))
    difference = heading(turned) - heading(steps)
    np.testing.assert_allclose(difference, np.linspace(0.0, 1.0, steps.n_frames), atol=1e-9)


@pytest.mark.parametrize(
    ("clips", "degrees"),
    [((*WALK, TURN_RIGHT, *WALK), -90.0), ((*MIRRORED_WALK, TURN_LEFT, *MIRRORED_WALK), 90.0)],
)
def test_a_turn_turns_the_walk_a_quarter_round(
    figure: Figure, clips: tuple[str, ...], degrees: float
) -> None:
    walked = gait(figure, clips)
    yaw = np.degrees(heading(walked))
    assert yaw[-10:].mean() - yaw[:10].mean() == pytest.approx(degrees, abs=15.0)
    assert peak_root_acceleration(walked, figure) < 8.0

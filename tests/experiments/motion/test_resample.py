"""Filters along time, windows, mirroring."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from experiments.body.model import JOINT_NAMES
from experiments.motion.capture import INDEX
from experiments.motion.figure import Figure
from experiments.motion.motion import Motion
from experiments.motion.resample import low_pass, mirror, resample, window
from experiments.motion.rotations import joint_positions, world_rotations


def swinging(hertz: float, fps: float = 120.0, seconds: float = 4.0) -> Motion:
    times = np.arange(round(seconds * fps)) / fps
    pose = np.zeros((len(times), 22, 3))
    pose[:, 0, 0] = np.pi / 2
    pose[:, 4, 0] = 0.3 * np.sin(2 * np.pi * hertz * times)
    transl = np.stack([np.sin(2 * np.pi * hertz * times), times, 0 * times], axis=1)
    return Motion(pose, transl, times, fps, "swing", "swing", "test")


@pytest.mark.parametrize(("hertz", "low", "high"), [(1.0, 0.999, 1.001), (12.0, 0.0, 0.01)])
def test_the_low_pass_keeps_movement_and_removes_tremble(
    hertz: float, low: float, high: float
) -> None:
    before, after = swinging(hertz), low_pass(swinging(hertz))
    middle = slice(120, -120)
    for name in ("pose", "transl"):
        column = (middle, 4, 0) if name == "pose" else (middle, 0)
        ratio = np.ptp(getattr(after, name)[column]) / np.ptp(getattr(before, name)[column])
        assert low <= ratio <= high


def test_resampling_gives_uniform_frames_on_the_same_path() -> None:
    motion = resample(swinging(0.5))
    np.testing.assert_allclose(np.diff(motion.times), 1 / 30)
    np.testing.assert_allclose(motion.pose[:, 4, 0], 0.3 * np.sin(np.pi * motion.times), atol=1e-9)


def test_resampling_takes_uneven_time_stamps() -> None:
    motion = swinging(0.25)
    uneven = dataclasses.replace(
        window(motion, 0, 301), times=np.concatenate([motion.times[:300], [4.0]])
    )
    np.testing.assert_allclose(resample(uneven).transl[:, 1][:70], np.arange(70) / 30, atol=1e-9)


def test_mirroring_twice_changes_nothing_and_once_mirrors_the_joints(figure: Figure) -> None:
    rng = np.random.default_rng(3)
    pose, transl = rng.uniform(-0.6, 0.6, (2, 22, 3)), rng.normal(size=(2, 3))
    motion = Motion(pose, transl, np.array([0.0, 0.1]), 10.0, "m", "m", "test")
    twice = mirror(mirror(motion))
    np.testing.assert_array_equal(twice.pose, motion.pose)
    symmetric = figure.rest_joints.copy()
    for name in JOINT_NAMES:
        other = INDEX[name.replace("left", "right")]
        symmetric[other] = (
            symmetric[INDEX[name]] * [-1, 1, 1] if "left" in name else symmetric[other]
        )
    symmetric[[i for i, n in enumerate(JOINT_NAMES) if "_" not in n], 0] = 0.0
    ours, theirs = (
        joint_positions(world_rotations(m.pose), m.transl, symmetric)
        for m in (motion, mirror(motion))
    )
    order = [
        INDEX[n.replace("left", "right") if "left" in n else n.replace("right", "left")]
        for n in JOINT_NAMES
    ]
    np.testing.assert_allclose(theirs[:, order] * [-1, 1, 1], ours, atol=1e-9)

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.methods.preparation import at_frames, unwrapped
from experiments.placement.spread import spread_alteration

KEPT = np.array([0, 3, 4, 9, 16])


def alteration(size: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    return size * rng.normal(size=(5, 22, 3)), size * rng.normal(size=(5, 3))


def test_kept_frames_get_exactly_their_alteration(walk) -> None:
    motion = walk(1.0, 17, fps=120.0)
    delta, shift = alteration()
    spread = spread_alteration(motion, at_frames(motion, KEPT), delta, shift)
    wanted = Rotation.from_rotvec((motion.pose[KEPT] + delta).reshape(-1, 3))
    found = Rotation.from_rotvec(spread.pose[KEPT].reshape(-1, 3))
    assert (wanted.inv() * found).magnitude().max() < 1e-9
    assert spread.transl[KEPT] == pytest.approx(motion.transl[KEPT] + shift)


def test_no_alteration_leaves_the_whole_motion_as_it_is(walk) -> None:
    motion = walk(1.0, 17, fps=120.0)
    spread = spread_alteration(motion, at_frames(motion, KEPT), *alteration(0.0))
    assert spread.pose == pytest.approx(motion.pose, abs=1e-12)
    assert np.array_equal(spread.transl, motion.transl)


def test_between_kept_frames_a_rotation_runs_at_constant_speed(walk) -> None:
    motion = walk(1.0, 17, fps=120.0)
    delta, shift = np.zeros((5, 22, 3)), np.zeros((5, 3))
    # The knee's original axis is kept, so its alteration is a turn about it.
    delta[4, 4], shift[4] = [0.7, 0.0, 0.0], [0.0, 0.0, 0.7]
    spread = spread_alteration(motion, at_frames(motion, KEPT), delta, shift)
    share = np.clip((np.arange(17) - 9) / 7, 0, 1)
    assert spread.pose[:, 4, 0] - motion.pose[:, 4, 0] == pytest.approx(0.7 * share, abs=1e-9)
    assert spread.transl[:, 2] - motion.transl[:, 2] == pytest.approx(0.7 * share)


def test_unwrapped_poses_turn_the_same_and_never_jump() -> None:
    # A turn about a fixed axis through half a turn and on: its axis-angle vector flips on the way.
    angle = np.linspace(0.1, 6.0, 90)
    pose = np.zeros((90, 22, 3))
    pose[:, 0] = Rotation.from_rotvec(angle[:, None] * np.array([0.6, 0.0, 0.8])).as_rotvec()
    smooth = unwrapped(pose)
    assert np.linalg.norm(np.diff(pose[:, 0], axis=0), axis=-1).max() > 3.0
    assert np.linalg.norm(np.diff(smooth[:, 0], axis=0), axis=-1).max() < 0.08
    before, after = Rotation.from_rotvec(pose[:, 0]), Rotation.from_rotvec(smooth[:, 0])
    assert (before.inv() * after).magnitude().max() < 1e-9

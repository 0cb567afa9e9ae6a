"""Ground, foot-driven root, foot lock and its inverse kinematics."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.motion.checks import check_motion, foot_skate, largest_joint_step
from experiments.motion.cleanup import clean_blend, clean_recording
from experiments.motion.deepmimic import pybullet_clip, read_deepmimic
from experiments.motion.figure import Figure, surface
from experiments.motion.foot_lock import contact_spans, lock_feet, minimum_jerk
from experiments.motion.ground import ground, lowest_height, rest_on_floor
from experiments.motion.motion import Motion
from experiments.motion.perform import perform
from experiments.motion.resample import low_pass, resample
from experiments.motion.retarget import retarget
from experiments.motion.root import drive_root
from experiments.motion.rotations import to_matrix
from experiments.motion.score import Score
from experiments.motion.two_bone import middle_joint, move_end


@pytest.fixture(scope="module")
def standing(figure: Figure) -> Motion:
    score = Score(figure)
    score.wait(1.5)
    return perform(score, "stand", seed=0, life=0.0)


@pytest.fixture(scope="module")
def walk(figure: Figure) -> Motion:
    return resample(low_pass(retarget(read_deepmimic(pybullet_clip("humanoid3d_walk")), figure)))


def slid(motion: Motion, *velocity: float) -> Motion:
    """Everything carried along at a constant velocity (m/s)."""
    return dataclasses.replace(
        motion, transl=motion.transl + np.outer(motion.times, np.array(velocity))
    )


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6))
def test_two_bones_keep_their_lengths_and_reach_what_they_can(seed: int) -> None:
    start, target, pole = np.random.default_rng(seed).normal(size=(3, 9, 3))
    middle, end = middle_joint(start, target, pole, (0.6, 0.7))
    np.testing.assert_allclose(np.linalg.norm(middle - start, axis=1), 0.6, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(end - middle, axis=1), 0.7, atol=1e-9)
    gap = np.linalg.norm(target - start, axis=1)
    reachable = (gap > 0.11) & (gap < 1.29)
    np.testing.assert_allclose(end[reachable], target[reachable], atol=1e-9)


def test_moving_the_end_keeps_the_plane_of_the_bend() -> None:
    hip, knee, foot = (np.array([p]) for p in ([0.0, 0, 1], [0.1, 0, 0.5], [0.0, 0, 0]))
    target = np.array([[0.2, 0.0, 0.15]])
    thigh, shank = move_end(hip, knee, foot, target)
    new_knee = hip + (thigh @ (knee - hip)[..., None])[..., 0]
    np.testing.assert_allclose(new_knee + (shank @ (foot - knee)[..., None])[..., 0], target)
    np.testing.assert_allclose(new_knee[0, 1], 0.0, atol=1e-12)


def test_soft_elbows_never_quite_straighten() -> None:
    start, pole = np.zeros((200, 3)), np.tile([0.0, 1.0, 0.0], (200, 1))
    target = np.linspace(0.3, 0.8, 200)[:, None] * np.array([1.0, 0.0, 0.0])
    _, end = middle_joint(start, target, pole, (0.3, 0.3), soft_m=0.03)
    assert np.all(np.diff(end[:, 0]) > 0)
    assert end[-1, 0] < 0.6


def test_a_sunken_person_is_raised_onto_the_floor(standing: Motion, figure: Figure) -> None:
    sunk = slid(standing, 0.0, 0.0, -0.02)
    lowest = lowest_height(ground(sunk, figure), figure, np.concatenate(figure.soles))
    np.testing.assert_allclose(lowest[5:-5], 0.0, atol=1e-3)


def test_a_lying_person_is_never_left_below_the_floor(standing: Motion, figure: Figure) -> None:
    lying = standing.pose.copy()
    lying[:, 0] = 0.0
    raised = rest_on_floor(dataclasses.replace(standing, pose=lying), figure)
    assert abs(lowest_height(raised, figure, figure.body.body_component).min()) < 0.006


def test_a_stationary_foot_drives_the_root_back_to_rest(standing: Motion, figure: Figure) -> None:
    driven = drive_root(slid(standing, 0.3, 0.1, 0.0), figure)
    np.testing.assert_allclose(driven.transl, np.tile(standing.transl[:1], (46, 1)), atol=1e-4)


def test_locked_feet_stay_while_the_body_drifts(standing: Motion, figure: Figure) -> None:
    locked = lock_feet(slid(standing, 0.06, 0.0, 0.0), figure)
    for side in range(2):
        points = surface(figure, locked, figure.soles[side])
        assert foot_skate(points, locked.fps) < 1e-3
        np.testing.assert_allclose(points[..., 2].min(axis=1), 0.0, atol=1e-4)
    assert np.ptp(locked.transl[:, 0]) > 0.08


def test_the_lock_keeps_the_world_rotation_of_the_feet(walk: Motion, figure: Figure) -> None:
    from experiments.motion.rotations import world_rotations

    before = ground(walk, figure)
    after = lock_feet(before, figure)
    feet = [7, 8]
    np.testing.assert_allclose(
        world_rotations(after.pose)[:, feet], world_rotations(before.pose)[:, feet], atol=1e-9
    )


def test_clean_up_of_a_recorded_walk_meets_the_limits(walk: Motion, figure: Figure) -> None:
    raw = check_motion(walk, figure)
    for cleaned in (clean_recording(walk, figure), clean_blend(walk, figure)):
        checks = check_motion(cleaned, figure)
        assert checks.foot_skate_cm_s < 0.4 * raw.foot_skate_cm_s
        assert checks.sole_penetration_mm < 0.01
        assert checks.lowest_other_cm > -0.5


def test_contact_needs_low_and_slow() -> None:
    points = np.zeros((40, 3, 3))
    points[10:30, :, 2] = 0.2
    points[30:, :, 0] = np.arange(10)[:, None]
    assert contact_spans(points, 30.0, 0.35) == [(0, 9)]


def test_the_minimum_jerk_ramp_starts_and_ends_at_rest() -> None:
    ramp = minimum_jerk(np.linspace(-0.2, 1.2, 1401))
    assert ramp[0] == 0.0 and ramp[-1] == 1.0
    assert minimum_jerk(np.array([0.5]))[0] == pytest.approx(0.5)
    assert np.abs(np.diff(ramp, n=2)).max() < 6e-6


def test_the_joint_step_is_the_turn_between_frames() -> None:
    pose = np.zeros((3, 22, 3))
    pose[:, 5, 1] = np.radians([0.0, 5.0, 12.0])
    motion = Motion(pose, np.zeros((3, 3)), np.arange(3) / 30, 30.0, "m", "m", "test")
    assert largest_joint_step(motion) == pytest.approx(7.0)
    assert to_matrix(pose).shape == (3, 22, 3, 3)


def test_skate_is_the_speed_of_points_at_the_floor() -> None:
    points = np.zeros((5, 2, 3))
    points[:, :, 0] = np.arange(5)[:, None] * 0.01
    points[:, 1, 2] = 0.5
    assert foot_skate(points, 30.0) == pytest.approx(0.3)

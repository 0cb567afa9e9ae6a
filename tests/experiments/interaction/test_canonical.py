"""The canonical frame: position and yaw are gone, whatever the posture."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from experiments.body.embedded import load_body
from experiments.body.model import JOINT_NAMES
from experiments.interaction.canonical import body_yaw, canonical_frames, height_above_floor

UP = np.array([0.0, 0.0, 1.0])
AT = {name: index for index, name in enumerate(JOINT_NAMES)}


def standing_joints() -> np.ndarray:
    """The zero pose stood upright: y up becomes z up, so it faces -y."""
    rest = load_body().rest_joints
    return np.stack([rest[:, 0], -rest[:, 2], rest[:, 1]], axis=1)[None]


def turned(points: np.ndarray, axis: str, degrees: float) -> np.ndarray:
    return points @ Rotation.from_euler(axis, degrees, degrees=True).as_matrix().T


@given(degrees=st.floats(-179, 179), lean=st.floats(-80, 80), shift=st.floats(-9, 9))
@settings(deadline=None, max_examples=40)
def test_turning_and_moving_a_body_changes_nothing(
    degrees: float, lean: float, shift: float
) -> None:
    joints = turned(standing_joints(), "x", lean)
    moved = turned(joints, "z", degrees) + np.array([shift, -shift, 0.3])
    assert canonical_frames(moved, moved) == pytest.approx(
        canonical_frames(joints, joints), abs=1e-9
    )


@given(degrees=st.floats(-179, 179))
@settings(deadline=None, max_examples=20)
def test_the_yaw_of_a_standing_body_is_the_angle_it_was_turned_by(degrees: float) -> None:
    # The trunk leans a little in the zero pose, which must not tell.
    assert np.degrees(body_yaw(turned(standing_joints(), "z", degrees)))[0] == pytest.approx(
        degrees, abs=1e-6
    )


@pytest.mark.parametrize(
    ("axis", "degrees"), [("x", -90.0), ("x", 90.0), ("y", 90.0), ("y", -90.0)]
)
def test_lying_bodies_have_a_yaw_too(axis: str, degrees: float) -> None:
    lying = turned(standing_joints(), axis, degrees)
    both = np.concatenate([turned(lying, "z", angle) for angle in (0.0, 1.0)])
    gained = np.degrees(np.diff(body_yaw(both)))[0]
    assert gained == pytest.approx(1.0, abs=1e-6)


def test_the_yaw_is_continuous_from_back_over_side_to_belly() -> None:
    back = turned(standing_joints(), "x", 90.0)
    rolling = np.concatenate([turned(back, "y", angle) for angle in np.arange(0.0, 181.0)])
    steps = np.degrees(np.abs(np.diff(np.unwrap(body_yaw(rolling)))))
    assert steps.max() < 3.0


def test_the_pelvis_is_the_origin_and_the_body_faces_minus_y() -> None:
    joints = turned(standing_joints(), "z", 123.0) + 4.0
    frame = canonical_frames(joints, joints)[0]
    assert frame[0] == pytest.approx(np.zeros(3), abs=1e-12)
    assert frame[AT["left_hip"], 0] > 0 > frame[AT["right_hip"], 0]
    assert frame[AT["left_foot"], 1] < frame[AT["left_ankle"], 1]


def test_a_lifted_foot_keeps_its_height_above_the_ground_it_left() -> None:
    times = np.arange(20) / 30
    height = np.where(np.arange(20) < 10, 0.02, 0.12)
    vertices = np.stack([UP * z for z in height])[:, None] + np.array([[[0, 0, 0], [0, 0, 1.0]]])
    above = height_above_floor(vertices, times)
    assert above[10:, 0] == pytest.approx(np.full(10, 0.10), abs=1e-12)
    assert above[:10, 1] == pytest.approx(np.ones(10))


def test_after_the_window_the_new_ground_counts() -> None:
    times = np.arange(60) / 30
    vertices = np.where(np.arange(60) < 10, 0.0, 0.5)[:, None, None] * UP
    assert height_above_floor(vertices, times)[26:, 0] == pytest.approx(np.zeros(34))

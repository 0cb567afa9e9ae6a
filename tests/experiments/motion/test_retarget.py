"""Rotation transfer onto the body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.motion.amc import read_amc
from experiments.motion.capture import INDEX, Capture
from experiments.motion.deepmimic import pybullet_clip, read_deepmimic
from experiments.motion.figure import Figure
from experiments.motion.retarget import retarget, standing_pose
from experiments.motion.rotations import UPRIGHT, joint_positions, unit, world_rotations


def resting(leg_length: float, **directions: tuple[float, float, float]) -> Capture:
    return Capture(
        rotations=np.tile(UPRIGHT, (3, 22, 1, 1)),
        hip_centre=np.array([[0.0, 0.0, 1.0], [0.0, -0.5, 1.0], [0.0, -1.0, 1.0]]),
        times=np.array([0.0, 0.1, 0.2]),
        rest_directions={name: np.array(value, dtype=float) for name, value in directions.items()},
        leg_length=leg_length,
        label="rest",
        source="test",
    )


def test_a_recording_that_rests_in_the_t_pose_gives_the_standing_t_pose(figure: Figure) -> None:
    motion = retarget(resting(0.5), figure)
    np.testing.assert_allclose(motion.pose[1], standing_pose(), atol=1e-12)


def test_limbs_take_the_recordings_rest_directions(figure: Figure) -> None:
    wanted = {"left_shoulder": (0.0, -1.0, 0.0), "right_hip": (-0.34202, -0.939693, 0.0)}
    motion = retarget(resting(0.8, **wanted), figure)
    joints = joint_positions(world_rotations(motion.pose), motion.transl, figure.rest_joints)[0]
    arm = unit(joints[INDEX["left_elbow"]] - joints[INDEX["left_shoulder"]])
    thigh = unit(joints[INDEX["right_knee"]] - joints[INDEX["right_hip"]])
    np.testing.assert_allclose(arm, [0.0, 0.0, -1.0], atol=1e-9)
    np.testing.assert_allclose(thigh, UPRIGHT @ wanted["right_hip"], atol=1e-6)


def test_the_hip_centre_travels_in_the_ratio_of_the_legs(figure: Figure) -> None:
    motion = retarget(resting(sum(figure.leg) / 2), figure)
    joints = joint_positions(world_rotations(motion.pose), motion.transl, figure.rest_joints)
    hips = joints[:, [INDEX["left_hip"], INDEX["right_hip"]]].mean(axis=1)
    np.testing.assert_allclose(hips[2], [0.0, -2.0, 2.0], atol=1e-9)


def test_the_recorded_walk_travels_the_way_it_faces(figure: Figure) -> None:
    motion = retarget(read_deepmimic(pybullet_clip("humanoid3d_walk")), figure)
    travel = motion.transl[-1] - motion.transl[0]
    forward = world_rotations(motion.pose)[:, 0, :, 2].mean(axis=0)
    assert 1.0 < np.linalg.norm(travel) < 1.6
    assert unit(travel) @ unit(forward) > 0.97


@pytest.mark.shared
@pytest.mark.parametrize("name", ["02_01", "02_06", "01_08", "03_03"])
def test_cmu_legs_and_arms_point_as_in_the_recording(
    shared_data: Path, figure: Figure, name: str
) -> None:
    capture = read_amc(shared_data / "cmu" / name[:2] / f"{name}.amc")
    motion = retarget(capture, figure)
    joints = joint_positions(world_rotations(motion.pose), motion.transl, figure.rest_joints)
    for start, end in (("left_hip", "left_knee"), ("right_elbow", "right_wrist")):
        ours = unit(joints[:, INDEX[end]] - joints[:, INDEX[start]])
        bone = np.asarray(capture.rest_directions[start])
        theirs = (capture.rotations[:, INDEX[start]] @ bone[:, None])[..., 0]
        assert np.sum(ours * theirs, axis=1).min() > 1 - 1e-9

from __future__ import annotations

import numpy as np
import pytest
import torch

from experiments.interaction.geometric import geometric_features
from experiments.placement.bones import bone_points
from experiments.placement.candidates import Starts, bone_clearance, find_starts
from experiments.placement.problem import build_problem
from experiments.placement.settings import PlacementSettings
from experiments.scene.synthetic import synthetic_room

CHAIR = {
    "seat": ((1.2, 1.5, 0.0), (1.8, 2.0, 0.45), "chair"),
    "backrest": ((1.2, 2.0, 0.0), (1.8, 2.02, 1.0), "chair"),
}


@pytest.fixture(scope="module")
def chair_problem(sit, slim):
    room = synthetic_room(CHAIR, cell=0.025, scene_id="chair")
    motion = sit(45, stand=0.2)
    features = geometric_features(motion, slim, room.class_names())[0]
    return build_problem(motion, room, slim, PlacementSettings(n_starts=10), features)


def test_bone_points_lie_between_their_joints(slim) -> None:
    zero = torch.zeros((1, 22, 3), dtype=torch.float64)
    joints = slim.joint_transforms(zero, zero[:, 0])[1]
    points = bone_points(joints)[0]
    assert points.shape == (4 * 17, 3)
    assert (points >= joints[0].amin(0) - 1e-9).all() and (points <= joints[0].amax(0) + 1e-9).all()


def test_a_sitter_faces_away_from_the_back_of_the_chair(chair_problem) -> None:
    starts = find_starts(chair_problem)
    # At yaw 0 a body faces -y; the backrest stands at the chair's +y side.
    assert np.cos(starts.yaw[0]) > 0.8
    assert (bone_clearance(chair_problem, starts) >= 0.015).all()


def test_a_body_through_a_thin_board_has_no_clearance(chair_problem) -> None:
    starts = find_starts(chair_problem)
    through = Starts(starts.yaw[:1] + np.pi, starts.translation[:1], starts.score[:1])
    middle = chair_problem.vertices[-1].mean(0).double().numpy()
    # Turned about, its seat back over the seat: the thighs now cross the board.
    centre = chair_problem.centre.double().numpy()
    offset = middle[:2] - centre
    through.translation[0, :2] += 2 * offset * np.cos(starts.yaw[0])
    assert bone_clearance(chair_problem, through)[0] < 0.01

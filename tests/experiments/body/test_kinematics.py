from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from experiments.body.kinematics import forward_kinematics, rotation_matrices
from experiments.body.model import JOINT_NAMES

component = st.floats(-7, 7, allow_subnormal=False)


@settings(deadline=None)
@given(st.tuples(component, component, component), st.sampled_from([1.0, 1e-3, 1e-5, 1e-9, 0.0]))
def test_a_rotation_equals_scipys(vector: tuple[float, ...], scale: float) -> None:
    vectors = np.array(vector) * scale
    ours = rotation_matrices(torch.as_tensor(vectors)).numpy()
    np.testing.assert_allclose(ours, Rotation.from_rotvec(vectors).as_matrix(), atol=1e-14)


@pytest.mark.parametrize("length", [0.0, 1e-6, 0.9e-4, 1.1e-4, 1.0, np.pi])
def test_rotations_have_right_first_and_second_derivatives(length: float) -> None:
    direction = torch.tensor([0.6, -0.48, 0.64], dtype=torch.float64)
    vectors = (length * direction)[None].requires_grad_()
    assert torch.autograd.gradcheck(rotation_matrices, (vectors,))
    assert torch.autograd.gradgradcheck(rotation_matrices, (vectors,))


def test_the_gradient_at_the_zero_rotation_is_the_cross_product() -> None:
    vector = torch.zeros(3, requires_grad=True)
    (rotation_matrices(vector) @ torch.tensor([1.0, 2.0, 3.0]))[1].backward()
    torch.testing.assert_close(vector.grad, torch.tensor([-3.0, 0.0, 1.0]))


def test_single_precision_rotations_stay_orthogonal() -> None:
    scales = torch.logspace(-8, 1, 200)[:, None]
    rotations = rotation_matrices(scales * torch.tensor([0.36, 0.48, 0.8]))
    products = rotations @ rotations.transpose(-1, -2)
    torch.testing.assert_close(products, torch.eye(3).expand(200, 3, 3), atol=2e-6, rtol=0)


def test_bending_an_elbow_moves_the_wrist_on_a_circle_and_nothing_else() -> None:
    rest = torch.arange(66, dtype=torch.float64).reshape(22, 3).sin()
    elbow, wrist = JOINT_NAMES.index("left_elbow"), JOINT_NAMES.index("left_wrist")
    pose = torch.zeros(1, 22, 3, dtype=torch.float64)
    pose[0, elbow, 2] = torch.pi / 2
    _, joints = forward_kinematics(pose, torch.zeros(1, 3, dtype=torch.float64), rest)
    x, y, z = rest[wrist] - rest[elbow]
    expected = rest.clone()
    expected[wrist] = rest[elbow] + torch.stack([-y, x, z])
    torch.testing.assert_close(joints[0], expected)

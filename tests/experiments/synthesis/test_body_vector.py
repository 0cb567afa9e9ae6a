from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from experiments.body.embedded import BODY_NAMES, load_body
from experiments.synthesis.body_vector import (
    DESCRIPTOR_SIZE,
    SIZE,
    Clip,
    body_descriptor,
    rotations_from_6d,
    rotations_to_6d,
    to_motion,
    to_vectors,
)

CLIP = Clip(30.0, "slot", "label", "source")
vectors3 = arrays(np.float64, (4, 3), elements=st.floats(-3, 3, allow_subnormal=False))


@given(vectors3)
@settings(max_examples=60, deadline=None)
def test_six_numbers_are_the_first_two_columns_of_scipys_matrix(axis_angle) -> None:
    matrix = Rotation.from_rotvec(axis_angle).as_matrix()
    found = rotations_to_6d(torch.tensor(axis_angle)).numpy()
    assert found == pytest.approx(np.concatenate([matrix[..., 0], matrix[..., 1]], axis=-1))


@given(vectors3)
@settings(max_examples=60, deadline=None)
def test_a_rotation_survives_its_six_numbers(axis_angle) -> None:
    back = rotations_from_6d(rotations_to_6d(torch.tensor(axis_angle))).numpy()
    between = Rotation.from_rotvec(back) * Rotation.from_rotvec(axis_angle).inv()
    assert between.magnitude().max() < 1e-6


def test_columns_of_any_length_and_angle_give_the_nearest_frame_of_gram_and_schmidt() -> None:
    skewed = torch.tensor([[2.0, 0.0, 0.0, 5.0, 3.0, 0.0]], dtype=torch.float64)
    assert rotations_from_6d(skewed).numpy() == pytest.approx(np.zeros((1, 3)), abs=1e-12)


def test_gradients_of_the_rotations_are_right() -> None:
    columns = torch.tensor(np.random.default_rng(1).normal(size=(3, 6)), requires_grad=True)
    assert torch.autograd.gradcheck(rotations_from_6d, (columns,))


def test_a_motion_survives_its_vectors(walk) -> None:
    motion = walk(1.0, 20)
    vectors = to_vectors(motion)
    back = to_motion(vectors, CLIP)
    assert vectors.shape == (20, SIZE)
    assert back.transl == pytest.approx(motion.transl, abs=1e-12)
    assert back.pose == pytest.approx(motion.pose, abs=1e-7)
    assert back.times == pytest.approx(motion.times) and back.motion_id == "slot"


def test_the_root_of_a_standing_body_has_its_left_along_x_and_its_head_along_z(walk) -> None:
    root = to_vectors(walk(0.0, 2))[0, 3:9]
    assert root == pytest.approx([1, 0, 0, 0, 0, 1], abs=1e-12)


def test_the_embedded_bodies_have_descriptors_of_their_own() -> None:
    found = np.stack([body_descriptor(load_body(name)) for name in BODY_NAMES])
    distance = np.linalg.norm(found[:, None] - found[None], axis=-1) + 9 * np.eye(4)
    assert found.shape == (4, DESCRIPTOR_SIZE) and distance.min() > 0.5
    assert np.abs(found).max() < 3.0

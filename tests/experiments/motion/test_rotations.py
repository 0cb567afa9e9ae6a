"""Rotations, the joint chain and arcs."""

from __future__ import annotations

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.body.embedded import load_body
from experiments.motion.rotations import (
    about,
    from_quaternion,
    joint_positions,
    local_pose,
    shortest_arc,
    slerp,
    steady_slerp,
    to_matrix,
    to_quaternion,
    world_rotations,
)


def test_the_joint_chain_is_that_of_the_body_model() -> None:
    rng = np.random.default_rng(0)
    pose, transl = rng.normal(size=(5, 22, 3)), rng.normal(size=(5, 3))
    body = load_body("male_slim")
    world = world_rotations(pose)
    rotations, positions = body.joint_transforms(torch.as_tensor(pose), torch.as_tensor(transl))
    np.testing.assert_allclose(world, rotations.numpy(), atol=1e-9)
    ours = joint_positions(world, transl, np.asarray(body.rest_joints, dtype=np.float64))
    np.testing.assert_allclose(ours, positions.numpy(), atol=1e-6)


def test_local_pose_undoes_world_rotations() -> None:
    pose = np.random.default_rng(1).uniform(-1, 1, size=(4, 22, 3))
    np.testing.assert_allclose(local_pose(world_rotations(pose)), pose, atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_the_shortest_arc_turns_one_direction_into_the_other(seed: int) -> None:
    start, end = np.random.default_rng(seed).normal(size=(2, 7, 3))
    turned = (shortest_arc(start, end) @ start[..., None])[..., 0]
    cosine = np.sum(turned * end, axis=1)
    lengths = np.linalg.norm(turned, axis=1) * np.linalg.norm(end, axis=1)
    np.testing.assert_allclose(cosine, lengths, rtol=1e-9)


def test_quaternions_keep_one_hemisphere_through_a_full_turn() -> None:
    angles = np.linspace(0, 2 * np.pi, 50)
    spin = np.outer(angles, [0.0, 0.0, 1.0])
    quaternion = to_quaternion(spin)
    assert np.all(np.sum(quaternion[1:] * quaternion[:-1], axis=1) > 0.99)
    np.testing.assert_allclose(to_matrix(from_quaternion(quaternion)), to_matrix(spin), atol=1e-12)


def test_slerp_at_one_half_is_half_the_angle() -> None:
    middle = slerp(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]), np.array([0.5]))
    np.testing.assert_allclose(middle, [[0.0, 0.5, 0.0]], atol=1e-12)


def test_a_mix_of_moving_rotations_does_not_flip_at_half_a_turn() -> None:
    angles = np.linspace(150, 210, 61)
    mixed = steady_slerp(about("x", np.zeros(61)), about("x", angles), np.full(61, 0.5))
    np.testing.assert_allclose(mixed, about("x", angles / 2), atol=1e-12)

"""The textbook rig: as good as the body model to the millimetre, with plain non-negative weights."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch

from experiments.body.embedded import BODY_FILE, BODY_NAMES, read_body
from experiments.body.rig import MAX_INFLUENCES, Rig, helper_rig
from experiments.body.skinned_body import SkinnedBody

Draw = Callable[[int, int], tuple[torch.Tensor, torch.Tensor]]


@pytest.fixture(scope="module")
def rig(male: SkinnedBody) -> Rig:
    return helper_rig(male.points, male.rest_joints)


def gaps_mm(body: SkinnedBody, rig: Rig, pose: torch.Tensor, transl: torch.Tensor) -> np.ndarray:
    rotations, positions = body.joint_transforms(pose, transl)
    exact = body.posed(pose, transl).vertices.numpy()
    return 1000 * np.linalg.norm(rig.posed(rotations.numpy(), positions.numpy()) - exact, axis=2)


@pytest.mark.parametrize("name", BODY_NAMES)
def test_every_body_stays_within_a_millimetre_in_wild_poses(name: str, random_pose: Draw) -> None:
    body = read_body(BODY_FILE, name)
    rig = helper_rig(body.points, body.rest_joints)
    gaps = gaps_mm(body, rig, *random_pose(5, 4))
    assert np.percentile(gaps, 99) < 0.6
    assert gaps.max() < 5.0


def test_without_helpers_the_same_body_is_centimetres_off(
    male: SkinnedBody, random_pose: Draw
) -> None:
    plain = male.points.copy()
    plain[:, :, :3] = male.weights[:, :, None] * male.rest_vertices[:, None]
    gaps = gaps_mm(male, helper_rig(plain, male.rest_joints), *random_pose(5, 2))
    assert np.percentile(gaps, 99) > 10.0


def test_a_textbook_body_needs_no_helpers_and_loses_nothing(
    male: SkinnedBody, random_pose: Draw
) -> None:
    plain = male.points.copy()
    plain[:, :, :3] = male.weights[:, :, None] * male.rest_vertices[:, None]
    rig = helper_rig(plain, male.rest_joints)
    assert len(rig.names) == 22
    body = SkinnedBody(
        "plain", male.faces, male.body_component, male.subset, male.subset_faces, {},
        male.contact_rows, male.rest_joints, plain,
    )  # fmt: skip
    assert gaps_mm(body, rig, *random_pose(1, 2)).max() < 1e-6


def test_weights_are_a_convex_combination_in_falling_order(rig: Rig) -> None:
    assert rig.weights.shape[1] == MAX_INFLUENCES
    assert rig.weights.min() >= 0
    assert np.allclose(rig.weights.sum(1), 1, atol=1e-12)
    assert np.all(np.diff(rig.weights, axis=1) <= 1e-15)


def test_every_joint_keeps_its_own_weight_whatever_helpers_carry(
    rig: Rig, male: SkinnedBody
) -> None:
    owner = np.array([j if j < 22 else rig.parents[j] for j in range(len(rig.names))])
    carried = np.zeros((len(rig.weights), 22))
    rows = np.arange(len(rig.weights))[:, None]
    np.add.at(carried, (rows, owner[rig.joints]), rig.weights)
    assert np.abs(carried - male.weights).max() < 0.02


def test_helpers_are_rigid_children_of_body_joints(rig: Rig, male: SkinnedBody) -> None:
    helpers = range(22, len(rig.names))
    assert all(0 <= rig.parents[j] < 22 for j in helpers)
    assert all(np.array_equal(rig.binds[j], male.rest_joints[rig.parents[j]]) for j in helpers)
    assert len(set(rig.names)) == len(rig.names)


def test_two_joints_that_want_two_places_both_get_theirs(male: SkinnedBody) -> None:
    """Half pelvis at p, half knee at p + d; the knee turned by R gives (p + R(p + d - h) + h) / 2."""
    place, apart = np.array([0.1, -0.4, 0.05]), np.array([0.03, 0.01, -0.02])
    points = np.zeros((1, 22, 4))
    points[0, 0], points[0, 4] = [*(0.5 * place), 0.5], [*(0.5 * (place + apart)), 0.5]
    rig = helper_rig(points, male.rest_joints)
    rotations = np.tile(np.eye(3), (1, 22, 1, 1))
    rotations[0, 4] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    knee = male.rest_joints[4]
    wanted = 0.5 * place + 0.5 * (rotations[0, 4] @ (place + apart - knee) + knee)
    posed = rig.posed(rotations, male.rest_joints[None].astype(float))
    assert np.allclose(posed[0, 0], wanted, atol=1e-12)

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from experiments.body.embedded import BODY_FILE, BODY_NAMES, read_body
from experiments.body.model import JOINT_NAMES
from experiments.body.reference import skin_slowly
from experiments.body.skinned_body import SkinnedBody

Draw = Callable[[int, int], tuple[torch.Tensor, torch.Tensor]]


@pytest.mark.parametrize("name", BODY_NAMES)
def test_the_fast_product_equals_the_slow_sum_over_joints(name: str, random_pose: Draw) -> None:
    body = read_body(BODY_FILE, name)
    pose, transl = random_pose(1, 2)
    fast = body.posed(pose, transl, body.subset).vertices
    for frame in range(2):
        slow = skin_slowly(
            body.points[body.subset], body.rest_joints, pose[frame].numpy(), transl[frame].numpy()
        )
        np.testing.assert_allclose(fast[frame].numpy(), slow, atol=1e-12)


@settings(deadline=None, max_examples=20)
@given(st.lists(st.integers(0, 13717), max_size=40))
def test_any_list_of_vertices_gives_the_rows_of_the_full_mesh(rows: list[int]) -> None:
    body = read_body(BODY_FILE, "female_heavy")
    pose, transl = torch.linspace(-1, 1, 132).reshape(2, 22, 3), torch.ones(2, 3)
    ids = np.array(rows, dtype=np.int64)
    some, every = body.posed(pose, transl, ids), body.posed(pose, transl)
    torch.testing.assert_close(some.vertices, every.vertices[:, ids], atol=1e-6, rtol=0)


def test_frames_do_not_influence_each_other(male: SkinnedBody, random_pose: Draw) -> None:
    pose, transl = random_pose(2, 5)
    together = male.posed(pose, transl, male.subset).vertices
    alone = [male.posed(pose[t : t + 1], transl[t : t + 1], male.subset).vertices for t in range(5)]
    torch.testing.assert_close(together, torch.cat(alone), atol=1e-13, rtol=0)


@pytest.mark.parametrize("scale", [0.0, 1e-5, 1.0])
def test_gradients_of_vertices_and_joints_are_right(
    male: SkinnedBody, random_pose: Draw, scale: float
) -> None:
    pose, transl = (scale * drawn for drawn in random_pose(3, 2))
    ids = male.subset[::140]

    def outputs(p: torch.Tensor, t: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        mesh = male.posed(p, t, ids)
        return mesh.vertices, mesh.joints

    assert torch.autograd.gradcheck(outputs, (pose.requires_grad_(), transl.requires_grad_()))


def test_single_precision_is_within_three_micrometres_of_double(
    male: SkinnedBody, random_pose: Draw
) -> None:
    pose, transl = random_pose(4, 8)
    single = male.posed(pose.float(), transl.float())
    assert single.vertices.dtype == single.joints.dtype == torch.float32
    double = male.posed(pose.float().double(), transl.float().double())
    assert (single.vertices - double.vertices).abs().max() < 3e-6


def test_the_root_moves_the_body_rigidly_about_the_pelvis_joint(
    male: SkinnedBody, random_pose: Draw
) -> None:
    pose, transl = random_pose(5, 1)
    still = torch.cat([torch.zeros_like(pose[:, :1]), pose[:, 1:]], dim=1)
    moved, fixed = male.posed(pose, transl), male.posed(still, torch.zeros_like(transl))
    rotation = male.joint_transforms(pose, transl)[0][0, 0]
    pelvis = torch.as_tensor(male.rest_joints[0])
    expected = (fixed.vertices[0] - pelvis) @ rotation.T + pelvis + transl[0]
    torch.testing.assert_close(moved.vertices[0], expected, atol=1e-12, rtol=0)


def test_only_the_skin_near_an_elbow_follows_it(male: SkinnedBody) -> None:
    pose = torch.zeros(1, 22, 3, dtype=torch.float64)
    pose[0, JOINT_NAMES.index("right_elbow")] = torch.tensor([0.3, 1.2, -0.4])
    moved = male.posed(pose, torch.zeros(1, 3, dtype=torch.float64)).vertices[0].numpy()
    follows = male.weights[:, [19, 21]].sum(axis=1) > 0
    shift = np.linalg.norm(moved - male.rest_vertices, axis=1)
    assert shift[~follows].max() < 1e-12
    assert shift[male.regions["right_hand"]].min() > 0.1


def test_a_mirrored_pose_gives_the_mirror_image(male: SkinnedBody, random_pose: Draw) -> None:
    swap = [
        JOINT_NAMES.index(name.replace("left", "#").replace("right", "left").replace("#", "right"))
        for name in JOINT_NAMES
    ]
    pose, transl = random_pose(6, 1)
    mirrored = pose[:, swap] * torch.tensor([1.0, -1.0, -1.0])
    flip = torch.tensor([-1.0, 1.0, 1.0])
    ours = male.posed(pose, transl, male.body_component).vertices[0] * flip
    theirs = male.posed(mirrored, transl * flip, male.body_component).vertices[0]
    nearest, _ = KDTree(theirs.numpy()).query(ours.numpy())
    # Random poses of a radian a joint stretch the source mesh's own asymmetry to half a millimetre.
    assert nearest.max() < 1e-3
    assert nearest.mean() < 5e-5

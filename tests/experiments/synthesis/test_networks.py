from __future__ import annotations

import pytest
import torch

from experiments.synthesis.pose_net import PoseNet
from experiments.synthesis.route_net import RouteNet
from experiments.synthesis.subgoal_net import SubgoalNet


def draws(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


@pytest.fixture(scope="module")
def subgoal() -> SubgoalNet:
    torch.manual_seed(1)
    return SubgoalNet()


def size(net: torch.nn.Module) -> int:
    return sum(parameter.numel() for parameter in net.parameters())


ENCODER = (3 * 64 + 64) + (64 * 128 + 128) + (128 * 256 + 256)


def test_the_networks_have_the_published_widths(subgoal) -> None:
    # Published: 9.0 M with an unused layer 1024 -> 256, and 0.30 M. PoseNet has 126 pose numbers, not 56.
    blocks = 4 * 2 * (1024 * 1024 + 1024)
    ends = (275 + 135 + 32) * 512 + 3 * 512 + 2 * (1024 + 1) * 32 + (1024 + 1) * 135
    assert size(subgoal) == ENCODER + blocks + ends
    lstm = 2 * 4 * 64 * (9 + 64 + 2)
    route = lstm + (256 + 1) * 32 + (288 + 1) * 256 + (256 + 1) * 540
    assert size(RouteNet()) == ENCODER + route
    lstm = 2 * 4 * 256 * (126 + 256 + 2)
    pose = lstm + (256 + 1) * 32 + (540 + 1) * 64 + (1120 + 1) * 1024 + (1024 + 1) * 7560
    assert size(PoseNet()) == ENCODER + pose


def test_a_sample_is_the_decoder_half_of_a_reconstruction(subgoal) -> None:
    feature, state, shape, body = draws(2, 256), draws(2, 9), draws(2, 10), draws(2, 135)
    rebuilt, mean, log_variance = subgoal(feature, state, shape, body, torch.zeros(2, 32))
    assert torch.equal(rebuilt, subgoal.sample(feature, state, shape, mean))
    noisy, _, _ = subgoal(feature, state, shape, body, torch.ones(2, 32))
    shifted = mean + torch.exp(0.5 * log_variance)
    assert torch.allclose(noisy, subgoal.sample(feature, state, shape, shifted))


def test_a_sample_depends_on_room_place_body_and_latent(subgoal) -> None:
    given = [draws(1, 256), draws(1, 9), draws(1, 10), draws(1, 32)]
    first = subgoal.sample(*given)
    for index in range(4):
        changed = [value + 1.0 if i == index else value for i, value in enumerate(given)]
        assert not torch.allclose(subgoal.sample(*changed), first, atol=1e-4)


def test_route_and_poses_depend_on_both_ends_the_room_and_the_route() -> None:
    torch.manual_seed(2)
    route, pose = RouteNet(), PoseNet()
    feature, ends, joints, path = draws(3, 256), draws(3, 2, 9), draws(3, 2, 126), draws(3, 60, 9)
    assert route(feature, ends).shape == (3, 60, 9)
    assert pose(feature, joints, path).shape == (3, 60, 126)
    for end in (0, 1):
        moved = ends.clone()
        moved[:, end] += 1.0
        assert not torch.allclose(route(feature, moved), route(feature, ends), atol=1e-4)
    assert not torch.allclose(route(feature + 1.0, ends), route(feature, ends), atol=1e-4)
    first = pose(feature, joints, path)
    for changed in (pose(feature + 1.0, joints, path), pose(feature, joints, path + 1.0)):
        assert not torch.allclose(changed, first, atol=1e-4)


def test_a_batch_is_its_members_one_by_one(subgoal) -> None:
    route = RouteNet()
    feature, ends = draws(4, 256), draws(4, 2, 9)
    alone = torch.cat([route(feature[i : i + 1], ends[i : i + 1]) for i in range(4)])
    assert torch.allclose(route(feature, ends), alone, atol=1e-6)

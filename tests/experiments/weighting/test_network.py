from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from experiments.interaction.features import InteractionFeatures
from experiments.interaction.geometric import geometric_features
from experiments.interaction.mesh import moving_body
from experiments.motion.resample import at_times
from experiments.placement.rigid import move_motion
from experiments.weighting.inputs import (
    farthest_points,
    joint_velocities,
    motion_inputs,
    nearest,
    pooled,
)
from experiments.weighting.network import weight_loss


def test_the_loss_has_the_right_gradient() -> None:
    generator = torch.Generator().manual_seed(0)
    scores = torch.randn(6, 8, generator=generator, dtype=torch.float64, requires_grad=True)
    centres = torch.linspace(0.4, 1.9, 8, dtype=torch.float64)
    target = torch.rand(6, generator=generator, dtype=torch.float64)
    bins = torch.randint(0, 8, (6,), generator=generator)
    assert torch.autograd.gradcheck(lambda x: weight_loss(x, centres, target, bins), (scores,))


def test_the_loss_of_an_undecided_network_has_a_closed_form() -> None:
    centres = torch.arange(8.0)
    target = torch.full((3,), 3.0)
    loss = weight_loss(torch.zeros(3, 8), centres, target, torch.tensor([0, 1, 2]))
    # ln 8 for the bins; the expectation 3.5 is off by 0.5, smooth-L1 0.125, half of it.
    assert float(loss) == pytest.approx(np.log(8) + 0.0625)


def test_the_expectation_of_a_certain_network_is_the_centre_of_its_bin(network) -> None:
    scores = torch.full((1, 8), -50.0)
    scores[0, 5] = 50.0
    assert float(network.expectation(scores)) == pytest.approx(float(network.centres[5]))


def test_the_order_of_the_points_does_not_matter(network, some_inputs) -> None:
    inputs = some_inputs()
    order = torch.randperm(20, generator=torch.Generator().manual_seed(1))
    mixed = dataclasses.replace(
        inputs, points=inputs.points[:, order], classes=inputs.classes[:, order]
    )
    assert network(mixed) == pytest.approx(network(inputs), abs=1e-5)


def test_place_and_heading_of_a_clip_do_not_matter(sit, slim) -> None:
    motion = sit(20)
    moved = move_motion(motion, slim, 2.0, np.array([3.0, -1.0, 0.0]), np.zeros(2))
    features = geometric_features(motion, slim, ("chair", "floor"))[0]
    here = motion_inputs(moving_body(motion, slim), slim, features)
    there = motion_inputs(moving_body(moved, slim), slim, features)
    assert here.points.shape == (20, 164, 4)
    assert there.points == pytest.approx(here.points, abs=1e-4)
    assert there.velocity == pytest.approx(here.velocity, abs=1e-3)


def test_a_clip_at_four_times_the_rate_is_read_in_steps_of_four(network, sit, slim) -> None:
    slow = sit(31)
    fast = at_times(slow, np.linspace(0.0, slow.times[-1], 121), 120.0)
    maps = [geometric_features(motion, slim, ("chair", "floor"))[0] for motion in (slow, fast)]
    read = [
        motion_inputs(moving_body(motion, slim), slim, features)
        for motion, features in zip((slow, fast), maps, strict=True)
    ]
    assert [inputs.stride for inputs in read] == [1, 4]
    with torch.no_grad():
        weights = [network.expectation(network(inputs)) for inputs in read]
    assert weights[1][::4] == pytest.approx(weights[0], abs=0.02)


def test_farthest_points_begin_at_an_end_and_split_what_is_left() -> None:
    line = np.zeros((9, 3))
    line[:, 0] = np.arange(9.0)
    assert sorted(farthest_points(line, 3).tolist()) == [0, 4, 8]
    assert nearest(line, line[[0, 4, 8]]).tolist() == [0, 0, 0, 1, 1, 1, 1, 2, 2]


def test_pooling_counts_contact_and_takes_the_majority_class() -> None:
    label = np.array([[3, 3, 2, 0, 0]])
    features = InteractionFeatures(
        (label > 0) * 1.0, 10.0 * np.eye(42)[label], np.arange(5), "test"
    )
    contact, classes = pooled(features, np.array([0, 0, 0, 1, 1]), 2)
    assert contact.tolist() == [[1.0, 0.0]] and classes.tolist() == [[3, 0]]


def test_joint_velocities_are_seen_from_the_body(sit, slim) -> None:
    standing = sit(31, stand=1.0)
    glide = standing.transl + np.linspace([0.0, 0.0, 0.0], [0.0, -1.5, 0.0], 31)
    motion = dataclasses.replace(standing, transl=glide)
    turned = move_motion(motion, slim, np.pi / 2, np.zeros(3), np.zeros(2))
    velocity = joint_velocities(moving_body(turned, slim))
    # 1.5 m in one second, straight ahead: -y whatever way the body faces.
    ahead = np.broadcast_to([0.0, -1.5, 0.0], (31, 22, 3))
    assert velocity == pytest.approx(ahead, abs=1e-4)

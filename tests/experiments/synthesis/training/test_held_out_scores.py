"""Held-out scores: closed-form cases of every error and every baseline."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from experiments.synthesis.baselines import nearest_segments, straight
from experiments.synthesis.body_vector import POSE, STATE, rotations_to_6d
from experiments.synthesis.held_out_scores import kind_groups, pose_score, route_score, spread
from experiments.synthesis.placed_windows import PlacedWindows
from experiments.synthesis.training_set import TrainingSet, turned_vectors


@pytest.fixture(scope="module")
def train(windows: PlacedWindows) -> TrainingSet:
    return TrainingSet(windows, "train")


def _vectors(train: TrainingSet, count: int = 6) -> tuple[np.ndarray, torch.Tensor]:
    placements = spread(train.moving, count)
    return placements, train.vectors(placements, np.zeros(len(placements), dtype=np.int64))


def test_the_truth_has_no_error(train: TrainingSet) -> None:
    placements, true = _vectors(train)
    route = route_score(train, placements, true, true[:, 1:61, STATE])
    pose = pose_score(true, true[:, 1:61, POSE])
    assert route.position_cm == route.middle_cm == 0.0
    assert route.heading_deg < 0.1 and pose.angle_deg < 0.1 and pose.position_cm < 1e-3


def test_a_route_ten_centimetres_aside_is_ten_centimetres_off(train: TrainingSet) -> None:
    placements, true = _vectors(train)
    route = true[:, 1:61, STATE].clone()
    route[..., 0] += 0.06
    route[..., 1] -= 0.08
    assert route_score(train, placements, true, route).position_cm == pytest.approx(10.0, abs=1e-3)


def test_joints_turned_by_seven_degrees_are_seven_degrees_off(train: TrainingSet) -> None:
    _, true = _vectors(train)
    angle = np.radians(7.0)
    zero = rotations_to_6d(torch.zeros(1, 60, 21, 3)).flatten(2)
    turned = rotations_to_6d(torch.tensor([angle, 0.0, 0.0]).expand(1, 60, 21, 3)).flatten(2)
    whole = true[:1].clone()
    whole[:, 1:61, POSE] = zero
    assert pose_score(whole, turned).angle_deg == pytest.approx(7.0, abs=0.01)


def test_the_straight_line_goes_evenly_from_end_to_end() -> None:
    ends = torch.zeros(1, 62, 135)
    upright = rotations_to_6d(torch.zeros(22, 3))
    quarter = rotations_to_6d(torch.tensor([0.0, 0.0, np.pi / 2], dtype=torch.float32))
    ends[..., 3:] = upright.flatten()
    ends[0, 61, :3] = torch.tensor([6.1, 0.0, 0.0])
    ends[0, 61, 3:9] = quarter
    found = straight(ends)
    assert torch.allclose(found[0, :, 0], 0.1 * torch.arange(1.0, 61.0), atol=1e-5)
    turn = torch.rad2deg(torch.atan2(found[0, :, 4], found[0, :, 3]))
    assert torch.allclose(turn, 90.0 * torch.arange(1.0, 61.0) / 61, atol=0.05)


def test_the_nearest_clip_of_a_training_window_is_itself_wherever_it_stands(
    train: TrainingSet,
) -> None:
    _, true = _vectors(train)
    zero = torch.zeros(len(true), 3)
    shift = torch.tensor([[1.0, -2.0, 0.0]]).expand(len(true), 3)
    moved = turned_vectors(true, zero, torch.full((len(true),), 0.7), shift)
    found = nearest_segments(train, moved)
    # the pelvis, not the translation, is what a placement turns: some millimetres
    assert (found[..., :3] - moved[:, 1:61, :3]).norm(dim=-1).max() < 0.02
    assert (found[..., 3:] - moved[:, 1:61, 3:]).abs().max() < 0.01


def test_groups_of_kinds_divide_the_placements(train: TrainingSet) -> None:
    groups = kind_groups(train, train.moving)
    parts = [groups[kind] for kind in groups if kind != "all"]
    assert np.array_equal(np.sort(np.concatenate(parts)), groups["all"])

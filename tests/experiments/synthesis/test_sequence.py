from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from experiments.synthesis.body_vector import POSE, STATE
from experiments.synthesis.route_net import SEGMENT
from experiments.synthesis.sequence import (
    generate,
    n_segments,
    root_state,
    scene_features,
    subgoal_bodies,
)
from experiments.synthesis.spots import room_spots
from experiments.synthesis.subgoals import choose_subgoals


@pytest.fixture(scope="module")
def spots(seat_room, slim):
    return choose_subgoals(room_spots(seat_room, slim), 4, np.random.default_rng(1))


@pytest.fixture
def bodies(untrained, seat_room, slim, spots):
    """bodies(seed): sub-goal bodies of the spots."""
    features = scene_features(untrained, seat_room)
    return lambda seed: subgoal_bodies(
        untrained, features, slim, spots, np.random.default_rng(seed)
    )


@given(st.integers(1, 5000))
def test_segments_are_as_few_as_cover_the_frames(n_frames) -> None:
    assert SEGMENT * (n_segments(n_frames) - 1) < n_frames <= SEGMENT * n_segments(n_frames)


def test_a_sequence_is_routes_and_poses_between_neighbouring_subgoals(
    untrained, seat_room, bodies
) -> None:
    features, goals = scene_features(untrained, seat_room), bodies(2)
    vectors = generate(untrained, features, goals)
    assert vectors.shape == (3 * SEGMENT, 135)
    for k in range(3):
        ends, segment = goals[None, k : k + 2], vectors[SEGMENT * k : SEGMENT * (k + 1)]
        route = untrained.route(features.route, ends[..., STATE])
        poses = untrained.pose(features.pose, ends[..., POSE], route)
        assert torch.allclose(segment[:, STATE], route[0], atol=1e-6)
        assert torch.allclose(segment[:, POSE], poses[0], atol=1e-6)


def test_the_seed_decides_the_bodies(bodies) -> None:
    assert torch.equal(bodies(1), bodies(1))
    assert not torch.allclose(bodies(1), bodies(2), atol=1e-4)


def test_a_room_is_encoded_once(untrained, seat_room, bed_room) -> None:
    first = scene_features(untrained, seat_room)
    calls: list[int] = []
    hooks = [
        net.scene.register_forward_hook(lambda *_: calls.append(1))
        for net in (untrained.subgoal, untrained.route, untrained.pose)
    ]
    assert scene_features(untrained, seat_room) is first and not calls
    assert not torch.equal(scene_features(untrained, bed_room).route, first.route)
    assert len(calls) == 3
    for hook in hooks:
        hook.remove()


def test_a_root_state_is_translation_and_two_columns(slim, spots) -> None:
    state = root_state(spots[0], slim)
    assert state[:3] == pytest.approx(spots[0].pelvis - slim.rest_joints[0])
    assert np.array_equal(state[3:6], spots[0].orientation[:, 0])
    assert np.array_equal(state[6:], spots[0].orientation[:, 1])

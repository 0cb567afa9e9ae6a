from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from experiments.weighting.diversity import (
    diversity,
    embedding_distances,
    gradient_embedding_reference,
    gradient_factors,
    spread_seeds,
    spread_seeds_reference,
)


def random_factors(seed: int, n_frames: int = 9) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    return generator.normal(size=(n_frames, 8)), generator.normal(size=(n_frames, 5))


def test_the_written_out_gradient_equals_automatic_differentiation(network, some_inputs) -> None:
    with torch.no_grad():
        hidden = network.hidden(some_inputs())
        scores = network.head(hidden)
    residual, state = gradient_factors(scores, hidden)
    product = np.einsum("tb,th->tbh", residual, state).reshape(len(state), -1)
    assert product == pytest.approx(gradient_embedding_reference(network.head, hidden), abs=1e-6)


@given(st.integers(0, 10_000))
def test_distances_without_the_embedding_equal_those_with_it(seed: int) -> None:
    residual, hidden = random_factors(seed)
    embedding = np.einsum("tb,th->tbh", residual, hidden).reshape(len(hidden), -1)
    expected = cdist(embedding, embedding, "sqeuclidean")
    assert embedding_distances(residual, hidden) == pytest.approx(expected, abs=1e-9)


@given(st.integers(0, 10_000), st.integers(1, 9))
def test_all_repeats_at_once_pick_what_one_picks_at_a_time(seed: int, count: int) -> None:
    residual, hidden = random_factors(seed)
    residual[3], hidden[3] = residual[5], hidden[5]  # two frames that are the same
    distance = embedding_distances(residual, hidden)
    chance = np.random.default_rng(seed).random((6, count))
    picked = spread_seeds(distance, chance)
    assert picked.tolist() == [spread_seeds_reference(distance, row) for row in chance]
    assert all(len(set(row)) == count for row in picked.tolist())


def test_the_second_seed_is_drawn_by_squared_distance() -> None:
    # Points on a line at 0, 1 and 3: from 0 the odds are 1 : 9, from 1 they are 1 : 4, from 3, 9 : 4.
    points = np.array([0.0, 1.0, 3.0])
    distance = (points[:, None] - points) ** 2
    pairs = spread_seeds(distance, np.random.default_rng(0).random((20_000, 2)))
    share = np.zeros((3, 3))
    np.add.at(share, tuple(pairs.T), 1.0 / len(pairs))
    expected = [[0, 1 / 30, 9 / 30], [1 / 15, 0, 4 / 15], [9 / 39, 4 / 39, 0]]
    assert share == pytest.approx(np.array(expected), abs=0.01)


def test_one_odd_frame_among_equal_ones_is_always_picked() -> None:
    residual, hidden = np.ones((20, 8)), np.ones((20, 5))
    residual[13] = -1.0
    score = diversity(residual, hidden, seed=1)
    # A quarter of twenty frames is picked each time, the odd one among them: 1 / (5 / 20).
    assert score[13] == pytest.approx(4.0)
    assert score.mean() == pytest.approx(1.0)
    assert np.delete(score, 13).max() < 2.0


def test_frames_that_are_all_the_same_score_alike_on_average() -> None:
    score = diversity(np.ones((8, 8)), np.ones((8, 5)), seed=2)
    assert score == pytest.approx(np.ones(8), abs=0.4)
    assert np.array_equal(score, diversity(np.ones((8, 8)), np.ones((8, 5)), seed=2))

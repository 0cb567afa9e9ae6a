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
def test_seeds_are_distinct_and_as_many_as_asked(seed: int, count: int) -> None:
    distance = embedding_distances(*random_factors(seed))
    picked = spread_seeds(distance, count, np.random.default_rng(seed))
    assert len(set(picked.tolist())) == count


def test_the_second_seed_is_drawn_by_squared_distance() -> None:
    # Points on a line at 0, 1 and 3: from 0 the odds are 1 : 9, from 1 they are 1 : 4, from 3, 9 : 4.
    points = np.array([0.0, 1.0, 3.0])
    distance = (points[:, None] - points) ** 2
    generators = np.random.default_rng(0).spawn(6000)
    pairs = [tuple(spread_seeds(distance, 2, generator).tolist()) for generator in generators]
    share = {pair: pairs.count(pair) / len(pairs) for pair in set(pairs)}
    assert share[0, 2] == pytest.approx(0.3, abs=0.02)
    assert share[1, 0] == pytest.approx(1 / 15, abs=0.02)
    assert share[2, 0] == pytest.approx(3 / 13, abs=0.02)


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
    assert score == pytest.approx(np.ones(8), abs=0.75)
    assert np.array_equal(score, diversity(np.ones((8, 8)), np.ones((8, 5)), seed=2))

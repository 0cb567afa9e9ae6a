from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.interaction.features import InteractionFeatures
from experiments.interaction.geometric import geometric_features
from experiments.interaction.mesh import moving_body
from experiments.weighting.geometric import (
    class_histogram,
    geometric_weights,
    interaction_rarity,
    relative_rank,
)
from experiments.weighting.weights import uniform_weights


def features_of(labels: np.ndarray) -> InteractionFeatures:
    """One-hot features: labels (T, V), 0 where nothing touches."""
    scores = 10.0 * np.eye(42)[labels]
    return InteractionFeatures((labels > 0) * 1.0, scores, np.arange(labels.shape[1]), "test")


def test_long_standing_then_a_short_sit_puts_the_weight_on_the_sit(sit, slim) -> None:
    # The paper's own example, section 3.3: standing may happen anywhere, the sit must find a chair.
    motion = sit(150, stand=0.66)
    features = geometric_features(motion, slim, ("chair", "floor"))[0]
    weights = geometric_weights(moving_body(motion, slim).vertices, motion.times, features).values
    seated = (features.semantics.argmax(-1) == 3).any(1)
    assert 0.05 < seated.mean() < 0.35
    assert weights[seated].min() > np.median(weights[:90])
    assert weights[seated].mean() > 1.3 * weights[:90].mean()


@given(st.integers(0, 10_000), st.integers(4, 30))
def test_weights_are_positive_with_mean_one(seed: int, n_frames: int) -> None:
    rng = np.random.default_rng(seed)
    features = features_of(rng.integers(0, 4, (n_frames, 6)))
    times = np.arange(n_frames) / 30.0
    weights = geometric_weights(rng.normal(size=(n_frames, 6, 3)), times, features).values
    assert weights.mean() == pytest.approx(1.0)
    assert weights.min() > 0.0


def test_a_rare_interaction_is_rarer_than_a_common_one() -> None:
    labels = np.full((10, 3), 2)
    labels[7] = 10
    rarity = interaction_rarity(class_histogram(features_of(labels), labels > 0))
    # Nine floor frames and one sofa frame: mean cosines 0.9 and 0.1.
    assert rarity[0] == pytest.approx(0.1, abs=5e-3)
    assert rarity[7] == pytest.approx(0.9, abs=5e-3)


def test_a_frame_that_touches_nothing_has_a_class_of_its_own() -> None:
    labels = np.array([[2, 2, 0], [0, 0, 0]])
    histogram = class_histogram(features_of(labels), labels > 0)
    assert histogram.sum(1) == pytest.approx([1.0, 1.0])
    assert histogram[0, 2] > 0.99 and histogram[1, 0] == 1.0


def test_equal_values_share_a_rank_that_is_never_zero() -> None:
    assert relative_rank(np.array([5.0, 1.0, 1.0, 9.0])).tolist() == [0.75, 0.375, 0.375, 1.0]
    assert relative_rank(np.zeros(4)).tolist() == [0.625] * 4


def test_uniform_weights_are_all_one() -> None:
    assert uniform_weights(3).values.tolist() == [1.0, 1.0, 1.0]

"""The printed weights K with the shipped network, and the rules beside them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from experiments.interaction.geometric import geometric_features
from experiments.placement.settings import PRESETS
from experiments.weighting.diversity import diversity, gradient_factors
from experiments.weighting.frame_weights import (
    active_weights,
    clip_seed,
    frame_weights,
    keyframes_only,
)
from experiments.weighting.weights import FrameWeights
from experiments.weighting.weights_file import WEIGHTS_FILE, load_network, network_metadata
from renderer.files import InputError

PAAK = dataclasses.replace(PRESETS["fast"], weighting="paak")


def features_of(motion, body):
    return geometric_features(motion, body, ("chair", "floor"))[0]


def test_long_standing_then_a_short_sit_puts_the_sit_on_top(sit, slim) -> None:
    # The paper's own example, in its section on frame weighting.
    motion = sit(150, stand=0.66)
    features = features_of(motion, slim)
    weights = frame_weights(motion, slim, features, PAAK, seed=1).values
    seated = (features.semantics.argmax(-1) == 3).any(1)
    standing = np.arange(150) < 90
    assert 0.05 < seated.mean() < 0.35
    assert weights[seated].mean() > 1.3 * weights[standing].mean()
    assert weights[~standing].min() > 0.0
    top = np.argsort(-weights)[: int(seated.sum())]
    assert (top >= 90).mean() > 0.9


def test_the_weights_have_mean_one_and_repeat_with_their_seed(sit, slim) -> None:
    motion = sit(40)
    features = features_of(motion, slim)
    first, second, other = (frame_weights(motion, slim, features, PAAK, s) for s in (1, 1, 2))
    assert first.values.mean() == pytest.approx(1.0) and first.rule == "paak"
    assert np.array_equal(first.values, second.values)
    assert not np.array_equal(first.values, other.values)


def test_rules_are_chosen_by_name_and_others_are_refused(sit, slim) -> None:
    motion = sit(20)
    features = features_of(motion, slim)
    uniform = dataclasses.replace(PAAK, weighting="uniform")
    assert frame_weights(motion, slim, features, uniform, 0).values.tolist() == [1.0] * 20
    geometric = dataclasses.replace(PAAK, weighting="geometric")
    assert frame_weights(motion, slim, features, geometric, 0).rule == "geometric"
    object.__setattr__(uniform, "weighting", "psychic")
    with pytest.raises(InputError, match="weighting: got 'psychic', wanted one of paak"):
        frame_weights(motion, slim, features, uniform, 0)


def test_the_weights_are_the_printed_sum_of_estimate_and_smoothed_diversity(
    network, some_inputs
) -> None:
    inputs = some_inputs(40)
    hidden = network.hidden(inputs)
    scores = network.head(hidden)
    estimate = network.expectation(scores).double().numpy()
    drawn = diversity(*gradient_factors(scores, hidden), 5)
    # A Gaussian of two frames, cut at four standard deviations, the ends held.
    kernel = np.exp(-(np.arange(-8, 9) ** 2) / 8.0)
    smooth = np.convolve(np.pad(drawn, 8, mode="edge"), kernel / kernel.sum(), mode="valid")
    expected = 0.7 * estimate / estimate.mean() + 0.3 * smooth / smooth.mean()
    assert active_weights(network, inputs, seed=5) == pytest.approx(expected, rel=1e-6)


def test_motions_of_one_set_draw_independently(sit) -> None:
    one = sit(20)
    seeds = [clip_seed(one, 1), clip_seed(dataclasses.replace(one, motion_id="b"), 1)]
    assert len({*seeds, clip_seed(one, 2)}) == 3 and clip_seed(one, 1) == seeds[0]


def test_keyframes_are_the_heaviest_frames_and_nothing_else_counts() -> None:
    weights = FrameWeights(np.array([0.5, 2.0, 1.0, 0.5, 1.5, 0.5, 1.0, 1.0]), "paak")
    kept = keyframes_only(weights, 0.25)
    assert kept.values == pytest.approx([0, 2.0 * 8 / 3.5, 0, 0, 1.5 * 8 / 3.5, 0, 0, 0])
    assert kept.rule == "paak, top 25%" and kept.values.mean() == pytest.approx(1.0)
    assert np.count_nonzero(keyframes_only(weights, 0.01).values) == 1


def test_the_shipped_network_says_how_it_was_made() -> None:
    about = network_metadata(WEIGHTS_FILE)
    assert {"seed", "interaction", "recipe", "sha256", "training_clips"} <= about.keys()
    assert sum(value.numel() for value in load_network().parameters()) < 500_000
    assert WEIGHTS_FILE.stat().st_size < 1_000_000

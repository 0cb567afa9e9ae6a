"""PAAK-style placement: the weights it uses, in both modes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from experiments.methods import METHODS
from experiments.methods.paak import paak_weights
from experiments.placement.features import choose_features
from experiments.placement.settings import PRESETS
from experiments.weighting.frame_weights import frame_weights

SOFT = dataclasses.replace(PRESETS["fast"], interaction="geometric")
KEYFRAMES = dataclasses.replace(SOFT, paak_mode="top_k", paak_top_share=0.2)


@pytest.fixture(scope="module")
def sitting(sit):
    return sit(40, stand=0.6)


def test_paak_and_pace_weigh_the_same_frames_alike(sitting, slim, seat_room) -> None:
    placed = {
        name: METHODS[name].place(sitting, seat_room, slim, SOFT, 3) for name in ("paak", "pace")
    }
    assert np.array_equal(placed["paak"].weights, placed["pace"].weights)
    features = choose_features(sitting, seat_room, slim, SOFT)
    expected = frame_weights(sitting, slim, features, SOFT, 3).values
    assert placed["paak"].weights == pytest.approx(expected)
    assert not placed["paak"].altered and placed["pace"].altered


def test_keyframes_alone_decide_in_the_keyframe_mode(sitting, slim, seat_room) -> None:
    placement = METHODS["paak"].place(sitting, seat_room, slim, KEYFRAMES, 3)
    assert np.count_nonzero(placement.weights) == 8
    assert placement.weights.mean() == pytest.approx(1.0)
    assert placement.info["weighting"].endswith("top 20%")


def test_the_keyframes_are_frames_of_highest_weight(sitting, slim, seat_room) -> None:
    features = choose_features(sitting, seat_room, slim, SOFT)
    soft = paak_weights(sitting, slim, features, SOFT, 3).values
    kept = paak_weights(sitting, slim, features, KEYFRAMES, 3).values > 0.0
    assert soft[kept].min() >= soft[~kept].max()


def test_every_name_shown_says_that_the_method_is_ours() -> None:
    shown = [METHODS[name].display_name for name in ("paak", "paak_plus")]
    assert shown == ["PAAK-style (re-implemented)", "PAAK-style+ (ours)"]

"""Scores of contact maps: hand-worked cases and identities."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from experiments.interaction.contact_scores import (
    active_units,
    average_precision,
    calibration_error,
    class_accuracy,
    diversity,
    f1_score,
    flicker,
    intersection_over_union,
)

T, F = True, False


def test_f1_and_iou_of_a_hand_worked_map() -> None:
    found, true = np.array([T, T, F, F, T]), np.array([T, F, T, F, T])
    # two hits, one false alarm, one miss
    assert f1_score(found, true) == pytest.approx(2 * 2 / (2 * 2 + 1 + 1))
    assert intersection_over_union(found, true) == pytest.approx(2 / 4)


@given(seed=st.integers(0, 999))
@settings(deadline=None)
def test_f1_is_a_function_of_iou(seed: int) -> None:
    found, true = np.random.default_rng(seed).random((2, 30)) < 0.4
    iou = intersection_over_union(found, true)
    assert f1_score(found, true) == pytest.approx(2 * iou / (1 + iou))


def test_average_precision_of_the_textbook_ranking() -> None:
    # Hits at ranks 1, 3 and 5: the mean of 1/1, 2/3 and 3/5.
    score = np.array([0.9, 0.8, 0.7, 0.6, 0.5, 0.4])
    true = np.array([T, F, T, F, T, F])
    assert average_precision(score, true) == pytest.approx((1 + 2 / 3 + 3 / 5) / 3)


def test_average_precision_takes_equal_scores_as_one_threshold() -> None:
    score, true = np.full(10, 0.3), np.arange(10) < 4
    assert average_precision(score, true) == pytest.approx(0.4)
    assert average_precision(score[::-1], true[::-1]) == pytest.approx(0.4)


@given(seed=st.integers(0, 999))
@settings(deadline=None, max_examples=30)
def test_average_precision_is_the_area_under_the_step_curve(seed: int) -> None:
    rng = np.random.default_rng(seed)
    score, true = rng.integers(0, 6, 40) / 5.0, rng.random(40) < 0.5
    cuts = np.unique(score)[::-1]
    recall = np.array([(true & (score >= cut)).sum() / max(true.sum(), 1) for cut in cuts])
    precision = np.array([true[score >= cut].mean() for cut in cuts])
    # A step function integrated exactly: trapezoids over doubled knots.
    x = np.repeat(np.concatenate([[0.0], recall]), 2)[1:-1]
    area = float(integrate.trapezoid(np.repeat(precision, 2), x))
    assert average_precision(score, true) == pytest.approx(area)


def test_classes_count_where_contact_is_true_only() -> None:
    found, true = np.array([2, 3, 5, 5]), np.array([2, 2, 5, 0])
    assert class_accuracy(found, true, np.array([T, T, T, F])) == pytest.approx(2 / 3)
    assert np.isnan(class_accuracy(found, true, np.zeros(4, dtype=bool)))


def test_a_calibrated_forecast_has_no_calibration_error() -> None:
    probability = np.repeat([0.25, 0.75], 8)
    true = np.concatenate([np.arange(8) < 2, np.arange(8) < 6])
    assert calibration_error(probability, true) == pytest.approx(0.0)
    # Half of the entries are off by 0.25, half by 0.75.
    assert calibration_error(probability, np.zeros(16, dtype=bool)) == pytest.approx(0.5)


def test_certainty_falls_into_the_last_bin() -> None:
    assert calibration_error(np.ones(5), np.array([T, T, T, T, F])) == pytest.approx(0.2)


def test_flicker_counts_changes_between_consecutive_frames_of_one_clip() -> None:
    contact = np.array([[T, F], [F, T], [F, T], [T, F], [T, T]])
    clip, frame = np.array([0, 0, 0, 1, 1]), np.array([0, 1, 2, 0, 5])
    # 2 and 0 changes; the step to the other clip and the gap of five frames do not count.
    assert flicker(contact, clip, frame) == pytest.approx(1.0)


@given(seed=st.integers(0, 999))
@settings(deadline=None, max_examples=30)
def test_diversity_is_the_mean_over_all_pairs(seed: int) -> None:
    samples = np.random.default_rng(seed).random((5, 3, 7)) < 0.5
    pairs = [(a != b).sum(-1).mean() for a, b in combinations(samples, 2)]
    assert diversity(samples) == pytest.approx(np.mean(pairs))


def test_units_that_do_not_move_are_not_active() -> None:
    means = np.stack([np.linspace(-1, 1, 50), np.full(50, 0.7), np.linspace(0, 0.1, 50)], axis=1)
    assert active_units(means) == 1

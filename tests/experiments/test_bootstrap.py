from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import bootstrap

from experiments.bootstrap import clustered_mean_interval


def test_equal_clusters_give_the_interval_of_scipy() -> None:
    # scipy draws its resamples in the same way, so the percentiles agree to rounding.
    data = np.random.default_rng(5).normal(size=(13, 4))
    values = {str(index): row.tolist() for index, row in enumerate(data)}
    mean, low, high = clustered_mean_interval(values, seed=3, resamples=2000)
    expected = bootstrap(
        (data.mean(1),), np.mean, n_resamples=2000, method="percentile",
        rng=np.random.default_rng(3),
    ).confidence_interval  # fmt: skip
    assert mean == pytest.approx(data.mean())
    assert (low, high) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_unequal_clusters_give_the_interval_of_scipy_for_a_ratio_of_sums() -> None:
    generator = np.random.default_rng(8)
    values = {
        str(i): generator.normal(i, 1, int(generator.integers(1, 5))).tolist() for i in range(11)
    }
    sums = np.array([sum(cases) for cases in values.values()])
    counts = np.array([len(cases) for cases in values.values()])

    def ratio(index: np.ndarray, axis: int) -> np.ndarray:
        return sums[index].sum(axis) / counts[index].sum(axis)

    expected = bootstrap(
        (np.arange(11),), ratio, n_resamples=3000, method="percentile", vectorized=True,
        rng=np.random.default_rng(1),
    ).confidence_interval  # fmt: skip
    mean, low, high = clustered_mean_interval(values, seed=1, resamples=3000)
    assert mean == pytest.approx(sums.sum() / counts.sum())
    assert (low, high) == pytest.approx((expected.low, expected.high), abs=1e-12)


@given(st.floats(-2, 2), st.integers(2, 9), st.integers(0, 99))
def test_cases_that_are_all_alike_leave_no_width(value: float, clusters: int, seed: int) -> None:
    values = {str(index): [value] * (1 + index % 3) for index in range(clusters)}
    interval = clustered_mean_interval(values, seed, resamples=50)
    assert interval == pytest.approx((value, value, value), abs=1e-12)


def test_a_single_cluster_has_a_mean_and_no_interval() -> None:
    mean, low, high = clustered_mean_interval({"walk": [1.0, 2.0]}, seed=0)
    assert mean == 1.5 and np.isnan(low) and np.isnan(high)


def test_repeating_every_case_within_its_cluster_adds_no_certainty() -> None:
    values = {str(index): [float(index % 4)] for index in range(12)}
    often = {name: cases * 7 for name, cases in values.items()}
    once, again = (clustered_mean_interval(v, seed=2, resamples=500) for v in (values, often))
    assert once == pytest.approx(again)

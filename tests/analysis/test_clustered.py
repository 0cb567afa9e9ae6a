from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from hypothesis import given
from hypothesis import strategies as st

from analysis.cells import Cells, count_cells
from analysis.clustered import clustered_rate, intraclass_correlation, logit_variance


def _answers(cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Cells back to single answers: won, and columns participant, stimulus."""
    won = np.concatenate([
        np.arange(n) < k for k, n in zip(cells.wins, cells.answers, strict=True)
    ])  # fmt: skip
    groups = np.column_stack([cells.participant, cells.stimulus])
    return won.astype(float), np.repeat(groups, cells.answers, axis=0)


@pytest.mark.parametrize("seed", range(6))
def test_variances_equal_statsmodels_sandwich(seed: int, random_cells: Callable) -> None:
    cells = random_cells(seed)
    won, groups = _answers(cells)
    model = sm.GLM(won, np.ones((len(won), 1)), family=sm.families.Binomial())
    both = model.fit(cov_type="cluster", cov_kwds={"groups": groups}).cov_params().item()
    one = [
        model.fit(cov_type="cluster", cov_kwds={"groups": groups[:, i]}).cov_params().item()
        for i in (0, 1)
    ]
    two_way, person, stimulus, cell = logit_variance(cells)
    assert person == pytest.approx(one[0], rel=1e-8)
    assert stimulus == pytest.approx(one[1], rel=1e-8)
    assert person + stimulus - cell == pytest.approx(both, rel=1e-8)
    assert two_way == max(person + stimulus - cell, person, stimulus)


@pytest.mark.shared
def test_light_field_side_bias_equals_r_sandwich(shared_data: Path) -> None:
    # R: vcovCL(glm(first ~ 1, binomial), cluster = ~ observer, type = "HC1")
    folder = shared_data / "analysis"
    expected = json.loads((folder / "expected.json").read_text())["lf_side_cluster"]
    data = pd.read_csv(folder / "pwcmp_lf.csv")
    people, scenes = pd.factorize(data.observer)[0], pd.factorize(data.scene)[0]
    cells = count_cells(people, scenes, (data.selected == 1).to_numpy())
    rate = clustered_rate(cells)
    assert math.log(rate.rate / (1 - rate.rate)) == pytest.approx(expected["logit"], abs=1e-9)
    assert math.sqrt(logit_variance(cells)[1]) == pytest.approx(expected["se_CR1"], rel=1e-3)
    assert rate.design_effect > 12  # the naive standard error is 3.6 times too small


def test_one_answer_a_cluster_gives_the_independent_variance() -> None:
    n, k = 50, 30
    cells = count_cells(np.arange(n), np.arange(n), np.arange(n) < k)
    expected = n / (n - 1) * n / (k * (n - k))
    assert logit_variance(cells) == pytest.approx([expected] * 4)


def test_copying_every_answer_does_not_narrow_the_interval(random_cells: Callable) -> None:
    cells = random_cells(3)
    twice = Cells(cells.participant, cells.stimulus, 2 * cells.wins, 2 * cells.answers)
    assert clustered_rate(twice).ci == pytest.approx(clustered_rate(cells).ci)
    assert clustered_rate(twice).design_effect == pytest.approx(
        2 * clustered_rate(cells).design_effect
    )


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(1, 8), st.floats(0, 1))
def test_every_table_gives_a_finite_interval_around_its_rate(
    seed: int, people: int, stimuli: int, share: float
) -> None:
    rng = np.random.default_rng(seed)
    size = int(rng.integers(1, 60))
    cells = count_cells(
        rng.integers(0, people, size), rng.integers(0, stimuli, size), rng.random(size) < share
    )
    rate = clustered_rate(cells)
    low, high = rate.ci
    assert 0 <= low <= rate.rate <= high <= 1
    assert 0 <= rate.p <= 1
    assert rate.flags or min(cells.participants, cells.stimuli) >= 10


def test_swapping_the_methods_mirrors_the_interval(random_cells: Callable) -> None:
    cells = random_cells(5)
    mirrored = Cells(cells.participant, cells.stimulus, cells.answers - cells.wins, cells.answers)
    one, other = clustered_rate(cells), clustered_rate(mirrored)
    assert (1 - other.ci[1], 1 - other.ci[0]) == pytest.approx(one.ci)
    assert other.p == pytest.approx(one.p)


def test_all_wins_get_an_exact_one_sided_interval() -> None:
    people, stimuli = np.divmod(np.arange(400), 20)
    rate = clustered_rate(count_cells(people, stimuli, np.ones(400, dtype=bool)))
    assert rate.ci == pytest.approx((0.05 ** (1 / 20), 1.0))
    assert rate.kind == "one-sided" and "all answers are wins" in rate.flags[0]
    none = clustered_rate(count_cells(people, stimuli, np.zeros(400, dtype=bool)))
    assert none.ci == pytest.approx((0.0, 1 - 0.05 ** (1 / 20)))


def test_one_participant_says_nothing_of_others() -> None:
    cells = count_cells(np.zeros(20, dtype=int), np.arange(20), np.arange(20) < 12)
    rate = clustered_rate(cells)
    assert (rate.rate, rate.ci, rate.p) == (0.6, (0.0, 1.0), 1.0)
    assert "one participant only" in rate.flags[0]


def test_few_clusters_are_said_loudly() -> None:
    rng = np.random.default_rng(0)
    cells = count_cells(
        np.repeat(np.arange(9), 30), rng.integers(0, 25, 270), rng.random(270) < 0.6
    )
    rate = clustered_rate(cells)
    assert rate.df == 8
    assert rate.flags == ("only 9 clusters: the interval is unreliable below 10",)


def test_intraclass_correlation_is_one_for_identical_and_none_without_spread() -> None:
    groups, answers = np.arange(10), np.full(10, 4)
    wins = np.where(groups < 5, 4, 0)
    assert intraclass_correlation(groups, wins, answers) == pytest.approx(1.0)
    assert intraclass_correlation(groups, answers, answers) is None

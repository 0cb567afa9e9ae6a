from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from analysis.cells import count_cells
from analysis.clustered import clustered_rate
from analysis.resampling import bootstrap_rates, leave_one_out, leave_one_out_slowly, swapped


@pytest.mark.parametrize("seed", range(8))
def test_the_closed_form_equals_estimating_afresh(seed: int, random_cells: Callable) -> None:
    cells = random_cells(seed, people=7, stimuli=9, drop=0.6)
    np.testing.assert_allclose(leave_one_out(cells), leave_one_out_slowly(cells), atol=1e-10)
    turned = swapped(cells)
    np.testing.assert_allclose(leave_one_out(turned), leave_one_out_slowly(turned), atol=1e-10)


def test_leaving_out_the_only_dissenter_gives_the_all_wins_interval() -> None:
    people, stimuli = np.divmod(np.arange(60), 10)
    cells = count_cells(people, stimuli, people > 0)
    found = leave_one_out(cells)
    assert found[0, 0] == 1.0 and found[0, 2] == 1.0
    np.testing.assert_allclose(found, leave_one_out_slowly(cells), atol=1e-10)


def test_two_participants_give_no_interval_without_one_of_them() -> None:
    people, stimuli = np.divmod(np.arange(40), 20)
    found = leave_one_out(count_cells(people, stimuli, np.arange(40) % 3 > 0))
    np.testing.assert_allclose(found[:, 1:], [[0, 1], [0, 1]])


def test_the_bootstrap_spread_is_that_of_cluster_means() -> None:
    rng = np.random.default_rng(0)
    people, stimuli = np.divmod(np.arange(60 * 25), 25)
    truth = rng.normal(0.3, 0.9, 60)
    cells = count_cells(people, stimuli, rng.random(1500) < 1 / (1 + np.exp(-truth[people])))
    rates = bootstrap_rates([cells.participant], [cells], 20_000, seed=1)[:, 0]
    means = np.bincount(people, cells.wins) / 25
    expected = means.std() / np.sqrt(60)  # all participants answered equally often
    assert rates.mean() == pytest.approx(means.mean(), abs=4 * expected / np.sqrt(20_000))
    assert rates.std() == pytest.approx(expected, rel=0.03)


def test_the_bootstrap_is_fixed_by_its_seed_and_keeps_comparisons_together(
    random_cells: Callable,
) -> None:
    cells = random_cells(1)
    codes = [cells.participant, cells.participant]
    one = bootstrap_rates(codes, [cells, cells], 500, seed=7)
    np.testing.assert_array_equal(one, bootstrap_rates(codes, [cells, cells], 500, seed=7))
    np.testing.assert_array_equal(one[:, 0], one[:, 1])
    assert not np.array_equal(one, bootstrap_rates(codes, [cells, cells], 500, seed=8))
    low, high = np.percentile(one[:, 0], [2.5, 97.5])
    assert low < clustered_rate(cells).rate < high

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import krippendorff
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from statsmodels.stats.inter_rater import cohens_kappa
from statsmodels.stats.inter_rater import fleiss_kappa as oracle_fleiss

from analysis.reliability import (
    cohen_kappa,
    fleiss_kappa,
    gwet_ac1,
    krippendorff_alpha,
    noise_ceiling,
    within_participants,
)  # fmt: skip
from analysis.responses import read_responses


@pytest.mark.shared
def test_published_examples_equal_r_irr(shared_data: Path) -> None:
    expected = json.loads((shared_data / "analysis" / "expected.json").read_text())
    codings = pd.read_csv(shared_data / "analysis" / "codings_krippendorff.csv", header=None)
    counts = np.array([[(codings[u] == c).sum() for c in range(1, 6)] for u in codings])
    assert krippendorff_alpha(counts) == pytest.approx(expected["kripp_codings_nominal"], abs=1e-9)
    diagnoses = pd.read_csv(shared_data / "analysis" / "fleiss_diagnoses.csv")
    kinds = sorted(set(diagnoses.to_numpy().ravel()))
    counts = np.array([[(row == kind).sum() for kind in kinds] for row in diagnoses.to_numpy()])
    assert fleiss_kappa(counts) == pytest.approx(expected["fleiss_diagnoses"]["kappa"], abs=1e-9)


@given(arrays(int, (8, 3), elements=st.integers(0, 6)))
def test_alpha_equals_the_krippendorff_package(counts: np.ndarray) -> None:
    counts = counts[counts.sum(axis=1) >= 2]
    if len(counts) == 0 or (counts.sum(axis=0) > 0).sum() < 2:
        assert len(counts) == 0 or krippendorff_alpha(counts) is None
        return
    wanted = krippendorff.alpha(value_counts=counts, level_of_measurement="nominal")
    assert krippendorff_alpha(counts) == pytest.approx(wanted, abs=1e-9)


@given(arrays(int, (10, 2), elements=st.integers(0, 1)), st.integers(0, 9))
def test_fleiss_and_cohen_equal_statsmodels(pairs: np.ndarray, forced: int) -> None:
    pairs[forced] = (0, 1)
    counts = np.column_stack([(pairs == c).sum(axis=1) for c in (0, 1)])
    assert fleiss_kappa(counts) == pytest.approx(oracle_fleiss(counts), abs=1e-9)
    table = np.array(
        [[((pairs[:, 0] == a) & (pairs[:, 1] == b)).sum() for b in (0, 1)] for a in (0, 1)]
    )
    found = cohen_kappa(pairs[:, 0] == 1, pairs[:, 1] == 1)
    assert found == pytest.approx(cohens_kappa(table, return_results=False), abs=1e-9)


def test_ac1_stays_high_where_alpha_collapses() -> None:
    counts = np.array([[10, 0]] * 19 + [[8, 2]])
    assert krippendorff_alpha(counts) < 0.15
    # by hand: agreement (19 + 29/45) / 20, chance 2 * 0.01 * 0.99
    agreement, chance = (19 + 29 / 45) / 20, 2 * 0.01 * 0.99
    assert gwet_ac1(counts) == pytest.approx((agreement - chance) / (1 - chance))


def test_noise_ceiling_inverts_the_error_rate() -> None:
    for error in (0.0, 0.1, 0.3, 0.5):
        agreement = error**2 + (1 - error) ** 2
        assert noise_ceiling(agreement) == pytest.approx(1 - error)
    assert noise_ceiling(0.3) == 0.5


def test_repeats_are_compared_with_their_first_answers_across_sides(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rows = []
    for person in range(6):
        for trial in range(1, 5):
            rows.append(
                make_row(
                    participant=f"P{person}",
                    trial_index=trial,
                    won=trial % 2 == 0,
                    motion=f"m{trial}",
                )
            )
        for trial in (1, 2):  # the first changes its answer, the second keeps it on the other side
            rows.append(make_row(participant=f"P{person}", trial_index=10 + trial, repeat_of=trial,
                                 trial_kind="repeat", target_first=False, motion=f"m{trial}"))  # fmt: skip
    read = read_responses(make_answers(tmp_path / "r.csv", rows))
    found = within_participants(read, np.ones(6, dtype=bool), seed=1)
    assert (found["agreement"], found["n"], found["ci"]) == (0.5, 12, [0.5, 0.5])
    none = within_participants(
        read.take(read.equals("trial_kind", "main")), np.ones(6, dtype=bool), seed=1
    )
    assert none["agreement"] is None and "not measurable in this design" in none["why"]

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis import display
from analysis.estimate import estimate
from analysis.preference import comparisons
from analysis.responses import read_responses
from analysis.tables import terminal_table


def test_the_only_counts_that_fit_print_the_papers_table(paper_answers: Path) -> None:
    results = estimate(paper_answers)
    printed = {
        name: (row["display"]["baseline_rate"], row["display"]["rate"], row["k"], row["n"])
        for name, row in results["baselines"].items()
    }
    assert printed == {
        "POSA-T": ("32.1", "67.9", 570, 840),
        "Motion Synthesis": ("18.8", "81.2", 682, 840),
        "PAAK": ("40.7", "59.3", 498, 840),
    }
    naive = {name: row["display"]["ci_naive"] for name, row in results["baselines"].items()}
    assert naive == {"POSA-T": "64.6–70.9", "Motion Synthesis": "78.4–83.7", "PAAK": "55.9–62.6"}


def test_both_shares_of_a_row_are_rounded_half_up_on_exact_fractions() -> None:
    assert display.percent(Fraction(1, 8), 0) == "13"
    assert (
        display.percent(Fraction(1, 2000)) == "0.1"
    )  # 0.05 %: a binary float would say 0.1 or 0.0
    assert display.percent(Fraction(5, 1000), 0) == "1"
    assert display.percent(Fraction(158, 840)) == "18.8"
    assert display.fixed(-0.125) == "−0.13"


@given(st.integers(1, 5000), st.data())
def test_percentages_are_within_half_a_digit_of_the_fraction(n: int, data: st.DataObject) -> None:
    k = data.draw(st.integers(0, n))
    shown = Fraction(display.percent(Fraction(k, n)))
    assert -Fraction(1, 20) < shown - Fraction(100 * k, n) <= Fraction(1, 20)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.5, "0.500"),
        (0.04999, "0.050"),
        (0.0099, "0.0099"),
        (0.00034, "0.00034"),
        (1e-9, "<0.0001"),
    ],
)
def test_p_values_are_shown_for_reading(value: float, shown: str) -> None:
    assert display.p_value(value) == shown


def test_the_answer_is_oriented_by_the_target_not_by_the_side(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rows = [
        make_row(trial_index=i, won=i % 3 > 0, target_first=i % 2 == 0, motion=f"m{i}")
        for i in range(1, 13)
    ]
    found = comparisons(read_responses(make_answers(tmp_path / "r.csv", rows)))
    assert [c.name for c in found] == ["PAAK"]
    assert int(found[0].cells.wins.sum()) == 8


def test_a_pair_asked_in_both_directions_is_one_row(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rows = [
        make_row(trial_index=1, target="B", baseline="A", won=True),
        make_row(trial_index=2, target="A", baseline="B", won=True),
        make_row(trial_index=3, target="A", baseline="C", won=False),
    ]
    found = comparisons(read_responses(make_answers(tmp_path / "r.csv", rows)))
    assert [c.name for c in found] == ["A vs B", "A vs C"]
    assert found[0].won.tolist() == [False, True]


def test_the_terminal_table_fits_100_columns_and_is_watermarked(
    tmp_path: Path, make_answers: Callable, make_study: Callable
) -> None:
    rows = make_study({"PAAK": 60, "a method with a long name, longer still": 90}, participants=6,
                      mode="simulated")  # fmt: skip
    text = terminal_table(estimate(make_answers(tmp_path / "r.csv", rows)))
    assert max(map(len, text.splitlines())) <= 100
    assert "[SIMULATED · NOT FROZEN]" in text.splitlines()[0]
    assert "only 6 clusters" in text and "assumes independent answers" in text

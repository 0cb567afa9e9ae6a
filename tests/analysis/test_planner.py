from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from analysis.cli import plan as command
from analysis.planner import (
    Plan,
    check_plan,
    forecast,
    independent_answers,
    rater_design_effect,
    simulate_cells,
)
from renderer.files import InputError


@pytest.mark.shared
def test_independent_answers_equal_r_pwr(shared_data: Path) -> None:
    # R: pwr.p.test(h = ES.h(rate, .5), power = .8 and .9)
    expected = json.loads((shared_data / "analysis" / "expected.json").read_text())
    for key, wanted in expected.items():
        if key.startswith("pwr_n80_"):
            rate = float(key.removeprefix("pwr_n80_"))
            assert [independent_answers(rate, power) for power in (0.8, 0.9)] == wanted


@pytest.mark.parametrize(
    ("sd", "effect"), [(0.3, 1.41), (0.5, 2.06), (0.8, 3.35), (1.0, 4.30), (0.0, 1.0)]
)
def test_design_effects_of_raters_are_the_integrals(sd: float, effect: float) -> None:
    assert rater_design_effect(20, sd) == pytest.approx(effect, abs=0.006)


def test_simulated_answers_have_the_planned_shape_and_rate() -> None:
    rng = np.random.default_rng(0)
    fixed = simulate_cells(Plan((0.6,), answers=20, pool=20), 0.0, np.zeros(500), rng)
    assert (fixed.participants, fixed.stimuli, int(fixed.answers.sum())) == (500, 20, 10_000)
    pool = simulate_cells(
        Plan((0.6,), answers=20, pool=400, sd_stimulus=0), 0.5, np.zeros(500), rng
    )
    assert pool.stimuli == 400 and set(np.bincount(pool.participant)) == {20}
    share = pool.wins.sum() / pool.answers.sum()
    assert share == pytest.approx(1 / (1 + np.exp(-0.5)), abs=0.02)


def test_power_grows_with_participants_and_a_pool_narrows_the_interval() -> None:
    few, many = (forecast(Plan((0.593,), n), 60, seed=1) for n in (12, 80))
    assert few.power[0] < many.power[0] and few.width[0] > many.width[0]
    pool = forecast(Plan((0.593,), 42, pool=200), 60, seed=1)
    fixed = forecast(Plan((0.593,), 42), 60, seed=1)
    assert pool.width[0] < 0.85 * fixed.width[0]
    assert forecast(Plan((0.593,), 42), 60, seed=1) == fixed


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"rates": (1.2,)}, "rate"), ({"pool": 3}, "pool"), ({"dropout": 1.0}, "dropout"),
        ({"participants": 1}, "participants"), ({"sd_stimulus": float("nan")}, "sd_stimulus"),
        ({"sd_participant": float("inf")}, "sd_participant"),
    ],
)  # fmt: skip
def test_an_impossible_plan_names_its_field(changes: dict, field: str) -> None:
    with pytest.raises(InputError, match=f"plan: {field}: "):
        check_plan(Plan(**({"rates": (0.6,)} | changes)))


def test_the_command_prints_a_curve_or_json() -> None:
    arguments = ["--rate", "0.7", "--participants", "10", "--participants", "30", "--runs", "20"]
    shown = CliRunner().invoke(command, arguments)
    assert shown.exit_code == 0 and "naive coverage" in shown.output
    answer = json.loads(CliRunner().invoke(command, [*arguments, "--json"]).output)
    assert [one["participants"] for one in answer["curve"]] == [10, 30]
    assert CliRunner().invoke(command, ["--rate", "seven"]).exit_code == 2


@pytest.mark.parametrize(("pool", "headline"), [(20, 0.92), (400, 0.91)])
def test_the_headline_interval_covers_and_the_naive_one_does_not(
    pool: int, headline: float
) -> None:
    """42 raters x 20 answers, SD 0.5 / 0.5, 400 seeded runs; the naive bound is for fixed clips."""
    found = forecast(Plan((0.593,), 42, 20, pool), 400, seed=20260101)
    assert found.coverage[0] >= headline
    assert pool == 400 or found.coverage_naive[0] <= 0.80

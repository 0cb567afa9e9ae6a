"""How many participants, and which clips? Power and interval width by simulation.

Answers are drawn from the crossed logistic model and analysed by the very estimator that the report
uses, so that the plan and the analysis make the same assumptions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy import optimize, special, stats

from analysis.binomial import holm, wilson
from analysis.cells import Cells, count_cells
from analysis.clustered import clustered_rate
from analysis.glmm import marginal_rate
from renderer.files import InputError

LARGEST_SD = 5.0
"""Beyond this spread (log odds) nearly everyone always answers the same."""


@dataclass(frozen=True)
class Plan:
    """A study to be simulated. Standard deviations are on the logit scale."""

    rates: tuple[float, ...]
    """True rate of each comparison, averaged over participants and stimuli."""
    participants: int = 42
    answers: int = 20
    """Main trials of one participant per comparison."""
    pool: int = 20
    """Stimuli per comparison; equal to `answers`: everybody sees the same, larger: drawn per participant."""
    sd_participant: float = 0.5
    sd_stimulus: float = 0.5
    dropout: float = 0.0
    """Share of the participants who leave or are excluded."""
    level: float = 0.95


@dataclass(frozen=True)
class Forecast:
    """What repeated simulated studies of one plan did."""

    participants: int
    power: tuple[float, ...]
    """Share of studies in which the Holm-adjusted p falls below 1 - level, per comparison."""
    width: tuple[float, ...]
    """Mean width of the headline interval in percentage points, per comparison."""
    coverage: tuple[float, ...]
    """Share of studies whose headline interval holds the true rate."""
    coverage_naive: tuple[float, ...]
    """The same for the interval that assumes independent answers."""
    runs: int


def check_plan(plan: Plan, source: object = "plan") -> None:
    """Refuse a plan that cannot be simulated, naming the field."""
    for rate in plan.rates:
        if not 0 < rate < 1:
            raise InputError(source, "rate", rate, "a share between 0 and 1")
    if plan.pool < plan.answers:
        raise InputError(source, "pool", plan.pool, f"at least the {plan.answers} answers")
    if not 0 <= plan.dropout < 1:
        raise InputError(source, "dropout", plan.dropout, "a share from 0 to below 1")
    for name in ("sd_participant", "sd_stimulus"):
        if not 0 <= getattr(plan, name) <= LARGEST_SD:
            raise InputError(
                source, name, getattr(plan, name), f"a number from 0 to {LARGEST_SD:g}"
            )
    for name in ("participants", "answers"):
        if getattr(plan, name) < 2:
            raise InputError(source, name, getattr(plan, name), "at least 2")


def forecast(plan: Plan, runs: int, seed: int) -> Forecast:
    """Simulate `runs` studies; the standard error of a share is about sqrt(share (1 - share) / runs)."""
    check_plan(plan)
    rng = np.random.default_rng(seed)
    logits = [_centre(rate, plan.sd_participant, plan.sd_stimulus) for rate in plan.rates]
    outcomes = np.array([_one_study(plan, logits, rng) for _ in range(runs)])
    means = outcomes.mean(axis=0)
    power, width, coverage, naive = (tuple(float(v) for v in column) for column in means.T)
    return Forecast(plan.participants, power, width, coverage, naive, runs)


def curve(plan: Plan, participants: list[int], runs: int, seed: int) -> list[Forecast]:
    """Forecasts for several numbers of participants, the plan otherwise unchanged."""
    return [forecast(replace(plan, participants=count), runs, seed) for count in participants]


def independent_answers(rate: float, power: float, level: float = 0.95) -> int:
    """Answers for a two-sided test of a share against one half, if all were independent.

    Arcsine approximation with Cohen's h; equals R's `pwr.p.test`. The floor no real study reaches.
    """
    h = abs(2 * math.asin(math.sqrt(rate)) - math.pi / 2)

    def shortfall(n: float) -> float:
        z = float(stats.norm.ppf(0.5 + level / 2))
        reach = math.sqrt(n) * h
        return float(stats.norm.sf(z - reach) + stats.norm.cdf(-z - reach)) - power

    return math.ceil(optimize.brentq(shortfall, 2, 1e9))


def rater_design_effect(answers: int, sd_participant: float, rate: float = 0.5) -> float:
    """1 + (answers - 1) ICC from participants alone; ICC of the binary answers by integration."""
    centre = _centre(rate, sd_participant, 0.0)
    nodes, weights = np.polynomial.hermite_e.hermegauss(61)
    p = special.expit(centre + sd_participant * nodes)
    mean = float(weights @ p / weights.sum())
    between = float(weights @ (p - mean) ** 2 / weights.sum())
    return 1 + (answers - 1) * between / (mean * (1 - mean))


def simulate_cells(
    plan: Plan, logit: float, people: Float[np.ndarray, "P"], rng: np.random.Generator
) -> Cells:
    """One comparison's answers; `people` holds the participants' intercepts."""
    stimuli = (
        rng.normal(0, plan.sd_stimulus, plan.pool) if plan.sd_stimulus else np.zeros(plan.pool)
    )
    count = len(people)
    if plan.pool == plan.answers:
        shown = np.tile(np.arange(plan.pool), (count, 1))
    else:
        shown = np.argsort(rng.random((count, plan.pool)), axis=1)[:, : plan.answers]
    who = np.repeat(np.arange(count), plan.answers)
    eta = logit + people[who] + stimuli[shown.ravel()]
    return count_cells(who, shown.ravel(), rng.random(len(who)) < special.expit(eta))


def plan_table(plan: Plan, forecasts: list[Forecast]) -> str:
    """The forecasts as plain text."""
    many = len(plan.rates)
    design = "fixed clips" if plan.pool == plan.answers else f"pool of {plan.pool} clips"
    lines = [
        f"{many} comparison{'s' if many > 1 else ''}, {plan.answers} answers each, {design}, SD "
        "of participants "
        f"{plan.sd_participant:g}, of stimuli {plan.sd_stimulus:g}, dropout {plan.dropout:.0%}",
        "participants    rate   power   width (points)   coverage   naive coverage",
    ]
    for one in forecasts:
        lines += [
            f"{one.participants:>12}   {rate:>5.1%}   {one.power[i]:>5.0%}   {one.width[i]:>14.1f}   "
            f"{one.coverage[i]:>8.1%}   {one.coverage_naive[i]:>14.1%}"
            for i, rate in enumerate(plan.rates)
        ]
    lines.append(
        f"{forecasts[0].runs} simulated studies a row; power after Holm over all comparisons."
    )
    return "\n".join(lines)


def _one_study(plan: Plan, logits: list[float], rng: np.random.Generator) -> list[list[float]]:
    stay = max(2, round(plan.participants * (1 - plan.dropout)))
    people = rng.normal(0, plan.sd_participant, stay) if plan.sd_participant else np.zeros(stay)
    rows: list[Any] = []
    for logit in logits:
        cells = simulate_cells(plan, logit, people, rng)
        wins, answers = int(cells.wins.sum()), int(cells.answers.sum())
        rows.append((clustered_rate(cells, plan.level), wilson(wins, answers, plan.level)))
    adjusted = holm([rate.p for rate, _ in rows])
    return [
        [
            float(p < 1 - plan.level), 100 * (rate.ci[1] - rate.ci[0]),
            float(rate.ci[0] <= true <= rate.ci[1]), float(naive[0] <= true <= naive[1]),
        ]
        for (rate, naive), p, true in zip(rows, adjusted, plan.rates, strict=True)
    ]  # fmt: skip


def _centre(rate: float, sd_participant: float, sd_stimulus: float) -> float:
    """The logit whose rate, averaged over both effects, is `rate`."""
    variance = sd_participant**2 + sd_stimulus**2
    return float(optimize.brentq(lambda x: marginal_rate(x, variance) - rate, -30, 30))

"""A share of independent answers: Wilson and exact intervals, exact test, effect sizes.

These assume that every answer is independent of every other; in a study with several answers per
participant they are printed beside the clustered interval, never instead of it.
"""

from __future__ import annotations

import math

from scipy import stats


def wilson(wins: int, answers: int, level: float = 0.95) -> tuple[float, float]:
    """Score interval of a share (Wilson 1927); equals R's `prop.test(correct = FALSE)`."""
    z = float(stats.norm.ppf(0.5 + level / 2))
    rate, scale = wins / answers, 1 + z * z / answers
    centre = (rate + z * z / (2 * answers)) / scale
    half = z / scale * math.sqrt(rate * (1 - rate) / answers + z * z / (4 * answers**2))
    low, high = max(0.0, centre - half), min(1.0, centre + half)
    return (0.0 if wins == 0 else low, 1.0 if wins == answers else high)


def exact(wins: int, answers: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper-Pearson interval of a share; equals R's `binom.test`."""
    tail = (1 - level) / 2
    low = float(stats.beta.ppf(tail, wins, answers - wins + 1)) if wins else 0.0
    high = float(stats.beta.ppf(1 - tail, wins + 1, answers - wins)) if wins < answers else 1.0
    return low, high


def exact_p(wins: int, answers: int) -> float:
    """Two-sided exact test of a share against one half; equals R's `binom.test(p = 0.5)`."""
    return float(min(1.0, 2 * stats.binom.cdf(min(wins, answers - wins), answers, 0.5)))


def one_sided_exact(trials: int, level: float = 0.95) -> float:
    """Lower bound of a share after `trials` successes in `trials` attempts: (1 - level)^(1 / trials)."""
    return float((1 - level) ** (1 / trials))


def cohen_h(rate: float) -> float:
    """Cohen's h of a share against one half: 2 asin sqrt(rate) - pi / 2."""
    return 2 * math.asin(math.sqrt(rate)) - math.pi / 2


def jod(rate: float) -> float | None:
    """Just-objectionable differences: 1 JOD is a rate of 75 % (Thurstone case V); none at 0 or 1."""
    if not 0 < rate < 1:
        return None
    return float(stats.norm.ppf(rate) / stats.norm.ppf(0.75))


def holm(p_values: list[float]) -> list[float]:
    """Holm's step-down adjustment, in the order given; equals R's `p.adjust(method = "holm")`."""
    adjusted = [0.0] * len(p_values)
    highest = 0.0
    order = sorted(range(len(p_values)), key=p_values.__getitem__)
    for rank, index in enumerate(order):
        highest = max(highest, min(1.0, (len(p_values) - rank) * p_values[index]))
        adjusted[index] = highest
    return adjusted


def benjamini_hochberg(p_values: list[float]) -> list[float]:
    """Benjamini-Hochberg adjustment, in the order given; equals R's `p.adjust(method = "BH")`."""
    adjusted = [0.0] * len(p_values)
    lowest = 1.0
    order = sorted(range(len(p_values)), key=p_values.__getitem__)
    for rank in range(len(order), 0, -1):
        index = order[rank - 1]
        lowest = min(lowest, p_values[index] * len(p_values) / rank)
        adjusted[index] = lowest
    return adjusted

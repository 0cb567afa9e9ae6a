"""Preference rate with a participant x stimulus cluster-robust interval: the headline estimator.

Answers of one participant resemble one another, and so do answers about one stimulus. The variance
of the logit of the rate is therefore estimated from sums over participants, over stimuli and over
both (Cameron, Gelbach, Miller 2011), and the interval uses Student's t with one degree of freedom
less than the smaller number of clusters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy import stats

from analysis.binomial import one_sided_exact
from analysis.cells import Cells

FEW_CLUSTERS = 10


@dataclass(frozen=True)
class ClusteredRate:
    """A preference rate against one half, with what is known of its uncertainty."""

    rate: float
    ci: tuple[float, float]
    p: float
    """Two-sided, against a rate of one half."""
    df: int
    se_logit: float | None
    """Standard error on the logit scale; none where no two-sided interval exists."""
    design_effect: float | None
    """Clustered variance over the variance of independent answers."""
    kind: str
    """`two-sided`, `one-sided` (all or no wins) or `none` (one cluster)."""
    flags: tuple[str, ...] = ()


def clustered_rate(cells: Cells, level: float = 0.95) -> ClusteredRate:
    """Rate of wins with its two-way clustered interval; always finite, oddities are flagged."""
    wins, answers = int(cells.wins.sum()), int(cells.answers.sum())
    smaller = min(cells.participants, cells.stimuli)
    if smaller == 1:
        return _one_cluster(wins / answers, cells)
    if wins in (0, answers):
        return _all_or_none(wins > 0, smaller, level)
    variance, flags = _usable_variance(cells)
    se, df = math.sqrt(variance), smaller - 1
    centre = math.log(wins / (answers - wins))
    half = float(stats.t.ppf(0.5 + level / 2, df)) * se
    naive = answers / (wins * (answers - wins))
    if smaller < FEW_CLUSTERS:
        flags += (few_clusters(smaller),)
    return ClusteredRate(
        rate=wins / answers, ci=(_expit(centre - half), _expit(centre + half)),
        p=float(2 * stats.t.sf(abs(centre) / se, df)), df=df, se_logit=se,
        design_effect=variance / naive, kind="two-sided", flags=flags,
    )  # fmt: skip


def logit_variance(cells: Cells) -> tuple[float, float, float, float]:
    """Variance of logit(rate): two-way, by participant, by stimulus, by their intersection.

    Sandwich of the intercept-only logistic model with the small-sample factor G / (G - 1) per
    clustering (CR1). The two-way value is max(V_p + V_s - V_ps, V_p, V_s), because the sum can
    fall below its parts or below zero. Equals statsmodels' GLM with `cov_type="cluster"`.
    """
    by_person = _one_way(cells, cells.participant)
    by_stimulus = _one_way(cells, cells.stimulus)
    by_both = _one_way(cells, np.arange(len(cells.wins)))
    two_way = max(by_person + by_stimulus - by_both, by_person, by_stimulus)
    return two_way, by_person, by_stimulus, by_both


def participant_interval(cells: Cells, level: float = 0.95) -> tuple[float, float] | None:
    """Interval clustered by participant only; none where it cannot be estimated."""
    wins, answers = int(cells.wins.sum()), int(cells.answers.sum())
    if cells.participants == 1 or wins in (0, answers):
        return None
    half = math.sqrt(_one_way(cells, cells.participant))
    half *= float(stats.t.ppf(0.5 + level / 2, cells.participants - 1))
    centre = math.log(wins / (answers - wins))
    return _expit(centre - half), _expit(centre + half)


def intraclass_correlation(
    groups: Int[np.ndarray, "C"], wins: Int[np.ndarray, "C"], answers: Int[np.ndarray, "C"]
) -> float | None:
    """One-way analysis-of-variance estimate of the share of variance between groups, in [-1, 1]."""
    n = np.bincount(groups, answers)
    k = np.bincount(groups, wins)
    total, count = n.sum(), len(n)
    if count < 2 or total == count or k.sum() in (0, total):
        return None
    rate = k.sum() / total
    between = (n * (k / n - rate) ** 2).sum() / (count - 1)
    within = (k * (1 - k / n)).sum() / (total - count)
    size = (total - (n**2).sum() / total) / (count - 1)
    return float((between - within) / (between + (size - 1) * within))


def few_clusters(count: int) -> str:
    """The loud line for intervals that rest on few clusters."""
    return f"only {count} clusters: the interval is unreliable below {FEW_CLUSTERS}"


def _one_way(cells: Cells, groups: Int[np.ndarray, "C"]) -> float:
    wins, answers = cells.wins.sum(), cells.answers.sum()
    rate = wins / answers
    sums: Float[np.ndarray, "G"] = np.bincount(groups, cells.wins - rate * cells.answers)
    count = len(sums)
    return float(count / (count - 1) * (sums**2).sum() / (answers * rate * (1 - rate)) ** 2)


def _usable_variance(cells: Cells) -> tuple[float, tuple[str, ...]]:
    variance = logit_variance(cells)[0]
    if variance > 1e-12:
        return variance, ()
    wins, answers = int(cells.wins.sum()), int(cells.answers.sum())
    flag = "clusters do not differ at all: the variance of independent answers is used"
    return answers / (wins * (answers - wins)), (flag,)


def _one_cluster(rate: float, cells: Cells) -> ClusteredRate:
    what = "participant" if cells.participants == 1 else "stimulus"
    flag = f"one {what} only: nothing can be said of others, the interval is empty of information"
    return ClusteredRate(rate, (0.0, 1.0), 1.0, 0, None, None, "none", (flag,))


def _all_or_none(all_wins: bool, clusters: int, level: float) -> ClusteredRate:
    """Exact one-sided bound that counts every cluster once.

    A cluster that only holds wins is at most as likely as a single win, so a lower bound for
    clusters is a (conservative) lower bound for the rate, whatever the dependence within them.
    """
    bound = one_sided_exact(clusters, level)
    word, ci = ("all", (bound, 1.0)) if all_wins else ("no", (0.0, 1 - bound))
    flag = f"{word} answers are wins: exact one-sided interval, each of {clusters} clusters once"
    flags = (flag, few_clusters(clusters)) if clusters < FEW_CLUSTERS else (flag,)
    p = min(1.0, 2 * 0.5**clusters)
    return ClusteredRate(float(all_wins), ci, p, clusters - 1, None, None, "one-sided", flags)


def _expit(value: float) -> float:
    return 1 / (1 + math.exp(-value)) if value >= 0 else math.exp(value) / (1 + math.exp(value))

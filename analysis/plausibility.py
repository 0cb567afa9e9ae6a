"""Do the metrics predict preference? Differences of a pair's plausibility scores against its answers.

The orientation is the target's: delta = score of the target's clip - score of the baseline's clip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import stats

from analysis.cells import count_cells
from analysis.clustered import clustered_rate
from analysis.preference import Comparison
from renderer.catalogue import Catalogue

ROUNDING = 1e-9
"""Differences of scores below this are rounding, not differences."""


@dataclass(frozen=True)
class Linked:
    """All answers of all comparisons beside the score differences of their stimuli."""

    won: Bool[np.ndarray, "N"]
    participant: Int[np.ndarray, "N"]
    item: Int[np.ndarray, "N"]
    """(comparison, stimulus) of the answer: what the participant saw."""
    stimulus: Int[np.ndarray, "N"]
    """Scene and motion, the cluster of every estimator; several comparisons share one."""
    comparison: Int[np.ndarray, "N"]
    deltas: dict[str, Float[np.ndarray, "I"]]
    """Per metric, the difference of every item; not-a-number where a clip lacks the score."""


def link_metrics(linked: Linked, level: float, ceiling: dict[str, Any]) -> dict[str, Any]:
    """Per metric: logistic slope, rank correlation, share of choices predicted; or why not."""
    return {
        "ceiling": ceiling,
        "metrics": {
            name: _one_metric(linked, delta, level) for name, delta in linked.deltas.items()
        },
    }


def split_ceiling(linked: Linked) -> dict[str, Any]:
    """Share of answers that agree with the majority of the other participants on the same item.

    No score of the stimulus alone can be expected to predict individual answers much better.
    """
    wins = np.bincount(linked.item, linked.won)
    answers = np.bincount(linked.item)
    others = wins[linked.item] - linked.won
    count = answers[linked.item] - 1
    decided = (count > 0) & (2 * others != count)
    if not decided.any():
        return {"share": None, "n": 0, "kind": "majority of the others"}
    agree = (2 * others > count) == linked.won
    share = float(agree[decided].mean())
    return {"share": share, "n": int(decided.sum()), "kind": "majority of the others"}


def link(
    found: list[Comparison], participants: Int[np.ndarray, "N"], stimuli: Int[np.ndarray, "N"],
    names: dict[int, tuple[str, str]], catalogue: Catalogue,
) -> Linked:  # fmt: skip
    """Join answers to the catalogue; `names` gives scene and motion of every stimulus code."""
    clips = {(c.method, c.scene, c.motion): c.scores for c in catalogue.main_clips()}
    metrics = sorted({name for scores in clips.values() for name in scores})
    parts: list[tuple[np.ndarray, ...]] = []
    deltas: dict[str, list[float]] = {name: [] for name in metrics}
    items = 0
    for number, one in enumerate(found):
        used, local = np.unique(stimuli[one.rows], return_inverse=True)
        for code in used:
            target, baseline = (
                clips.get((method, *names[int(code)]), {}) for method in (one.target, one.baseline)
            )
            for name in metrics:
                both = target.get(name, np.nan) - baseline.get(name, np.nan)
                deltas[name].append(float(both))
        parts.append(
            (one.won, participants[one.rows], local + items, stimuli[one.rows],
             np.full(len(one.won), number))
        )  # fmt: skip
        items += len(used)
    won, people, item, stimulus, comparison = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    return Linked(
        won, people, item, stimulus, comparison,
        {name: np.array(value) for name, value in deltas.items()},
    )  # fmt: skip


def clustered_slope(
    x: Float[np.ndarray, "N"], won: Bool[np.ndarray, "N"], groups: Int[np.ndarray, "N"],
    clusters: tuple[Int[np.ndarray, "N"], Int[np.ndarray, "N"]],
) -> tuple[float, float] | None:  # fmt: skip
    """Slope of a logistic model with one intercept per group, and its two-way clustered error (CR1).

    None when Newton's method does not settle (separation).
    """
    used = np.unique(groups, return_inverse=True)[1]
    design = np.column_stack([x, np.eye(int(used.max()) + 1)[used]])
    beta = np.zeros(design.shape[1])
    for _ in range(50):
        rate = 0.5 * (1 + np.tanh(design @ beta / 2))
        information = (design.T * (rate * (1 - rate))) @ design
        if np.linalg.cond(information) > 1e12:
            return None
        step = np.linalg.solve(information, design.T @ (won - rate))
        beta += step
        if np.abs(step).max() < 1e-10:
            break
    else:
        return None
    bread = np.linalg.inv(information)
    scores = design * (won - rate)[:, None]
    both = np.unique(clusters[0].astype(np.int64) * (int(clusters[1].max()) + 1) + clusters[1],
                     return_inverse=True)[1]  # fmt: skip
    one, two, cell = (_sandwich(scores, ids, bread) for ids in (*clusters, both))
    return float(beta[0]), float(np.sqrt(max(one + two - cell, one, two)))


def _sandwich(
    scores: Float[np.ndarray, "N Q"], ids: Int[np.ndarray, "N"], bread: Float[np.ndarray, "Q Q"]
) -> float:
    ids = np.unique(ids, return_inverse=True)[1]
    count = int(ids.max()) + 1
    sums = np.column_stack([np.bincount(ids, column, count) for column in scores.T])
    factor = count / (count - 1) if count > 1 else 1.0
    return float(factor * (bread @ (sums.T @ sums) @ bread)[0, 0])


def _one_metric(linked: Linked, delta: Float[np.ndarray, "I"], level: float) -> dict[str, Any]:
    known = ~np.isnan(delta)
    record: dict[str, Any] = {
        "items": int(known.sum()), "slope_per_sd": None, "ci": None, "p": None, "kendall": None,
        "p_kendall": None, "predicted": None, "predicted_ci": None, "ties": 0, "why": "",
    }  # fmt: skip
    if known.sum() < 3:
        return record | {"why": "fewer than 3 stimuli with this score for both methods"}
    record |= {"min": float(delta[known].min()), "max": float(delta[known].max())}
    if np.ptp(delta[known]) < ROUNDING:
        return record | {"why": "the difference is the same for all pairs"}
    rows = known[linked.item]
    item, won, people = linked.item[rows], linked.won[rows], linked.participant[rows]
    if won.all() or not won.any():
        return record | {"why": "all answers are the same"}
    stimulus = linked.stimulus[rows]
    clusters = min(len(np.unique(people)), len(np.unique(stimulus)))
    record["clusters"] = clusters
    x = delta[item] / delta[known].std()
    slope = clustered_slope(x, won, linked.comparison[rows], (people, stimulus))
    if slope is not None:
        df = clusters - 1
        half = float(stats.t.ppf(0.5 + level / 2, max(df, 1))) * slope[1]
        p = float(2 * stats.t.sf(abs(slope[0]) / slope[1], max(df, 1))) if slope[1] > 0 else 1.0
        record |= {"slope_per_sd": slope[0], "p": p, "ci": [slope[0] - half, slope[0] + half]}
    used = np.unique(item)
    rates = (np.bincount(item, won) / np.maximum(np.bincount(item), 1))[used]
    if np.ptp(rates) > 0:
        tau = stats.kendalltau(delta[used], rates)
        record |= {"kendall": float(tau.statistic), "p_kendall": float(tau.pvalue)}
    return record | _predicted(delta[item], won, people, stimulus, level)


def _predicted(
    delta: Float[np.ndarray, "N"], won: Bool[np.ndarray, "N"], people: Int[np.ndarray, "N"],
    stimulus: Int[np.ndarray, "N"], level: float,
) -> dict[str, Any]:  # fmt: skip
    """Share of answers that chose the clip with the higher value; ties are counted, not scored."""
    decided = np.abs(delta) > ROUNDING
    ties = int((~decided).sum())
    if not decided.any():
        return {"ties": ties}
    hit = (delta > 0)[decided] == won[decided]
    rate = clustered_rate(count_cells(people[decided], stimulus[decided], hit), level)
    return {"ties": ties, "predicted": rate.rate, "predicted_ci": list(rate.ci)}

"""The comparison of methods: means, paired differences with intervals, classes of motion, ablations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from experiments.bootstrap import clustered_mean_interval
from experiments.methods import METHODS
from experiments.motion_class import CLASSES

Row = dict[str, Any]
"""A placement record: scene, motion, method, scores, failure, motion_class, n_frames, info."""

REFERENCES = {"paper": "pace", "ablation": "pace", "plus": "pace_plus"}
"""Which method the others of a block are compared with: those it shares its scene terms with."""
PUBLISHED: dict[str, dict[str, float]] = {
    "posa_t": {"non_collision": 0.983, "contact": 0.733},
    "paak": {"non_collision": 0.986, "contact": 0.784},
    "pace": {"non_collision": 0.996, "contact": 0.929},
    "pace_no_pose": {"non_collision": 0.995, "contact": 0.610},
    "pace_no_motion": {"non_collision": 1.000, "contact": 0.340},
}
"""Table 2 of PACE (Mullen and Manocha 2023): 100 motions in the four PROX test scenes, SMPL-X."""
POOLED = ("non_collision", "contact")


def compare(rows: Sequence[Row], methods: Iterable[str], seed: int) -> dict[str, dict[str, Any]]:
    """Per method: its means over clips, and everything that a table says beside them.

    `rows` hold the (scene, motion) that were kept, see `kept_rows`. Intervals are 95 % percentile
    bootstrap over motions, of a method's mean and of its paired difference to its reference.
    """
    named = list(methods)
    return {name: _describe(name, rows, named, seed) for name in named}


def kept_rows(rows: Sequence[Row]) -> list[Row]:
    """Rows of the (scene, motion) that every study method placed.

    As in a stimulus set, a case counts for all methods or for none: leaving out single failures
    would flatter the method that fails.
    """
    lost = {_case(row) for row in rows if row["failure"] and row.get("study_method", True)}
    return [row for row in rows if _case(row) not in lost]


def means(rows: Sequence[Row]) -> dict[str, float]:
    """Every score's mean over clips; a score that some clips lack is the mean of the others.

    The jerk ratio is that of the means: clips that are almost still would govern a mean of ratios.
    """
    scored = [row["scores"] for row in rows if not row["failure"]]
    names = sorted({name for scores in scored for name in scores})
    columns = {name: [scores[name] for scores in scored if name in scores] for name in names}
    found = {name: sum(values) / len(values) for name, values in columns.items()}
    if found.get("jerk_before_mm", 0.0) > 0.0:
        found["jerk_ratio"] = 1.0 + found["jerk_change_mm"] / found["jerk_before_mm"]
    return found


def by_class(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """Number of clips and means for each class of motion that occurs."""
    found: dict[str, dict[str, Any]] = {}
    for name in CLASSES:
        own = [row for row in rows if row.get("motion_class") == name and not row["failure"]]
        if own:
            found[name] = {"clips": len(own), **means(own)}
    return found


def pooled(rows: Sequence[Row]) -> dict[str, float]:
    """The strict pair as a mean over all frames of all clips instead of over clips."""
    scored = [row for row in rows if not row["failure"] and "n_frames" in row]
    frames = [row["n_frames"] for row in scored]
    if not scored:
        return {}
    return {
        name: float(np.average([row["scores"][name] for row in scored], weights=frames))
        for name in POOLED
    }


def paired(
    rows: Sequence[Row], method: str, reference: str, seed: int
) -> dict[str, dict[str, float]]:
    """Mean difference, method minus reference, for every score that both have, with its interval.

    Pairs are the (scene, motion) that both placed; motions are what the bootstrap draws.
    """
    own, other = _placed(rows, method), _placed(rows, reference)
    both = sorted(own.keys() & other.keys())
    names = sorted({name for case in both for name in own[case].keys() & other[case].keys()})
    found = {}
    for name in names:
        clusters: dict[str, list[float]] = {}
        for case in both:
            if name in own[case] and name in other[case]:
                difference = own[case][name] - other[case][name]
                clusters.setdefault(case[1], []).append(difference)
        found[name] = _interval(clusters, seed)
    return found


def intervals(rows: Sequence[Row], method: str, seed: int) -> dict[str, dict[str, float]]:
    """Every score's mean with its interval."""
    own = _placed(rows, method)
    found = {}
    for name in sorted({name for scores in own.values() for name in scores}):
        clusters: dict[str, list[float]] = {}
        for (_, motion), scores in sorted(own.items()):
            if name in scores:
                clusters.setdefault(motion, []).append(scores[name])
        found[name] = _interval(clusters, seed)
    return found


def optimiser_states(rows: Sequence[Row]) -> dict[str, int]:
    """How often an ablation's optimiser reached what it must, or failed; empty for other methods."""
    states = (row.get("info", {}).get("optimiser") for row in rows)
    return dict(Counter(state for state in states if state))


def _describe(name: str, rows: Sequence[Row], methods: Sequence[str], seed: int) -> dict[str, Any]:
    own = [row for row in rows if row["method"] == name]
    block = METHODS[name].block
    reference = REFERENCES[block]
    placed = [row for row in own if not row["failure"]]
    compared = reference if reference in methods and reference != name else None
    return {
        "display_name": METHODS[name].display_name,
        "block": block,
        "clips": len(placed),
        "failures": len(own) - len(placed),
        **means(own),
        "interval": intervals(rows, name, seed),
        "reference": compared,
        "difference": paired(rows, name, compared, seed) if compared else {},
        "pooled": pooled(own),
        "by_class": by_class(own),
        "optimiser": optimiser_states(placed),
        "published": PUBLISHED.get(name, {}),
    }


def _interval(clusters: dict[str, list[float]], seed: int) -> dict[str, float]:
    mean, low, high = clustered_mean_interval(clusters, seed)
    bounds = {"low": low, "high": high} if np.isfinite(low) else {}
    cases = sum(len(values) for values in clusters.values())
    return {"mean": mean, **bounds, "clips": cases, "motions": len(clusters)}


def _placed(rows: Sequence[Row], method: str) -> dict[tuple[str, str], dict[str, float]]:
    return {
        _case(row): row["scores"] for row in rows if row["method"] == method and not row["failure"]
    }


def _case(row: Row) -> tuple[str, str]:
    return row["scene"], row["motion"]

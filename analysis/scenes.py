"""Preference per scene and per stimulus. Scenes are fixed: a handful of them stands for no others."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy import special, stats

from analysis.binomial import wilson
from analysis.cells import Cells
from analysis.clustered import clustered_rate
from analysis.glmm import MixedFit


def per_scene(
    cells: Cells, scene: Int[np.ndarray, "S"], labels: list[str], level: float
) -> list[dict[str, Any]]:
    """Rate per scene with its clustered interval; `scene` gives each stimulus' scene."""
    records = []
    for code, label in enumerate(labels):
        inside = scene[cells.stimulus] == code
        if not inside.any():
            continue
        mine = cells.take(inside)
        rate = clustered_rate(mine, level)
        k, n = int(mine.wins.sum()), int(mine.answers.sum())
        records.append({
            "scene": label, "k": k, "n": n, "stimuli": mine.stimuli, "rate": k / n,
            "ci": list(rate.ci), "df": rate.df, "flags": list(rate.flags),
        })  # fmt: skip
    return records


def heterogeneity(cells: Cells, scene: Int[np.ndarray, "S"]) -> dict[str, Any]:
    """Wald test that all scenes share one rate, clustered by participant.

    F with (scenes - 1, participants - 1) degrees of freedom, from the sandwich of the saturated
    scene model; no test when a scene has only wins or no wins, or when participants are too few.
    """
    codes = scene[cells.stimulus]
    used, codes = np.unique(codes, return_inverse=True)
    wins, answers = np.bincount(codes, cells.wins), np.bincount(codes, cells.answers)
    count, people = len(used), cells.participants
    empty: dict[str, Any] = {"f": None, "df1": count - 1, "df2": people - 1, "p": None}
    if count < 2:
        return empty | {"why": "one scene only"}
    if people <= count:
        return empty | {"why": "not more participants than scenes"}
    if ((wins == 0) | (wins == answers)).any():
        return empty | {"why": "a scene with all or no wins"}
    logits = np.log(wins / (answers - wins))
    contrast = np.eye(count)[1:] - np.eye(count)[0]
    spread = contrast @ scene_covariance(cells, codes) @ contrast.T
    if np.linalg.cond(spread) > 1e10:
        return empty | {"why": "participants do not differ"}
    shift = contrast @ logits
    f = float(shift @ np.linalg.solve(spread, shift) / (count - 1))
    return empty | {"f": f, "p": float(stats.f.sf(f, count - 1, people - 1)), "why": ""}


def scene_covariance(cells: Cells, codes: Int[np.ndarray, "C"]) -> Float[np.ndarray, "K K"]:
    """Participant-clustered covariance (CR1) of the scenes' logits; `codes` gives each cell's scene."""
    count, people = int(codes.max()) + 1, cells.participants
    rate = np.bincount(codes, cells.wins) / np.bincount(codes, cells.answers)
    residual = cells.wins - rate[codes] * cells.answers
    sums = np.bincount(cells.participant * count + codes, residual, people * count)
    scores = sums.reshape(people, count) / (np.bincount(codes, cells.answers) * rate * (1 - rate))
    return np.asarray(people / (people - 1) * scores.T @ scores)


def per_stimulus(cells: Cells, labels: list[str], fit: MixedFit | None) -> list[dict[str, Any]]:
    """Raw rate of every stimulus and, with a crossed model, the rate drawn towards the mean by it.

    The pooled rate is that of the typical participant: expit(intercept + conditional mode).
    """
    wins, answers = (
        np.bincount(cells.stimulus, cells.wins),
        np.bincount(cells.stimulus, cells.answers),
    )
    pooled = None
    if fit is not None:
        pooled = special.expit(fit.beta[0] + fit.mode_stimulus)
    records = []
    for index, label in enumerate(labels):
        k, n = int(wins[index]), int(answers[index])
        records.append({
            "stimulus": label, "k": k, "n": n, "rate": k / n, "ci_naive": list(wilson(k, n)),
            "pooled": None if pooled is None else float(pooled[index]),
        })  # fmt: skip
    return records

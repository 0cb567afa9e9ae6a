"""Do participants agree with themselves and with one another?

Agreement between participants is that of the oriented answer (was the target chosen?) on the same
stimulus; agreement within is that of repeated trials with their first answers.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from analysis.cells import Cells
from analysis.exclusions import repeat_pairs
from analysis.responses import Responses


def between_participants(cells: Cells) -> dict[str, Any]:
    """Krippendorff's alpha, Gwet's AC1 and raw agreement over stimuli answered at least twice."""
    wins = np.bincount(cells.stimulus, cells.wins)
    answers = np.bincount(cells.stimulus, cells.answers)
    counts = np.column_stack([wins, answers - wins])[answers >= 2]
    if not len(counts):
        why = "no stimulus was answered twice"
        return {"alpha": None, "ac1": None, "agreement": None, "stimuli": 0, "why": why}
    alpha = krippendorff_alpha(counts)
    return {
        "alpha": alpha, "ac1": gwet_ac1(counts), "agreement": pair_agreement(counts),
        "stimuli": len(counts), "why": "" if alpha is not None else "all answers agree",
    }  # fmt: skip


def krippendorff_alpha(counts: Float[np.ndarray, "U C"]) -> float | None:
    """Nominal alpha from how often each category was named per unit; none without any variation.

    1 - observed / expected disagreement over pairs of values (Krippendorff 2011); units with one
    value hold no pair and are left out. Equals the package `krippendorff`.
    """
    sizes = counts.sum(axis=1)
    counts, sizes = counts[sizes >= 2], sizes[sizes >= 2]
    totals, n = counts.sum(axis=0), counts.sum()
    agreeing = (counts * (counts - 1) / (sizes - 1)[:, None]).sum()
    expected = n * n - (totals**2).sum()
    if expected <= 0:
        return None
    return float(1 - (n - 1) * (n - agreeing) / expected)


def fleiss_kappa(counts: Float[np.ndarray, "U C"]) -> float | None:
    """Fleiss' kappa (1971) for units with equally many values; none without any variation."""
    share = counts.sum(axis=0) / counts.sum()
    chance = float((share**2).sum())
    return None if chance >= 1 else (pair_agreement(counts) - chance) / (1 - chance)


def gwet_ac1(counts: Float[np.ndarray, "U C"]) -> float:
    """Gwet's AC1 (2008): chance agreement sum p (1 - p) / (C - 1), small when one answer dominates."""
    share = (counts / counts.sum(axis=1, keepdims=True)).mean(axis=0)
    chance = float((share * (1 - share)).sum() / (counts.shape[1] - 1))
    return (pair_agreement(counts) - chance) / (1 - chance)


def pair_agreement(counts: Float[np.ndarray, "U C"]) -> float:
    """Share of agreeing pairs of values, mean over units."""
    sizes = counts.sum(axis=1)
    return float(((counts * (counts - 1)).sum(axis=1) / (sizes * (sizes - 1))).mean())


def within_participants(
    responses: Responses, kept: Bool[np.ndarray, "P"], seed: int, replicates: int = 2000
) -> dict[str, Any]:
    """Repeated trials against their first answers: agreement, Cohen's kappa, implied noise ceiling.

    `kept` says which participants are analysed. The interval is a bootstrap over participants.
    """
    originals, repeats = repeat_pairs(responses)
    mine = kept[responses.codes["participant"][repeats]]
    originals, repeats = originals[mine], repeats[mine]
    if not len(repeats):
        why = "the design has no repeated trials: not measurable in this design"
        return {"agreement": None, "n": 0, "why": why}
    target = responses.codes["target"]
    before, after = (
        responses.codes["chosen_method"][rows] == target[rows] for rows in (originals, repeats)
    )
    people = np.unique(responses.codes["participant"][repeats], return_inverse=True)[1]
    agree = np.bincount(people, before == after)
    total = np.bincount(people)
    rates = _bootstrap_share(agree, total, seed, replicates)
    agreement = float(agree.sum() / total.sum())
    return {
        "agreement": agreement, "n": int(total.sum()), "participants": len(total),
        "ci": [float(value) for value in np.percentile(rates, [2.5, 97.5])],
        "kappa": cohen_kappa(before, after), "noise_ceiling": noise_ceiling(agreement), "why": "",
    }  # fmt: skip


def cohen_kappa(before: Bool[np.ndarray, "N"], after: Bool[np.ndarray, "N"]) -> float | None:
    """Cohen's kappa (1960) of two binary codings; none when both are constant and equal."""
    agreement = float((before == after).mean())
    p, q = float(before.mean()), float(after.mean())
    chance = p * q + (1 - p) * (1 - q)
    return None if chance >= 1 else (agreement - chance) / (1 - chance)


def noise_ceiling(agreement: float) -> float:
    """Highest share of answers any rule can predict, if a repeated answer agrees this often.

    With one error rate e for both answers, agreement = e^2 + (1 - e)^2, so the ceiling is
    1 - e = (1 + sqrt(2 agreement - 1)) / 2; at or below chance agreement it is one half.
    """
    return (1 + math.sqrt(max(0.0, 2 * agreement - 1))) / 2


def _bootstrap_share(
    part: Int[np.ndarray, "P"], whole: Int[np.ndarray, "P"], seed: int, replicates: int
) -> Float[np.ndarray, "R"]:
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, len(whole), (replicates, len(whole)))
    return np.asarray(part[drawn].sum(axis=1) / whole[drawn].sum(axis=1))

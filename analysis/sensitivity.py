"""Does the result hang on a rule, a participant, a stimulus or a scene? The full matrix of variants."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from analysis.clustered import clustered_rate
from analysis.exclusions import apply_rules
from analysis.preference import Comparison, comparisons
from analysis.resampling import leave_one_out, swapped
from analysis.responses import Responses
from analysis.rules import Rules
from renderer.files import InputError

Variant = dict[str, Any]


def rule_variants(rules: Rules) -> dict[str, Rules]:
    """No rule, each rule alone, all rules, all but each one; what would repeat is left out."""
    variants: dict[str, Rules] = {"no exclusions": {}}
    if len(rules) > 1:
        variants |= {f"only {name}": {name: value} for name, value in rules.items()}
        variants |= {
            f"all but {name}": {other: value for other, value in rules.items() if other != name}
            for name in rules
        }
    if rules:
        variants["all rules"] = dict(rules)
    return variants


def sensitivity_matrix(
    responses: Responses, rules: Rules, main_trials: int | None, found: list[Comparison],
    scenes: dict[str, tuple[Int[np.ndarray, "S"], list[str]]], level: float,
) -> dict[str, list[Variant]]:  # fmt: skip
    """Per comparison, the rate and headline interval in every variant, with `flips` where it matters.

    `flips` is `sign` when the rate crosses one half, `significance` when the interval gains or loses
    one half, compared with the reported analysis. `found` is the reported analysis.
    """
    matrix: dict[str, list[Variant]] = {one.name: [] for one in found}
    for label, variant in rule_variants(rules).items():
        try:
            kept, _ = apply_rules(responses, variant, main_trials)
        except InputError:  # nothing left under this variant
            continue
        for one in comparisons(kept):
            if one.name in matrix:
                rate = clustered_rate(one.cells, level)
                n = int(one.cells.answers.sum())
                matrix[one.name].append(_variant(label, n, (rate.rate, *rate.ci)))
    for one in found:
        matrix[one.name] += _left_out(one, *scenes[one.name], level)
        reported = clustered_rate(one.cells, level)
        for variant_row in matrix[one.name]:
            variant_row["flips"] = _flip((reported.rate, *reported.ci), variant_row)
    return matrix


def _left_out(
    one: Comparison, scene: Int[np.ndarray, "S"], labels: list[str], level: float
) -> list[Variant]:
    """Extremes without one participant and one stimulus, and every scene left out."""
    total = one.cells.answers
    rows = []
    for word, cells in (("participant", one.cells), ("stimulus", swapped(one.cells))):
        if cells.participants < 2:
            continue
        found = leave_one_out(cells, level)
        sizes = int(total.sum()) - np.bincount(cells.participant, cells.answers).astype(int)
        for end, index in (("lowest", found[:, 0].argmin()), ("highest", found[:, 0].argmax())):
            label = f"without one {word}, {end} of {len(found)}"
            rows.append(_variant(label, int(sizes[index]), found[index]))
        rows[-1]["crossing"] = rows[-2]["crossing"] = _crossing(found)
    for code, label in enumerate(labels):
        keep = scene[one.cells.stimulus] != code
        if keep.any() and not keep.all():
            rate = clustered_rate(one.cells.take(keep), level)
            row = _variant(f"without scene {label}", int(total[keep].sum()), (rate.rate, *rate.ci))
            rows.append(row)
    return rows


def _crossing(found: Float[np.ndarray, "P 3"]) -> int:
    """How many of the leave-one-out intervals hold one half."""
    return int(((found[:, 1] <= 0.5) & (found[:, 2] >= 0.5)).sum())


def _variant(label: str, n: int, bounds: Any) -> Variant:
    rate, low, high = (float(value) for value in bounds)
    return {"variant": label, "n": n, "rate": rate, "ci": [low, high]}


def _flip(reported: tuple[float, float, float], row: Variant) -> str:
    rate, low, high = reported
    if (rate - 0.5) * (row["rate"] - 0.5) < 0:
        return "sign"
    significant = low > 0.5 or high < 0.5
    holds = row["ci"][0] > 0.5 or row["ci"][1] < 0.5
    if "crossing" in row and significant and row["crossing"]:
        return "significance"
    return "" if significant == holds else "significance"

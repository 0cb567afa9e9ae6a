"""The preference table: one row per baseline, everything a reader needs to judge the rate."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Int
from scipy import stats

from analysis import binomial
from analysis.cells import Cells, count_cells
from analysis.clustered import clustered_rate, intraclass_correlation, participant_interval
from analysis.responses import Responses


@dataclass(frozen=True)
class Comparison:
    """All analysed answers of one target against one baseline."""

    name: str
    target: str
    baseline: str
    rows: Int[np.ndarray, "N"]
    """Positions of its answers in the analysed responses."""
    won: Bool[np.ndarray, "N"]
    """Was the target chosen?"""
    cells: Cells = field(repr=False)


@dataclass(frozen=True)
class Preference:
    """One row of the preference table; rates are shares of answers in which the target was chosen."""

    target: str
    baseline: str
    k: int
    n: int
    participants: int
    stimuli: int
    answers_per_stimulus: tuple[int, float, int]
    """Minimum, median, maximum."""
    rate: float
    ci: tuple[float, float]
    """Headline: participant x stimulus cluster-robust, logit scale, Student's t."""
    ci_kind: str
    df: int
    se_logit: float | None
    p: float
    p_holm: float
    ci_naive: tuple[float, float]
    """Wilson; assumes independent answers."""
    ci_exact: tuple[float, float]
    """Clopper-Pearson; assumes independent answers."""
    p_exact: float
    ci_participant: tuple[float, float] | None
    """Clustered by participant only."""
    design_effect: float | None
    icc_participant: float | None
    icc_stimulus: float | None
    odds: float | None
    cohen_h: float
    jod: float | None
    posterior_above_half: float | None
    """Jeffreys posterior on n / design effect answers: probability that the rate exceeds 0.5; approximate."""
    flags: tuple[str, ...]


def comparisons(responses: Responses) -> list[Comparison]:
    """Split analysed main answers into comparisons, sorted by name.

    With one target a comparison is named by its baseline, otherwise `target vs baseline`. A pair
    that occurs in both directions is turned into alphabetical order.
    """
    target, baseline = responses.codes["target"], responses.codes["baseline"]
    methods = responses.labels["target"]
    low, high = np.minimum(target, baseline), np.maximum(target, baseline)
    pair = low.astype(np.int64) * len(methods) + high
    stimulus = stimulus_codes(responses)
    single = len(np.unique(target)) == 1
    found = []
    for key in np.unique(pair):
        rows = np.flatnonzero(pair == key)
        turned = len(np.unique(target[rows])) > 1
        mine = int(low[rows[0]]) if turned else int(target[rows[0]])
        other = int(low[rows[0]] + high[rows[0]] - mine)
        won = responses.codes["chosen_method"][rows] == mine
        cells = count_cells(responses.codes["participant"][rows], stimulus[rows], won)
        name = methods[other] if single else f"{methods[mine]} vs {methods[other]}"
        found.append(Comparison(name, methods[mine], methods[other], rows, won, cells))
    return sorted(found, key=lambda comparison: comparison.name)


def stimulus_codes(responses: Responses) -> Int[np.ndarray, "N"]:
    """Code of `scene|motion`, the stimulus cluster of every estimator."""
    motions = len(responses.labels["motion"])
    return np.asarray(
        responses.codes["scene"].astype(np.int64) * motions + responses.codes["motion"]
    )


def preference_table(found: list[Comparison], level: float = 0.95) -> dict[str, Preference]:
    """Estimate every comparison; p values are adjusted by Holm over all of them."""
    rates = [clustered_rate(comparison.cells, level) for comparison in found]
    adjusted = binomial.holm([rate.p for rate in rates])
    table = {}
    for comparison, rate, p_holm in zip(found, rates, adjusted, strict=True):
        cells = comparison.cells
        k, n = int(cells.wins.sum()), int(cells.answers.sum())
        exposure = np.bincount(cells.stimulus, cells.answers)
        table[comparison.name] = Preference(
            target=comparison.target, baseline=comparison.baseline, k=k, n=n,
            participants=cells.participants, stimuli=cells.stimuli,
            answers_per_stimulus=(
                int(exposure.min()), float(np.median(exposure)), int(exposure.max())
            ),
            rate=k / n, ci=rate.ci, ci_kind=rate.kind, df=rate.df, se_logit=rate.se_logit,
            p=rate.p, p_holm=p_holm, ci_naive=binomial.wilson(k, n, level),
            ci_exact=binomial.exact(k, n, level), p_exact=binomial.exact_p(k, n),
            ci_participant=participant_interval(cells, level), design_effect=rate.design_effect,
            icc_participant=intraclass_correlation(cells.participant, cells.wins, cells.answers),
            icc_stimulus=intraclass_correlation(cells.stimulus, cells.wins, cells.answers),
            odds=k / (n - k) if 0 < k < n else None, cohen_h=binomial.cohen_h(k / n),
            jod=binomial.jod(k / n), posterior_above_half=_posterior(k, n, rate.design_effect),
            flags=rate.flags,
        )  # fmt: skip
    return table


def _posterior(wins: int, answers: int, design_effect: float | None) -> float | None:
    if design_effect is None:
        return None
    scale = 1 / max(1.0, design_effect)
    return float(stats.beta.sf(0.5, 0.5 + wins * scale, 0.5 + (answers - wins) * scale))

"""Quality of the answers: side bias, drift over trials, exposure, response times, viewing evidence."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import stats

from analysis.binomial import benjamini_hochberg
from analysis.cells import count_cells
from analysis.clustered import clustered_rate
from analysis.preference import Comparison, stimulus_codes
from analysis.responses import Responses

FAST_MS = 2000.0


def side_bias(responses: Responses, level: float = 0.95) -> dict[str, Any]:
    """How often the first position was chosen: clustered over all answers, exact per participant."""
    first = responses.equals("chosen_position", "first")
    people = responses.codes["participant"]
    rate = clustered_rate(count_cells(people, stimulus_codes(responses), first), level)
    total = np.bincount(people)
    mine = np.bincount(people, first)[total > 0].astype(int)
    total = total[total > 0]
    smaller = np.minimum(mine, total - mine)
    p = np.minimum(1.0, 2 * stats.binom.cdf(smaller, total, 0.5))
    one_sided = int((np.array(benjamini_hochberg(p.tolist())) < 0.05).sum())
    return {
        "k": int(first.sum()), "n": len(responses), "rate": rate.rate, "ci": list(rate.ci),
        "p": rate.p, "flags": list(rate.flags), "participants_with_bias": one_sided,
        "participants": len(total),
    }  # fmt: skip


def order_drift(
    responses: Responses, won: Bool[np.ndarray, "N"], expected: Float[np.ndarray, "N"]
) -> dict[str, Any]:
    """Does the target rate change from the first to the last third of each participant's trials?

    `expected` is the overall rate of each answer's comparison; it is subtracted, so that comparisons
    asked in blocks look like no drift. Paired t test over participants.
    """
    excess = won - expected
    third = trial_thirds(responses)
    people = responses.codes["participant"]
    count = len(responses.labels["participant"])
    rates, sizes = [], []
    for part in (0, 2):
        inside = third == part
        n = np.bincount(people[inside], minlength=count)
        k = np.bincount(people[inside], excess[inside], minlength=count)
        rates.append(k / np.maximum(n, 1))
        sizes.append(n)
    both = (sizes[0] > 0) & (sizes[1] > 0)
    change = (rates[1] - rates[0])[both]
    record: dict[str, Any] = {
        "participants": int(both.sum()),
        "change": None,
        "ci": None,
        "p": None,
    }
    for name, part in (("first_third", 0), ("last_third", 2)):
        inside = third == part
        record[name] = float(won[inside].mean()) if inside.any() else None
    if len(change) > 1 and np.ptp(change) > 0:
        test = stats.ttest_1samp(change, 0.0)
        interval = test.confidence_interval(0.95)
        record |= {"change": float(change.mean()), "p": float(test.pvalue)}
        record["ci"] = [float(interval.low), float(interval.high)]
    return record


def trial_thirds(responses: Responses) -> Int[np.ndarray, "N"]:
    """0, 1 or 2: the third of the participant's main trials, in the order they were met."""
    people = responses.codes["participant"]
    order = np.lexsort((responses.numbers["trial_index"], people))
    sizes = np.bincount(people, minlength=len(responses.labels["participant"]))
    begin = np.cumsum(sizes) - sizes
    rank = np.zeros(len(responses), dtype=np.int64)
    rank[order] = np.arange(len(responses)) - begin[people[order]]
    return np.asarray(np.minimum(3 * rank // sizes[people], 2))


def exposure(responses: Responses, found: list[Comparison]) -> dict[str, Any]:
    """Per comparison: how evenly stimuli were shown, and how often the target stood first."""
    records = {}
    chosen_first = responses.codes["first_method"] == responses.codes["chosen_method"]
    for one in found:
        answers = np.bincount(one.cells.stimulus, one.cells.answers)
        first = np.where(one.won, chosen_first[one.rows], ~chosen_first[one.rows])
        records[one.name] = {
            "stimuli": len(answers), "min": int(answers.min()), "max": int(answers.max()),
            "median": float(np.median(answers)), "target_first": int(first.sum()),
            "n": len(first), "rate_when_first": _share(one.won[first]),
            "rate_when_second": _share(one.won[~first]),
        }  # fmt: skip
    return records


def response_times(responses: Responses) -> dict[str, Any]:
    """Quartiles of the response and decision times in seconds; `measured` counts the known ones."""
    record: dict[str, Any] = {}
    for name in ("response_time_ms", "decision_time_ms"):
        values = responses.numbers[name]
        known = values[~np.isnan(values)]
        record[name.removesuffix("_ms")] = _quartiles(known / 1000) | {
            "fast_share": _share(known < FAST_MS)
        }
    return record


def viewing(responses: Responses) -> dict[str, Any]:
    """Answers by viewing evidence of both clips, late answers, and how often clips were played."""
    proven, unproven = (
        [responses.equals(f"viewed_{place}", word) for place in ("first", "second")]
        for word in ("proven", "unproven")
    )
    both, lacking = proven[0] & proven[1], unproven[0] | unproven[1]
    plays = np.concatenate([responses.numbers["plays_first"], responses.numbers["plays_second"]])
    known = plays[~np.isnan(plays)]
    return {
        "both_proven": int(both.sum()), "one_unproven": int(lacking.sum()),
        "unknown": int((~both & ~lacking).sum()), "n": len(responses),
        "late": int(responses.equals("late", "true").sum()), "plays_per_clip": _quartiles(known),
    }  # fmt: skip


def _quartiles(values: Float[np.ndarray, "N"]) -> dict[str, Any]:
    if not len(values):
        return {"measured": 0, "q1": None, "median": None, "q3": None}
    q1, median, q3 = np.percentile(values, [25, 50, 75])
    return {"measured": len(values), "q1": float(q1), "median": float(median), "q3": float(q3)}


def _share(flags: Bool[np.ndarray, "N"]) -> float | None:
    return float(flags.mean()) if len(flags) else None

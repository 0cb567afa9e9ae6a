"""Percentile bootstrap of a mean over clustered cases: motions are drawn, not single clips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

RESAMPLES = 9999
LEVEL = 0.95


def clustered_mean_interval(
    values: Mapping[str, Sequence[float]],
    seed: int,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
) -> tuple[float, float, float]:
    """Mean of all cases, and the bounds of its percentile interval (Efron 1979).

    `values` are the cases by cluster. A resample draws as many clusters as there are, with
    replacement, and takes the mean of all their cases: rooms in which the same motion was placed
    do not count as independent. With a single cluster the bounds are nan.
    """
    sums = np.array([float(np.sum(cases)) for cases in values.values()])
    counts = np.array([float(len(cases)) for cases in values.values()])
    mean = float(sums.sum() / counts.sum())
    if len(sums) < 2:
        return mean, float("nan"), float("nan")
    draws = np.random.default_rng(seed).integers(0, len(sums), (resamples, len(sums)))
    means: Float[np.ndarray, " R"] = sums[draws].sum(1) / counts[draws].sum(1)
    low, high = np.percentile(means, [50 * (1 - level), 50 * (1 + level)])
    return mean, float(low), float(high)

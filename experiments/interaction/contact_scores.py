"""Statistics of predicted contact and classes. Axes: N bodies, V vertices, S samples."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Integer


def f1_score(predicted: Bool[np.ndarray, "*N"], true: Bool[np.ndarray, "*N"]) -> float:
    """Harmonic mean of precision and recall over all entries (micro); 0 where both are empty."""
    hits = float((predicted & true).sum())
    return 2 * hits / max(float(predicted.sum() + true.sum()), 1.0)


def intersection_over_union(
    predicted: Bool[np.ndarray, "*N"], true: Bool[np.ndarray, "*N"]
) -> float:
    """Jaccard index over all entries."""
    return float((predicted & true).sum()) / max(float((predicted | true).sum()), 1.0)


def average_precision(score: Float[np.ndarray, "*N"], true: Bool[np.ndarray, "*N"]) -> float:
    """Area under the precision-recall curve as the sum of precision times the step of recall.

    Entries of equal score count as one threshold. Not a number where nothing is true.
    """
    order = np.argsort(-score.ravel(), kind="stable")
    ranked, hits = score.ravel()[order], true.ravel()[order]
    if not hits.any():
        return float("nan")
    ends = np.append(np.flatnonzero(np.diff(ranked)), len(ranked) - 1)
    found = np.cumsum(hits)[ends]
    precision, recall = found / (ends + 1), found / hits.sum()
    return float((precision * np.diff(recall, prepend=0.0)).sum())


def class_accuracy(
    predicted: Integer[np.ndarray, "*N"],
    true: Integer[np.ndarray, "*N"],
    contact: Bool[np.ndarray, "*N"],
) -> float:
    """Top-1 over the vertices truly in contact; `predicted` is the best class that is not void.

    Not a number where nothing is in contact.
    """
    return float((predicted == true)[contact].mean()) if contact.any() else float("nan")


def calibration_error(
    probability: Float[np.ndarray, "*N"], true: Bool[np.ndarray, "*N"], bins: int = 10
) -> float:
    """Expected calibration error (Guo et al. 2017): |share true - mean probability|, by equal bins.

    Every bin counts by its share of the entries.
    """
    flat = probability.ravel().astype(np.float64)
    place = np.minimum((flat * bins).astype(np.int64), bins - 1)
    expected = np.bincount(place, flat, bins)
    found = np.bincount(place, true.ravel().astype(np.float64), bins)
    return float(np.abs(found - expected).sum() / flat.size)


def flicker(contact: Bool[np.ndarray, "N V"], clip: Integer[np.ndarray, " N"],
            frame: Integer[np.ndarray, " N"]) -> float:  # fmt: skip
    """Vertices whose label changes from one frame to the next, mean over consecutive frames."""
    follows = (np.diff(clip) == 0) & (np.diff(frame) == 1)
    changed = (contact[1:] != contact[:-1]).sum(axis=1)
    return float(changed[follows].mean()) if follows.any() else float("nan")


def diversity(samples: Bool[np.ndarray, "S N V"]) -> float:
    """Vertices in which two samples of one body differ, mean over bodies and pairs of samples."""
    count = len(samples)
    chosen = samples.sum(axis=0, dtype=np.int64)
    # Of S (S - 1) / 2 pairs, those that differ at a vertex are one that has it with one that has not.
    differing = (chosen * (count - chosen)).sum(axis=-1) / (count * (count - 1) / 2)
    return float(differing.mean())


def active_units(means: Float[np.ndarray, "N L"], least_variance: float = 0.01) -> int:
    """Latent units whose posterior mean varies over the data (Burda et al. 2016)."""
    return int((means.var(axis=0) > least_variance).sum())

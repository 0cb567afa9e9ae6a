"""Thinning: the frames of a fast motion that are optimised, 30 a second on average."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int64

from experiments.weighting.weights import FrameWeights

AVERAGE_FPS = 30.0
"""Frames per second that are kept on average (PACE, section on frame weighting)."""
FLOOR_FPS = 10.0
"""No two kept frames are further apart than this rate has them (PACE)."""
_SLACK = 1e-6
"""Seconds: time stamps are sums of floats."""


def kept_frames(
    times: Float[np.ndarray, " T"], weights: Float[np.ndarray, " T"]
) -> Int64[np.ndarray, " S"]:
    """Indices of the frames to optimise, increasing; all of them at 30 frames per second or fewer.

    PACE keeps the top quarter of 120 fps clips by weight, and more where the rate would fall below
    10 fps. In full: round(T 30/f) frames, the first, the last and those of highest weight; then in
    every gap longer than 0.1 s the frame of highest weight within its middle third, until there
    is no such gap. Frames of equal weight are taken evenly over the clip. `times` are seconds; a
    gap of the recording itself cannot be filled.
    """
    n_frames = len(times)
    rate = (n_frames - 1) / (times[-1] - times[0])
    if rate <= AVERAGE_FPS * (1 + _SLACK):
        return np.arange(n_frames)
    kept = np.zeros(n_frames, dtype=bool)
    kept[[0, -1]] = True
    order = [frame for frame in _best_first(weights) if not kept[frame]]
    wanted = math.ceil(n_frames * AVERAGE_FPS / rate - _SLACK)
    kept[order[: max(wanted - 2, 0)]] = True
    while _fill_gaps(kept, times, weights):
        pass
    return np.flatnonzero(kept)


def kept_weights(weights: FrameWeights, kept: Int64[np.ndarray, " S"]) -> FrameWeights:
    """The weights of the kept frames, scaled to mean 1 again."""
    values = weights.values[kept]
    return FrameWeights(values / values.mean(), weights.rule)


def _fill_gaps(
    kept: Bool[np.ndarray, " T"],
    times: Float[np.ndarray, " T"],
    weights: Float[np.ndarray, " T"],
) -> bool:
    """Add one frame to every gap that is too long, in place; whether there was any."""
    frames = np.flatnonzero(kept)
    added = False
    for before, after in pairwise(frames):
        gap = times[after] - times[before]
        if gap <= 1.0 / FLOOR_FPS + _SLACK or after - before < 2:
            continue
        inner = np.arange(before + 1, after)
        off_centre = np.abs(times[inner] - (times[before] + times[after]) / 2)
        middle = inner[off_centre <= max(gap / 6, off_centre.min()) + _SLACK]
        kept[middle[int(np.argmax(weights[middle]))]] = True
        added = True
    return added


def _best_first(weights: Float[np.ndarray, " T"]) -> Int64[np.ndarray, " T"]:
    """Frames by falling weight; those of equal weight in an order that spreads over the clip."""
    bits = max(1, (len(weights) - 1).bit_length())
    spread = np.array([int(f"{frame:0{bits}b}"[::-1], 2) for frame in range(len(weights))])
    return np.lexsort((spread, -weights))

"""Analytic two-bone inverse kinematics: thigh and shank, or upper arm and forearm."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from experiments.motion.rotations import shortest_arc, unit


def middle_joint(
    start: Float[np.ndarray, "T 3"],
    target: Float[np.ndarray, "T 3"],
    pole: Float[np.ndarray, "T 3"],
    lengths: tuple[float, float],
    soft_m: float = 0.0,
) -> tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 3"]]:
    """Positions of knee (elbow) and ankle (wrist) when the limb bends towards `pole`.

    The law of cosines. A target out of reach is approached as near as the limb goes; with `soft_m` the
    limb begins to give that much before it is straight, so that the elbow never snaps.
    """
    first, second = lengths
    axis = unit(target - start)
    distance = np.linalg.norm(target - start, axis=-1, keepdims=True)
    distance = np.maximum(_within_reach(distance, first + second, soft_m), 1e-6)
    distance = np.maximum(distance, abs(first - second) * 1.001)
    along = (first**2 - second**2 + distance**2) / (2 * distance)
    aside = np.sqrt(np.maximum(first**2 - along**2, 0.0))
    bend = unit(pole - np.sum(pole * axis, axis=-1, keepdims=True) * axis)
    return np.asarray(start + along * axis + aside * bend), np.asarray(start + distance * axis)


def _within_reach(
    distance: Float[np.ndarray, "T 1"], length: float, soft_m: float
) -> Float[np.ndarray, "T 1"]:
    longest = 0.9995 * length
    if soft_m == 0:
        return np.asarray(np.minimum(distance, longest))
    excess = np.maximum(distance - (longest - soft_m), 0.0)
    return np.asarray(distance - excess + soft_m * (1 - np.exp(-excess / soft_m)))


def move_end(
    start: Float[np.ndarray, "T 3"],
    middle: Float[np.ndarray, "T 3"],
    end: Float[np.ndarray, "T 3"],
    target: Float[np.ndarray, "T 3"],
) -> tuple[Float[np.ndarray, "T 3 3"], Float[np.ndarray, "T 3 3"]]:
    """World rotations to apply to the two bones so that `end` reaches `target`, keeping the bend plane."""
    lengths = tuple(float(np.linalg.norm(b[0] - a[0])) for a, b in ((start, middle), (middle, end)))
    swing = shortest_arc(end - start, target - start)
    pole = (swing @ (middle - (start + end) / 2)[..., None])[..., 0]
    new_middle, new_end = middle_joint(start, target, pole, (lengths[0], lengths[1]))
    first = _turn(swing, middle - start, new_middle - start)
    return first, _turn(swing, end - middle, new_end - new_middle)


def _turn(
    swing: Float[np.ndarray, "T 3 3"], old: Float[np.ndarray, "T 3"], new: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "T 3 3"]:
    swung = (swing @ old[..., None])[..., 0]
    return np.asarray(shortest_arc(swung, new) @ swing)

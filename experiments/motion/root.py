"""Foot-driven root: the body travels as its feet push, for clips that were blended or time-warped."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from experiments.motion.figure import Figure, surface
from experiments.motion.motion import Motion

_SIGMA_FRAMES = 2.5
_HEIGHT_SCALE_M = 0.008


def drive_root(motion: Motion, figure: Figure) -> Motion:
    """Horizontal root velocity = minus the velocity of the ground contact relative to the root, smoothed.

    Unsmoothed, the root would jerk when the weight passes from foot to foot.
    """
    points = surface(figure, motion, np.concatenate(figure.soles)) - motion.transl[:, None]
    slip = contact_velocity(points, motion.fps)[:, :2]
    velocity = -gaussian_filter1d(slip, _SIGMA_FRAMES, axis=0, mode="nearest")
    transl = motion.transl.copy()
    transl[1:, :2] = transl[0, :2] + np.cumsum(velocity[:-1], axis=0) / motion.fps
    return dataclasses.replace(motion, transl=transl)


def contact_velocity(points: Float[np.ndarray, "T P 3"], fps: float) -> Float[np.ndarray, "T 3"]:
    """Mean velocity (m/s) of the points from each frame to the next, the lowest counting most.

    Weights fall by e every 8 mm above the lowest point; the last frame repeats the one before.
    """
    height = points[..., 2]
    middle = (height[1:] + height[:-1]) / 2
    weight = np.exp(-(middle - middle.min(axis=1, keepdims=True)) / _HEIGHT_SCALE_M)
    weight /= weight.sum(axis=1, keepdims=True)
    velocity = np.einsum("tp,tpx->tx", weight, np.diff(points, axis=0)) * fps
    return np.concatenate([velocity, velocity[-1:]])

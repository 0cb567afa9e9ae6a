"""Ground clean-up: the body stands on the floor at z = 0."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float, Integer
from scipy.ndimage import gaussian_filter1d

from experiments.motion.figure import Figure, surface
from experiments.motion.motion import Motion

_SIGMA_FRAMES = 1.5
_EVERY = 8
"""Of the whole skin every eighth vertex tells the lowest point to a few millimetres."""


def ground(motion: Motion, figure: Figure, whole_body: bool = False) -> Motion:
    """Shift the root up or down so that the lowest point rests on the floor in every frame.

    The lowest sole point, or with `whole_body` the lowest of all the skin (lying and rolling).
    The shift is smoothed, so that a flight phase is not pulled down at once.
    """
    ids = figure.body.body_component[::_EVERY] if whole_body else np.concatenate(figure.soles)
    lowest = lowest_height(motion, figure, ids)
    shift = np.zeros_like(motion.transl)
    shift[:, 2] = -gaussian_filter1d(lowest, _SIGMA_FRAMES, mode="nearest")
    return dataclasses.replace(motion, transl=motion.transl + shift)


def lowest_height(
    motion: Motion, figure: Figure, ids: Integer[np.ndarray, " V"]
) -> Float[np.ndarray, " T"]:
    """Height (m) of the lowest of these vertices in every frame."""
    return np.asarray(surface(figure, motion, ids)[..., 2].min(axis=1))

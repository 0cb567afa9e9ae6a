"""Ground clean-up: the body stands on the floor at z = 0."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float, Integer
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from experiments.motion.figure import Figure, surface
from experiments.motion.motion import Motion

_SIGMA_FRAMES = 1.5
_EVERY = 8
"""Of the whole skin every eighth vertex tells the lowest point to a few millimetres."""


def ground(motion: Motion, figure: Figure) -> Motion:
    """Shift the root up or down so that the lowest sole point rests on the floor in every frame.

    The shift is smoothed, so that a flight phase is not pulled down at once.
    """
    lowest = lowest_height(motion, figure, np.concatenate(figure.soles))
    return _raised(motion, -gaussian_filter1d(lowest, _SIGMA_FRAMES, mode="nearest"))


def rest_on_floor(motion: Motion, figure: Figure) -> Motion:
    """The same for lying and rolling: whatever is lowest of all the skin rests on the floor.

    The shift is a smooth curve that never leaves anything below the floor, at the price of floating by
    some millimetres between.
    """
    skin = figure.body.body_component[::_EVERY]
    lowest = lowest_height(motion, figure, np.concatenate([skin, *figure.soles]))
    above = maximum_filter1d(-lowest, 7, mode="nearest")
    return _raised(motion, gaussian_filter1d(above, 2.0, mode="nearest", truncate=1.5))


def lowest_height(
    motion: Motion, figure: Figure, ids: Integer[np.ndarray, " V"]
) -> Float[np.ndarray, " T"]:
    """Height (m) of the lowest of these vertices in every frame."""
    return np.asarray(surface(figure, motion, ids)[..., 2].min(axis=1))


def _raised(motion: Motion, shift: Float[np.ndarray, " T"]) -> Motion:
    transl = motion.transl + shift[:, None] * np.array([0.0, 0.0, 1.0])
    return dataclasses.replace(motion, transl=transl)

"""Frame weights: the paper's k, how much each frame of a motion counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class FrameWeights:
    """k of the paper: one non-negative weight per frame, mean 1."""

    values: Float[np.ndarray, " T"]
    rule: str
    """Name of the rule, e.g. "uniform" or "geometric"."""


def uniform_weights(n_frames: int) -> FrameWeights:
    """Every frame counts alike (POSA-T)."""
    return FrameWeights(np.ones(n_frames), "uniform")

"""Interaction features: what a body touches and what kind of thing it touches (POSA's f_c, f_s)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Integer


@dataclass(frozen=True)
class InteractionFeatures:
    """Per-vertex expectations of contact, for every frame of a motion.

    Axes: T frames, V vertices of the mesh named by `vertex_ids` (full numbering of the body),
    42 classes of mpcat40.
    """

    contact: Float[np.ndarray, "T V"]
    """f_c in [0, 1]."""
    semantics: Float[np.ndarray, "T V 42"]
    """f_s, class scores; the class is the argmax."""
    vertex_ids: Integer[np.ndarray, " V"]
    model: str
    """Name of the rule or network that made them, e.g. "geometric"."""

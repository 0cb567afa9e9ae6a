"""Points spread evenly over a triangle soup."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Integer

_PLASTIC = 1.32471795724474602596


def surface_samples(
    corners: Float[np.ndarray, "F 3 3"], spacing: float, at_most: int = 200_000
) -> tuple[Float[np.ndarray, "S 3"], Integer[np.ndarray, " S"]]:
    """About one point per square of `spacing` metres and the centroid of every face, with the faces.

    Points inside a face follow the additive R2 sequence (Roberts 2018), which needs no random numbers.
    If there would be more than `at_most`, the spacing grows.
    """
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    spacing = max(spacing, float(np.sqrt(area.sum() / at_most)))
    count = np.round(area / spacing**2).astype(int)
    face = np.repeat(np.arange(len(corners)), count)
    rank = np.arange(len(face)) + 1.0
    u, v = (rank / _PLASTIC) % 1.0, (rank / _PLASTIC**2) % 1.0
    over = u + v > 1
    u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
    a, b, c = corners[face, 0], corners[face, 1], corners[face, 2]
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    every = np.arange(len(corners))
    return np.concatenate([corners.mean(1), points]), np.concatenate([every, face])

"""Settling: how high a thing stands when it is put down on another, by rays straight down."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

_PATCH = 0.35
"""Side of the probed patch as a share of the smaller side of the footprint."""
_RAYS = 5
_CHUNK = 400_000
"""Point-triangle pairs looked at in one go."""


def settled_height(
    support: Float[np.ndarray, "F 3 3"],
    x: float,
    y: float,
    footprint: tuple[float, float],
    quantile: float = 0.5,
) -> float:
    """Height of a support under the middle of a footprint centred on (x, y), metres.

    The median (or another quantile) of 5 x 5 downward rays over a patch of 0.35 times the smaller
    side, rounded to a tenth of a millimetre. NaN where the support lies under fewer than half of the rays.
    """
    reach = 0.5 * _PATCH * min(footprint)
    steps = np.linspace(-reach, reach, _RAYS)
    grid = np.stack(np.meshgrid(x + steps, y + steps), -1).reshape(-1, 2)
    heights = surface_heights(support, grid)
    if np.isnan(heights).sum() * 2 > len(heights):
        return float("nan")
    return round(float(np.nanquantile(heights, quantile)), 4)


def surface_heights(
    corners: Float[np.ndarray, "F 3 3"], points: Float[np.ndarray, "N 2"]
) -> Float[np.ndarray, " N"]:
    """Height of the uppermost surface over each point (x, y); NaN where there is none."""
    low, high = corners[..., :2].min(1), corners[..., :2].max(1)
    near = np.all((high >= points.min(0)) & (low <= points.max(0)), axis=1)
    a, b, c = (corners[near, k] for k in range(3))
    chunk = max(1, _CHUNK // max(len(a), 1))
    parts = [_heights(points[i : i + chunk], a, b, c) for i in range(0, len(points), chunk)]
    heights = np.concatenate(parts)
    return np.where(np.isneginf(heights), np.nan, heights)


def _heights(
    points: Float[np.ndarray, "N 2"],
    a: Float[np.ndarray, "M 3"],
    b: Float[np.ndarray, "M 3"],
    c: Float[np.ndarray, "M 3"],
) -> Float[np.ndarray, " N"]:
    """Greatest z of the triangles at each point by barycentric coordinates; -inf where none."""
    e1, e2 = b[:, :2] - a[:, :2], c[:, :2] - a[:, :2]
    area = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
    flat = np.abs(area) < 1e-12
    safe = np.where(flat, 1.0, area)
    x, y = points[:, :1] - a[:, 0], points[:, 1:] - a[:, 1]
    u = (x * e2[:, 1] - y * e2[:, 0]) / safe
    v = (e1[:, 0] * y - e1[:, 1] * x) / safe
    inside = ~flat & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
    z = a[:, 2] + u * (b[:, 2] - a[:, 2]) + v * (c[:, 2] - a[:, 2])
    return np.asarray(np.max(np.where(inside, z, -np.inf), axis=1, initial=-np.inf))

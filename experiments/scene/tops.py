"""Refinement of large tops, so that baked occlusion can darken them under what stands there."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

TOP_AREA = 0.3
"""Square metres of level surface at one height from which it is refined."""
MAX_EDGE = 0.14
"""Metres: longest edge that is left on a refined top."""

Attributes = tuple[
    Float[np.ndarray, "F 3 3"],
    Float[np.ndarray, "F 3 3"],
    Float[np.ndarray, "F 3 2"] | None,
    Float[np.ndarray, "F 3 3"] | None,
]
"""Corners, normals, texture coordinates and colours of one material."""


def refine_tops(materials: tuple[Attributes, ...]) -> tuple[Attributes, ...]:
    """Split the triangles of large level tops at their longest edge until all edges are short."""
    large = _large_heights(np.concatenate([corners for corners, *_ in materials]))
    return tuple(_refine(attributes, large) for attributes in materials)


def _large_heights(corners: Float[np.ndarray, "F 3 3"]) -> set[int]:
    """Heights in whole centimetres at which the level upward surface exceeds `TOP_AREA`."""
    level, area = _level(corners)
    height = np.round(corners[level].mean((1, 2), where=[False, False, True]) * 100).astype(int)
    total = np.bincount(height - height.min(), area[level]) if len(height) else np.zeros(0)
    return {int(k + height.min()) for k in np.flatnonzero(total > TOP_AREA)}


def _level(
    corners: Float[np.ndarray, "F 3 3"],
) -> tuple[Bool[np.ndarray, " F"], Float[np.ndarray, " F"]]:
    """Which faces look straight up, and all areas."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(cross, axis=1)
    return cross[:, 2] > 0.99 * np.maximum(double, 1e-20), double / 2


def _refine(attributes: Attributes, large: set[int]) -> Attributes:
    corners, normals, uv, colours = attributes
    level, _ = _level(corners)
    height = np.round(corners[:, :, 2].mean(1) * 100).astype(int)
    chosen = level & np.isin(height, sorted(large))
    if not chosen.any():
        return attributes
    widths = [3, 3, 0 if uv is None else 2, 0 if colours is None else 3]
    joined = np.concatenate([a for a in attributes if a is not None], axis=2)
    done = np.concatenate([joined[~chosen], split_long(joined[chosen], MAX_EDGE)])
    pieces = np.split(done, np.cumsum(widths)[:-1], axis=2)
    return (
        pieces[0],
        pieces[1],
        None if uv is None else pieces[2],
        None if colours is None else pieces[3],
    )


def split_long(
    triangles: Float[np.ndarray, "F 3 D"], max_edge: float
) -> Float[np.ndarray, "G 3 D"]:
    """Halve triangles at their longest edge until none is longer than `max_edge`.

    The first three of the D attributes are the position; the others are interpolated.
    """
    finished = []
    work = triangles
    while len(work):
        edges = work[:, [1, 2, 0], :3] - work[:, :, :3]
        length = np.linalg.norm(edges, axis=2)
        longest = length.argmax(1)
        short = length.max(1) <= max_edge
        finished.append(work[short])
        work, start = work[~short], longest[~short]
        row = np.arange(len(work))
        a, b, c = (work[row, (start + k) % 3] for k in range(3))
        middle = (a + b) / 2
        work = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(finished)

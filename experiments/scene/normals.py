"""Corner normals of a triangle soup, smooth across soft edges and creased at sharp ones."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

CREASE_DEG = 40.0


def creased_normals(
    corners: Float[np.ndarray, "F 3 3"], crease_deg: float = CREASE_DEG
) -> Float[np.ndarray, "F 3 3"]:
    """Unit normal per corner: the area-weighted mean over the faces round the vertex that lean less
    than the crease angle away from the corner's own face.

    Corners within 0.01 mm are one vertex.
    """
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(weighted, axis=1, keepdims=True)
    unit = weighted / np.maximum(area, 1e-20)
    keys = np.round(corners.reshape(-1, 3) / 1e-5).astype(np.int64)
    vertex = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    corner, other = _same_vertex(vertex)
    own, theirs = corner // 3, other // 3
    soft = np.einsum("ij,ij->i", unit[own], unit[theirs]) > np.cos(np.radians(crease_deg))
    soft |= own == theirs
    total = np.zeros((len(vertex), 3))
    for axis in range(3):
        total[:, axis] = np.bincount(
            corner[soft], weighted[theirs[soft], axis], minlength=len(vertex)
        )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    normals = np.where(length > 1e-20, total / np.maximum(length, 1e-20), unit.repeat(3, axis=0))
    return np.asarray(normals.reshape(-1, 3, 3))


def _same_vertex(vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All ordered pairs of corners that sit on the same vertex, each with itself included."""
    order = np.argsort(vertex, kind="stable")
    count = np.bincount(vertex)
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    partners = count[vertex]
    corner = np.repeat(np.arange(len(vertex)), partners)
    rank = np.arange(len(corner)) - np.repeat(np.cumsum(partners) - partners, partners)
    return corner, order[start[vertex[corner]] + rank]

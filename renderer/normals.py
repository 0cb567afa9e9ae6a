"""Vertex normals of a mesh, and a fast form for a body whose faces never change."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Integer
from scipy import sparse

UP = np.array([0.0, 0.0, 1.0])


def vertex_normals(
    vertices: Float[np.ndarray, "V 3"], faces: Integer[np.ndarray, "G 3"]
) -> Float[np.ndarray, "V 3"]:
    """Area-weighted unit normals; a vertex without any area gets the up direction."""
    return NormalsOf(faces, len(vertices))(vertices)


class NormalsOf:
    """Normals of ever new vertices over fixed faces: one sparse product a frame."""

    def __init__(self, faces: Integer[np.ndarray, "G 3"], n_vertices: int) -> None:
        self._faces = faces
        rows = faces.T.reshape(-1)
        columns = np.tile(np.arange(len(faces)), 3)
        ones = np.ones(len(rows))
        self._sum = sparse.csr_array((ones, (rows, columns)), shape=(n_vertices, len(faces)))

    def __call__(self, vertices: Float[np.ndarray, "V 3"]) -> Float[np.ndarray, "V 3"]:
        """Unit normals of these vertices, dtype kept."""
        a, b, c = (vertices[self._faces[:, k]].astype(np.float64) for k in range(3))
        summed = self._sum @ np.cross(b - a, c - a)
        length = np.linalg.norm(summed, axis=1, keepdims=True)
        flat = length[:, 0] < 1e-20
        summed[flat], length[flat] = UP, 1.0
        normals: np.ndarray = (summed / length).astype(vertices.dtype)
        return normals

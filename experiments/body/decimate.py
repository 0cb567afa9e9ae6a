"""A small closed mesh whose vertices are a subset of a large one, for bodies that bring none."""

from __future__ import annotations

import heapq

import numpy as np
from jaxtyping import Float, Integer

from experiments.body.surface import fill_holes, is_closed

# Keeps flat areas, whose quadric error is zero, from collapsing into slivers.
_LENGTH_SHARE = 1e-3
_LEAST_NORMAL_COSINE = 0.2


def closed_subset(
    vertices: Float[np.ndarray, "V 3"], faces: Integer[np.ndarray, "F 3"], count: int
) -> tuple[Integer[np.ndarray, " S"], Integer[np.ndarray, "G 3"]]:
    """About `count` of the vertices of a surface and closed triangles over them, in subset numbering.

    Holes are filled, then half edges are collapsed in the order of their quadric error (Garland and
    Heckbert 1997) where the link condition (Dey et al. 1999) and the normals allow it, so that
    the surface keeps its topology. Raises `ValueError` for a surface that cannot be closed.
    """
    filled = fill_holes(faces)
    if not is_closed(filled):
        raise ValueError("the surface has edges shared by more than two faces")
    mesh = _Collapsing(vertices, filled)
    queue = mesh.candidates(range(len(vertices)))
    heapq.heapify(queue)
    left = len(np.unique(filled))
    while left > count and queue:
        _, gone, kept, age = heapq.heappop(queue)
        if age != mesh.age[gone] + mesh.age[kept] or not mesh.may_collapse(gone, kept):
            continue
        mesh.collapse(gone, kept)
        left -= 1
        for candidate in mesh.candidates(mesh.ring(kept) | {kept}):
            heapq.heappush(queue, candidate)
    return mesh.result()


class _Collapsing:
    """A triangle mesh under half-edge collapses."""

    def __init__(
        self, vertices: Float[np.ndarray, "V 3"], faces: Integer[np.ndarray, "F 3"]
    ) -> None:
        self.vertices = vertices
        self.faces: dict[int, tuple[int, int, int]] = {
            index: (int(a), int(b), int(c)) for index, (a, b, c) in enumerate(faces)
        }
        self.around: list[set[int]] = [set() for _ in vertices]
        for index, face in self.faces.items():
            for corner in face:
                self.around[corner].add(index)
        self.quadrics = _quadrics(vertices, faces)
        self.age = [0] * len(vertices)

    def ring(self, vertex: int) -> set[int]:
        """Neighbours of a vertex."""
        return {corner for face in self.around[vertex] for corner in self.faces[face]} - {vertex}

    def candidates(self, vertices: set[int] | range) -> list[tuple[float, int, int, int]]:
        """(error, vanishing vertex, kept vertex, age) of every half edge that leaves the vertices."""
        pairs = [(gone, kept) for gone in vertices for kept in self.ring(gone)]
        if not pairs:
            return []
        gone, kept = np.array(pairs).T
        place = np.concatenate([self.vertices[kept], np.ones((len(kept), 1))], axis=1)
        quadric = self.quadrics[gone] + self.quadrics[kept]
        error = np.einsum("na,nab,nb->n", place, quadric, place)
        squared = ((self.vertices[gone] - self.vertices[kept]) ** 2).sum(axis=1)
        error += _LENGTH_SHARE * squared * np.abs(quadric[:, :3, :3].trace(axis1=1, axis2=2))
        return [
            (float(e), g, k, self.age[g] + self.age[k])
            for e, (g, k) in zip(error, pairs, strict=True)
        ]

    def may_collapse(self, gone: int, kept: int) -> bool:
        """Whether the edge still exists, keeps the topology and turns no face over."""
        ring = self.ring(gone)
        if kept not in ring or len(ring & self.ring(kept)) != 2 or len(ring) < 4:
            return False
        for index in self.around[gone]:
            face = self.faces[index]
            if kept not in face:
                moved = [kept if corner == gone else corner for corner in face]
                before, after = self._normal(face), self._normal(moved)
                length = np.linalg.norm(before) * np.linalg.norm(after)
                if before @ after <= _LEAST_NORMAL_COSINE * length:
                    return False
        return True

    def collapse(self, gone: int, kept: int) -> None:
        """Move every face of one vertex to the other; the two faces between them vanish."""
        for index in self.around[gone]:
            face = self.faces[index]
            if kept in face:
                for corner in set(face) - {gone}:
                    self.around[corner].discard(index)
                del self.faces[index]
            else:
                a, b, c = (kept if corner == gone else corner for corner in face)
                self.faces[index] = (a, b, c)
                self.around[kept].add(index)
        self.around[gone] = set()
        self.quadrics[kept] += self.quadrics[gone]
        self.age[kept] += 1
        self.age[gone] += 1

    def result(self) -> tuple[Integer[np.ndarray, " S"], Integer[np.ndarray, "G 3"]]:
        """The vertices left, ascending, and the faces in their numbering."""
        faces = np.array(list(self.faces.values()), dtype=np.int64)
        subset, numbered = np.unique(faces, return_inverse=True)
        return subset, numbered.reshape(-1, 3)

    def _normal(self, face: tuple[int, int, int] | list[int]) -> Float[np.ndarray, "3"]:
        a, b, c = self.vertices[list(face)]
        return np.asarray(np.cross(b - a, c - a))


def _quadrics(
    vertices: Float[np.ndarray, "V 3"], faces: Integer[np.ndarray, "F 3"]
) -> Float[np.ndarray, "V 4 4"]:
    """Area-weighted squared-distance forms of the planes around every vertex."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    units = normals / np.maximum(areas, 1e-15)[:, None]
    planes = np.concatenate([units, -(units * corners[:, 0]).sum(1, keepdims=True)], axis=1)
    forms = areas[:, None, None] * planes[:, :, None] * planes[:, None, :]
    quadrics: Float[np.ndarray, "V 4 4"] = np.zeros((len(vertices), 4, 4))
    for corner in range(3):
        np.add.at(quadrics, faces[:, corner], forms)
    return quadrics

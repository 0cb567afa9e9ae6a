"""Triangle surfaces: normals, connected parts, holes."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Integer
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


def vertex_normals(
    vertices: Float[np.ndarray, "V 3"], faces: Integer[np.ndarray, "F 3"]
) -> Float[np.ndarray, "V 3"]:
    """Unit vertex normals, area weighted; zero for vertices without a face."""
    corners = vertices[faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], areas)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.maximum(length, 1e-12))


def largest_component(faces: Integer[np.ndarray, "F 3"]) -> Integer[np.ndarray, " K"]:
    """Vertices of the largest connected part: of a body the outer skin without eyes and teeth."""
    count = int(faces.max()) + 1
    edges = np.concatenate([faces[:, :2], faces[:, 1:]]).astype(np.int64)
    graph = coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    return np.flatnonzero(label == np.bincount(label).argmax())


def is_closed(faces: Integer[np.ndarray, "F 3"]) -> bool:
    """Whether every directed edge occurs once and its opposite does too: watertight, one orientation."""
    edges = _directed_edges(faces)
    return len(set(edges)) == len(edges) and set(edges) == {(b, a) for a, b in edges}


def euler_characteristic(faces: Integer[np.ndarray, "F 3"]) -> int:
    """V - E + F of the vertices that occur; 2 for a surface like a sphere."""
    edges = {(min(edge), max(edge)) for edge in _directed_edges(faces)}
    return len(np.unique(faces)) - len(edges) + len(faces)


def fill_holes(faces: Integer[np.ndarray, "F 3"]) -> Integer[np.ndarray, "G 3"]:
    """The faces and a fan of triangles over every boundary loop (the eye sockets of SMPL-X)."""
    edges = set(_directed_edges(faces))
    following = {b: a for a, b in edges if (b, a) not in edges}
    fans: list[tuple[int, int, int]] = []
    while following:
        start, vertex = following.popitem()
        loop = [start]
        while vertex in following:
            loop.append(vertex)
            vertex = following.pop(vertex)
        fans += _fan(loop, edges)
    return np.concatenate([faces, np.array(fans, dtype=faces.dtype).reshape(-1, 3)])


def _fan(loop: list[int], edges: set[tuple[int, int]]) -> list[tuple[int, int, int]]:
    """Triangles over a loop from its first vertex whose fan repeats no edge of the surface."""
    fan: list[tuple[int, int, int]] = []
    for turn in range(len(loop)):
        first, *rest = loop[turn:] + loop[:turn]
        fan = [(first, rest[i], rest[i + 1]) for i in range(len(rest) - 1)]
        if not any((first, inner) in edges or (inner, first) in edges for inner in rest[1:-1]):
            break
    return fan


def _directed_edges(faces: Integer[np.ndarray, "F 3"]) -> list[tuple[int, int]]:
    corners = [tuple(int(corner) for corner in face) for face in faces]
    return [(face[i], face[(i + 1) % 3]) for face in corners for i in range(3)]

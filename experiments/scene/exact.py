"""Slow, obvious geometry: the oracle of the baked volumes, for tests and spot checks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from experiments.scene.enclosure import vote_directions
from experiments.scene.furniture_distance import Solid
from experiments.scene.volumes import FLOOR, WALL


def exact_distance(
    point: Float[np.ndarray, "3"],
    room_size: tuple[float, float, float],
    solids: Sequence[Solid],
) -> tuple[float, int]:
    """Signed distance (metres) and nearest class at one point, straight from the triangles.

    The minimum over the objects, each signed by the vote of 26 rays, and over floor and walls.
    """
    best, label = _shell(point, room_size)
    for solid in solids:
        distance, _ = nearest_triangle(point, solid.corners)
        inside = bool(enclosed_by_intersection(point, solid.corners))
        signed = -distance if inside else distance
        if signed < best:
            best, label = signed, solid.label
    return best, label


def nearest_triangle(
    point: Float[np.ndarray, "3"], corners: Float[np.ndarray, "F 3 3"]
) -> tuple[float, int]:
    """Distance in metres to the nearest of all triangles, and which one it is."""
    distances = triangle_distances(point, corners)
    index = int(np.argmin(distances))
    return float(distances[index]), index


def triangle_distances(
    point: Float[np.ndarray, "3"], corners: Float[np.ndarray, "F 3 3"]
) -> Float[np.ndarray, " F"]:
    """Distance to every triangle: to its plane where the foot lies inside, else to its edges."""
    triangle = corners.astype(np.float64)
    edges = [_to_segment(point, triangle[:, i], triangle[:, (i + 1) % 3]) for i in range(3)]
    distance: Float[np.ndarray, " F"] = np.min(edges, axis=0)
    a, ab, ac = triangle[:, 0], triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0]
    normal = np.cross(ab, ac)
    square = (normal**2).sum(axis=1)
    proper = square > 1e-20
    height = ((point - a)[proper] * normal[proper]).sum(axis=1) / np.sqrt(square[proper])
    u, v = _barycentric(point - a[proper], ab[proper], ac[proper])
    inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    distance[proper] = np.where(inside, np.abs(height), distance[proper])
    return distance


def enclosed_by_intersection(
    point: Float[np.ndarray, "3"], corners: Float[np.ndarray, "F 3 3"]
) -> Bool[np.ndarray, ""]:
    """The vote of `enclosed` with hand-written ray-triangle tests (Moeller and Trumbore 1997)."""
    a = corners[:, 0].astype(np.float64)
    ab, ac = corners[:, 1] - a, corners[:, 2] - a
    hits = 0
    for direction in vote_directions().astype(np.float64):
        across = np.cross(direction, ac)
        determinant = (ab * across).sum(axis=1)
        safe = np.where(np.abs(determinant) > 1e-15, determinant, np.inf)
        u = ((point - a) * across).sum(axis=1) / safe
        around = np.cross(point - a, ab)
        v = around @ direction / safe
        t = (ac * around).sum(axis=1) / safe
        hits += bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)).any())
    return np.array(hits >= 25)


def _shell(
    point: Float[np.ndarray, "3"], room_size: tuple[float, float, float]
) -> tuple[float, int]:
    """Floor and walls as five planes; outside the room the distance to its box, negated."""
    x, y, z = (float(value) for value in point)
    walls = [x, room_size[0] - x, y, room_size[1] - y]
    label = FLOOR if z <= min(walls) else WALL
    if z >= 0 and min(walls) >= 0:
        return min(z, *walls), label
    gap = [max(-x, x - room_size[0], 0.0), max(-y, y - room_size[1], 0.0), max(-z, 0.0)]
    return -float(np.linalg.norm(gap)), label


def _to_segment(
    point: Float[np.ndarray, "3"], start: Float[np.ndarray, "F 3"], end: Float[np.ndarray, "F 3"]
) -> Float[np.ndarray, " F"]:
    span = end - start
    length2 = np.maximum((span**2).sum(axis=1), 1e-30)
    share = np.clip(((point - start) * span).sum(axis=1) / length2, 0, 1)
    distance: Float[np.ndarray, " F"] = np.linalg.norm(
        point - start - share[:, None] * span, axis=1
    )
    return distance


def _barycentric(
    offset: Float[np.ndarray, "F 3"], ab: Float[np.ndarray, "F 3"], ac: Float[np.ndarray, "F 3"]
) -> tuple[Float[np.ndarray, " F"], Float[np.ndarray, " F"]]:
    """Coordinates of each offset's foot in the plane of ab and ac (normal equations)."""
    bb, bc, cc = ((p * q).sum(axis=1) for p, q in ((ab, ab), (ab, ac), (ac, ac)))
    ob, oc = (offset * ab).sum(axis=1), (offset * ac).sum(axis=1)
    determinant = bb * cc - bc * bc
    return (cc * ob - bc * oc) / determinant, (bb * oc - bc * ob) / determinant

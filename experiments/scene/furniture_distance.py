"""Signed distance to the furniture of a room on a regular grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int64, UInt8
from scipy.ndimage import distance_transform_edt

from experiments.scene.enclosure import enclosed
from experiments.scene.narrow_band import PlanarTriangles, Windows, band_distance
from experiments.scene.refine import refine
from experiments.scene.sign import SIDES, inside_nodes, lids

BAND_CELLS = 2.0
"""Half width of the band in which the distance is exact, in cells."""
AT_WALL = 0.06
"""Metres: objects closer to a wall count as closed by it."""
ON_WALL, ON_FLOOR = 0.02, 0.005
"""Metres: surfaces closer than this lie on the wall or floor."""
LONGEST_EDGE = 0.2
"""Triangles are cut to edges of at most this, metres: a large one may be outer surface only in part."""
_CHUNK = 300_000


@dataclass(frozen=True)
class Solid:
    """One object that a body cannot walk through."""

    corners: Float[np.ndarray, "F 3 3"]
    """Room frame, metres."""
    label: int
    """mpcat40 class index."""


def furniture_distance(
    solids: Sequence[Solid],
    room_size: tuple[float, float, float],
    origin: Float[np.ndarray, "3"],
    shape: tuple[int, int, int],
    cell: float,
    on_step: Callable[[float], None],
) -> tuple[Float32[np.ndarray, "X Y Z"], UInt8[np.ndarray, "X Y Z"]]:
    """Signed distance in metres to all furniture of a room, and the class of the nearest triangle.

    Exact within `BAND_CELLS` of a surface. Further away, and deeper inside, it is the exact
    distance to the triangle carried over from the nearest such node, which can only be too large.
    Surfaces buried inside an object (a mattress within its frame, books within a shelf) do not
    count: depth is measured to the outer surface.
    """
    pieces = [refine(solid.corners.astype(np.float64) - origin, LONGEST_EDGE) for solid in solids]
    corners = np.concatenate(pieces)
    owner = np.repeat(np.arange(len(solids)), [len(piece) for piece in pieces])
    windows = _windows(pieces, shape, cell)
    distance, triangle = band_distance(corners, owner, windows, cell, BAND_CELLS * cell)
    on_step(0.3)
    planar = PlanarTriangles.of(corners)
    total = np.full(shape, np.float32(np.inf))
    nearest = np.full(shape, -1, dtype=np.int64)
    for index, piece in enumerate(pieces):
        part = slice(windows.start[index], windows.start[index + 1])
        field = _Field(
            distance[part].reshape(windows.shape[index]),
            triangle[part].reshape(windows.shape[index]),
            windows.low[index],
            cell,
        )
        if field.distance.size:
            closed = _closed_sides(piece + origin, room_size)
            hidden = _against_shell(piece + origin, room_size)
            field.sign(int(np.searchsorted(owner, index)), piece, closed, hidden, planar)
            _merge(total, nearest, field)
        on_step(0.3 + 0.5 * (index + 1) / len(solids))
    everywhere = _Field(total, nearest, np.zeros(3, np.int64), cell)
    everywhere.spread(np.abs(total) <= 0.9 * cell, ~np.isfinite(total), planar)
    label = np.array([solid.label for solid in solids], dtype=np.uint8)[owner[nearest]]
    return total, label


def _windows(
    pieces: Sequence[Float[np.ndarray, "_ 3 3"]], shape: tuple[int, int, int], cell: float
) -> Windows:
    """The nodes that may lie within the band of each solid, or inside it."""
    band = BAND_CELLS * cell
    low = np.array([np.floor((p.min(axis=(0, 1)) - band) / cell) for p in pieces], dtype=np.int64)
    high = np.array([np.ceil((p.max(axis=(0, 1)) + band) / cell) for p in pieces], dtype=np.int64)
    low, high = np.maximum(low, 0), np.minimum(high, np.array(shape) - 1)
    return Windows(low, np.maximum(high - low + 1, 0))


def _closed_sides(
    corners: Float[np.ndarray, "F 3 3"], room_size: tuple[float, float, float]
) -> frozenset[str]:
    """Sides of an object that a wall closes."""
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    gaps = (low[0], room_size[0] - high[0], low[1], room_size[1] - high[1])
    return frozenset(side for side, gap in zip(SIDES, gaps, strict=True) if gap < AT_WALL)


def _against_shell(
    corners: Float[np.ndarray, "F 3 3"], room_size: tuple[float, float, float]
) -> Bool[np.ndarray, " F"]:
    """Triangles that lie on the floor or on a wall: behind them is no air but more solid."""
    x, y, z = np.moveaxis(corners, -1, 0)
    low = [x, room_size[0] - x, y, room_size[1] - y]
    on_wall = np.any([(gap < ON_WALL).all(axis=1) for gap in low], axis=0)
    resting: Bool[np.ndarray, " F"] = on_wall | (z < ON_FLOOR).all(axis=1)
    return resting


@dataclass
class _Field:
    """Distance and nearest triangle over a window of the grid, under construction."""

    distance: Float32[np.ndarray, "x y z"]
    triangle: Int64[np.ndarray, "x y z"]
    low: Int64[np.ndarray, "3"]
    cell: float

    def sign(
        self,
        first: int,
        corners: Float[np.ndarray, "F 3 3"],
        closed: frozenset[str],
        hidden: Bool[np.ndarray, " F"],
        planar: PlanarTriangles,
    ) -> None:
        """Make the distance to one object negative inside, measured to its outer surface.

        `first` is the index of the object's first triangle, `corners` are its own; `hidden` ones
        lie on the floor or a wall and count for nothing.
        """
        inside = inside_nodes(corners, self.distance, self.low, self.cell, closed)
        outer = np.flatnonzero(self._outer(inside, first, corners, closed) & ~hidden)
        if not len(outer):
            # A flat picture on its wall: all of it lies there, and it is as thick as it is.
            outer = np.arange(len(corners))
        windows = Windows(self.low[None], np.array([inside.shape]))
        owner = np.zeros(len(outer), dtype=np.int64)
        band = BAND_CELLS * self.cell
        again, which = band_distance(corners[outer], owner, windows, self.cell, band)
        known = inside & np.isfinite(again := again.reshape(inside.shape))
        self.distance[inside] = np.inf
        self.distance[known] = again[known]
        self.triangle[known] = first + outer[which.reshape(inside.shape)[known]]
        # Inside, the first nodes behind a surface may be a whole cell away from it.
        seeds = known & (self.distance <= 1.05 * self.cell)
        self.spread(seeds, inside & ~known, planar)
        self.distance[inside] *= -1

    def _outer(
        self,
        inside: Bool[np.ndarray, "x y z"],
        first: int,
        corners: Float[np.ndarray, "F 3 3"],
        closed: frozenset[str],
    ) -> Bool[np.ndarray, " F"]:
        """Triangles that air touches: nearest to a node outside, or not enclosed themselves."""
        known = np.isfinite(self.distance)
        outer = np.zeros(len(corners), dtype=bool)
        outer[self.triangle[known & ~inside] - first] = True
        doubtful = np.unique(self.triangle[known & inside] - first)
        doubtful = doubtful[~outer[doubtful]]
        chosen = corners[doubtful]
        normal = np.cross(chosen[:, 1] - chosen[:, 0], chosen[:, 2] - chosen[:, 0])
        normal = 1e-3 * normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        shut = np.concatenate([corners, lids(corners, closed)])
        both = [enclosed(shut, chosen.mean(axis=1) + side * normal) for side in (-1, 1)]
        outer[doubtful] = ~(both[0] & both[1])
        return outer

    def spread(
        self,
        known: Bool[np.ndarray, "x y z"],
        wanted: Bool[np.ndarray, "x y z"],
        planar: PlanarTriangles,
    ) -> None:
        """Fill the wanted nodes from the known ones.

        The feature transform gives each node the triangle of the nearest known node. That node is
        near the nearest point of the surface, but not always on the right triangle: the triangles
        that the six neighbours ended up with are tried as well.
        """
        if not wanted.any() or not known.any():
            return
        i, j, k = distance_transform_edt(~known, return_distances=False, return_indices=True)
        carried = self.triangle[i, j, k]
        node, found = np.argwhere(wanted), carried[wanted]
        best = self._to(planar, node, found)
        for step in (*np.eye(3, dtype=int), *-np.eye(3, dtype=int)):
            beside = np.clip(node + step, 0, np.array(known.shape) - 1)
            other = carried[tuple(beside.T)]
            new = np.flatnonzero(other != found)
            distance = self._to(planar, node[new], other[new])
            closer = distance < best[new]
            best[new[closer]], found[new[closer]] = distance[closer], other[new[closer]]
        self.distance[wanted], self.triangle[wanted] = best, found

    def _to(
        self,
        planar: PlanarTriangles,
        node: Int64[np.ndarray, "N 3"],
        triangle: Int64[np.ndarray, " N"],
    ) -> Float32[np.ndarray, " N"]:
        """Exact distance from each node of the window to its triangle."""
        found = np.zeros(len(node), dtype=np.float32)
        for start in range(0, len(node), _CHUNK):
            part = slice(start, start + _CHUNK)
            place = ((node[part] + self.low) * self.cell).astype(np.float32)
            found[part] = planar.distance(place, triangle[part])
        return found


def _merge(
    total: Float32[np.ndarray, "X Y Z"], nearest: Int64[np.ndarray, "X Y Z"], field: _Field
) -> None:
    """Union with one object: the smaller signed distance wins."""
    shape = field.distance.shape
    box = tuple(slice(a, a + n) for a, n in zip(field.low, shape, strict=True))
    smaller = field.distance < total[box]
    total[box][smaller] = field.distance[smaller]
    nearest[box][smaller] = field.triangle[smaller]

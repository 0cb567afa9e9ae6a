"""Exact unsigned distance to triangles at the grid nodes close to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int64, Integer

_CHUNK = 300_000
"""Node-triangle pairs worked on at once: small enough for the processor's cache."""
_NO_TRIANGLE = np.uint64(0xFFFFFFFF)
_FAR = np.float32(np.inf).view(np.uint32).astype(np.uint64) << np.uint64(32) | _NO_TRIANGLE


@dataclass(frozen=True)
class Windows:
    """Boxes of nodes cut out of one grid, laid out one after the other in a flat array."""

    low: Int64[np.ndarray, "O 3"]
    """Grid index of the first node of each box."""
    shape: Int64[np.ndarray, "O 3"]

    @property
    def start(self) -> Int64[np.ndarray, " _"]:
        """Where each box begins in the flat array; the last entry is the total size."""
        return np.concatenate([np.zeros(1, np.int64), np.cumsum(self.shape.prod(axis=1))])


def band_distance(
    corners: Float[np.ndarray, "F 3 3"],
    owner: Integer[np.ndarray, " F"],
    windows: Windows,
    cell: float,
    band: float,
) -> tuple[Float32[np.ndarray, " N"], Int64[np.ndarray, " N"]]:
    """Distance to the nearest triangle of the same owner, exact wherever it is at most `band`.

    Every triangle is compared with all nodes of its bounding box widened by the band, so no
    candidate can be missed. `corners` are metres from grid node 0; triangle f only counts in
    window `owner[f]`. Returns per node of the flat windows the distance in metres and the index
    of the triangle, infinity and -1 beyond the band. Triangles without area are left out.
    """
    keys = np.full(int(windows.start[-1]), _FAR)
    planar = PlanarTriangles.of(corners)
    low, count = _node_boxes(corners, owner, windows, cell, band)
    count[~planar.proper] = 0
    pairs = count.prod(axis=1)
    order = np.flatnonzero(pairs)
    breaks = np.flatnonzero(np.diff(np.cumsum(pairs[order]) // _CHUNK)) + 1
    for chosen in np.split(order, breaks):
        if len(chosen):
            _lower_keys(keys, planar, chosen, owner, low, count, windows, cell, band)
    distance = (keys >> np.uint64(32)).astype(np.uint32).view(np.float32)
    triangle = (keys & _NO_TRIANGLE).astype(np.int64)
    triangle[triangle == int(_NO_TRIANGLE)] = -1
    return distance, triangle


def _node_boxes(
    corners: Float[np.ndarray, "F 3 3"],
    owner: Integer[np.ndarray, " F"],
    windows: Windows,
    cell: float,
    band: float,
) -> tuple[Int64[np.ndarray, "F 3"], Int64[np.ndarray, "F 3"]]:
    """First node and node counts of each triangle's widened box, cut to its owner's window."""
    first = np.ceil((corners.min(axis=1) - band) / cell).astype(np.int64)
    last = np.floor((corners.max(axis=1) + band) / cell).astype(np.int64)
    low = np.maximum(first, windows.low[owner])
    high = np.minimum(last, windows.low[owner] + windows.shape[owner] - 1)
    return low, np.maximum(high - low + 1, 0)


def _lower_keys(
    keys: np.ndarray,
    planar: PlanarTriangles,
    chosen: Int64[np.ndarray, " C"],
    owner: Integer[np.ndarray, " F"],
    low: Int64[np.ndarray, "F 3"],
    count: Int64[np.ndarray, "F 3"],
    windows: Windows,
    cell: float,
    band: float,
) -> None:
    """Enter the distances of the chosen triangles into `keys` wherever they are smaller.

    A key is the bit pattern of the (non-negative) float32 distance above the triangle index:
    such patterns sort like the numbers, so one integer minimum keeps both.
    """
    size = count[chosen].prod(axis=1)
    pair = np.repeat(chosen, size)
    inner = np.arange(len(pair)) - np.repeat(np.cumsum(size) - size, size)
    _, ny, nz = count[pair].T
    step = np.stack([inner // (ny * nz), inner // nz % ny, inner % nz], axis=1)
    node = low[pair] + step
    distance = planar.distance((node * cell).astype(np.float32), pair)
    near = distance <= band
    pair, node, distance = pair[near], node[near], distance[near]
    where = owner[pair]
    local = node - windows.low[where]
    shape = windows.shape[where]
    flat = (local[:, 0] * shape[:, 1] + local[:, 1]) * shape[:, 2] + local[:, 2]
    key = distance.view(np.uint32).astype(np.uint64) << np.uint64(32) | pair.astype(np.uint64)
    np.minimum.at(keys, windows.start[where] + flat, key)


@dataclass(frozen=True)
class PlanarTriangles:
    """Triangles in frames of their own: corner A at 0, corner B on the first axis, C above it."""

    anchor: Float32[np.ndarray, "F 3"]
    axes: Float32[np.ndarray, "F 3 3"]
    """Rows: along AB, across it within the plane, the normal."""
    b: Float32[np.ndarray, " F"]
    """First coordinate of B."""
    c: Float32[np.ndarray, "F 2"]
    proper: Bool[np.ndarray, " F"]
    """False for triangles without area."""

    @classmethod
    def of(cls, corners: Float[np.ndarray, "F 3 3"]) -> PlanarTriangles:
        """Set up the frames, in double precision. `corners` are metres."""
        triangle = corners.astype(np.float64)
        ab, ac = triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0]
        normal = np.cross(ab, ac)
        area2, length = np.linalg.norm(normal, axis=1), np.linalg.norm(ab, axis=1)
        proper = area2 > 1e-10
        along = ab / np.maximum(length, 1e-30)[:, None]
        normal = normal / np.maximum(area2, 1e-30)[:, None]
        axes = np.stack([along, np.cross(normal, along), normal], axis=1)
        c = np.einsum("fij,fj->fi", axes[:, :2], ac)
        single = np.float32
        return cls(
            *(triangle[:, 0].astype(single), axes.astype(single)),
            *(length.astype(single), c.astype(single), proper),
        )

    def distance(
        self, points: Float32[np.ndarray, "N 3"], index: Int64[np.ndarray, " N"]
    ) -> Float32[np.ndarray, " N"]:
        """Distance in metres from each point to the triangle of the same row in `index`."""
        offset = points - self.anchor[index]
        axes = self.axes[index]
        x, y, z = (np.einsum("nj,nj->n", axes[:, row], offset) for row in range(3))
        b, (cx, cy) = self.b[index], self.c[index].T
        planar = np.minimum(_to_segment(x, y, b, 0.0), _to_segment(x, y, cx, cy))
        np.minimum(planar, _to_segment(x - b, y, cx - b, cy), out=planar)
        inside = (y >= 0) & (x * cy >= y * cx) & ((b - x) * cy >= y * (b - cx))
        planar[inside] = 0
        distance: Float32[np.ndarray, " N"] = np.sqrt(planar + z * z)
        return distance


def _to_segment(
    x: Float32[np.ndarray, " N"],
    y: Float32[np.ndarray, " N"],
    ex: Float32[np.ndarray, " N"],
    ey: Float32[np.ndarray, " N"] | float,
) -> Float32[np.ndarray, " N"]:
    """Squared distance in the plane from (x, y) to the segment from the origin to (ex, ey)."""
    share = np.clip((x * ex + y * ey) / np.maximum(ex * ex + ey * ey, 1e-20), 0, 1)
    dx, dy = x - share * ex, y - share * ey
    squared: Float32[np.ndarray, " N"] = dx * dx + dy * dy
    return squared

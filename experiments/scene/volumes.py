"""Baking a room's signed distance and nearest-label volumes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int64, Integer, UInt8
from scipy.ndimage import distance_transform_edt

from experiments.scene.enclosure import enclosed
from experiments.scene.narrow_band import PlanarTriangles, Windows, band_distance
from experiments.scene.scene import MPCAT40, Volumes

WALL, FLOOR = MPCAT40.index("wall"), MPCAT40.index("floor")
MARGIN = 0.2
"""How far the grid reaches beyond the walls and below the floor, metres."""
TOP = 2.4
"""Height up to which the grid reaches, metres; above it the border values hold."""
Axes = tuple[Float[np.ndarray, " X"], Float[np.ndarray, " Y"], Float[np.ndarray, " Z"]]

BAND_CELLS = 2.0
SWEEPS = 1
"""Half width of the band in which the distance to furniture is exact, in cells."""


@dataclass(frozen=True)
class Solid:
    """One object that a body cannot walk through."""

    corners: Float[np.ndarray, "F 3 3"]
    """Room frame, metres."""
    label: int
    """mpcat40 class index."""


def bake_volumes(
    room_size: tuple[float, float, float],
    solids: Sequence[Solid],
    cell: float = 0.025,
    thickness: float = 0.01,
    on_step: Callable[[float], None] = lambda share: None,
) -> Volumes:
    """Signed distance and nearest label of a room, at the nodes of a regular grid.

    Distance to furniture is exact within two cells of a surface; further away it is the exact
    distance to the triangle carried over from the nearest such node (a feature transform), which
    can only be too large, by a few millimetres. The sign is voted object by object, and the room
    is the minimum over its objects and the analytic shell: outside the walls and below the floor is
    solid, upwards it is open. `on_step` is told the finished share in [0, 1].
    """
    origin, shape = _grid(room_size, cell)
    shell, shell_label = shell_distance(room_size, _axes(origin, shape, cell))
    if solids:
        furniture, label = _furniture(solids, origin, shape, cell, on_step)
    else:
        furniture, label = np.full(shape, np.float32(np.inf)), shell_label
    on_step(1.0)
    return Volumes(
        sdf=np.minimum(furniture, shell),
        thickened=np.minimum(furniture - np.float32(thickness), shell),
        label=np.where(furniture < shell, label, shell_label),
        origin=(float(origin[0]), float(origin[1]), float(origin[2])),
        cell=cell,
        thickness=thickness,
    )


def shell_distance(
    room_size: tuple[float, float, float], axes: Axes
) -> tuple[Float32[np.ndarray, "X Y Z"], UInt8[np.ndarray, "X Y Z"]]:
    """Signed distance to floor and walls in closed form, and which of the two is nearer.

    The air is the box of the room, open upwards; `axes` are the node coordinates in metres.
    """
    width, depth, _ = room_size
    # Distance beyond each plane, positive outside the room.
    x = np.maximum(-axes[0], axes[0] - width)[:, None, None]
    y = np.maximum(-axes[1], axes[1] - depth)[None, :, None]
    z = -axes[2][None, None, :]
    wall = np.maximum(x, y)
    beyond = np.sqrt(np.maximum(x, 0) ** 2 + np.maximum(y, 0) ** 2 + np.maximum(z, 0) ** 2)
    inside = np.maximum(wall, z)
    distance = np.where(inside > 0, -beyond, -inside).astype(np.float32)
    return distance, np.where(z >= wall, FLOOR, WALL).astype(np.uint8)


def _grid(
    room_size: tuple[float, float, float], cell: float
) -> tuple[Float[np.ndarray, "3"], tuple[int, int, int]]:
    """Origin and node counts. The floor and the two walls through 0 fall on nodes."""
    below = int(np.ceil(MARGIN / cell - 1e-9))
    upper = np.array([room_size[0] + MARGIN, room_size[1] + MARGIN, min(TOP, room_size[2])])
    above = np.ceil(upper / cell - 1e-9).astype(int)
    nx, ny, nz = (int(n) for n in above + below + 1)
    return np.full(3, -below * cell), (nx, ny, nz)


def _axes(origin: Float[np.ndarray, "3"], shape: tuple[int, int, int], cell: float) -> Axes:
    x, y, z = (start + cell * np.arange(n) for start, n in zip(origin, shape, strict=True))
    return x, y, z


def _furniture(
    solids: Sequence[Solid],
    origin: Float[np.ndarray, "3"],
    shape: tuple[int, int, int],
    cell: float,
    on_step: Callable[[float], None],
) -> tuple[Float32[np.ndarray, "X Y Z"], UInt8[np.ndarray, "X Y Z"]]:
    """Signed distance to all furniture, and the class of the nearest triangle."""
    band = BAND_CELLS * cell
    corners = np.concatenate([solid.corners for solid in solids]) - origin
    counts = [len(solid.corners) for solid in solids]
    owner = np.repeat(np.arange(len(solids)), counts)
    windows = _windows(corners, owner, len(solids), shape, cell, band)
    distance, triangle = band_distance(corners, owner, windows, cell, band)
    on_step(0.4)
    planar = PlanarTriangles.of(corners)
    total = np.full(shape, np.float32(np.inf))
    nearest = np.full(shape, -1, dtype=np.int64)
    for index in range(len(solids)):
        part = slice(windows.start[index], windows.start[index + 1])
        signed, carried = _signed_object(
            corners[owner == index],
            distance[part].reshape(windows.shape[index]),
            triangle[part].reshape(windows.shape[index]),
            windows.low[index],
            planar,
            cell,
        )
        _merge(total, nearest, signed, carried, windows.low[index])
        on_step(0.4 + 0.4 * (index + 1) / len(solids))
    missing = ~np.isfinite(total)
    close = np.abs(total) <= 0.9 * cell
    total[missing], nearest[missing] = _spread(
        close, nearest, missing, np.zeros(3, np.int64), planar, cell
    )
    label = np.array([solid.label for solid in solids], dtype=np.uint8)[owner[nearest]]
    return total, label


def _windows(
    corners: Float[np.ndarray, "F 3 3"],
    owner: Integer[np.ndarray, " F"],
    n_solids: int,
    shape: tuple[int, int, int],
    cell: float,
    band: float,
) -> Windows:
    """The nodes that may lie within the band of each solid, or inside it."""
    low, high = np.zeros((n_solids, 3), np.int64), np.zeros((n_solids, 3), np.int64)
    for index in range(n_solids):
        own = corners[owner == index].reshape(-1, 3)
        low[index] = np.floor((own.min(axis=0) - band) / cell)
        high[index] = np.ceil((own.max(axis=0) + band) / cell)
    low, high = np.maximum(low, 0), np.minimum(high, np.array(shape) - 1)
    return Windows(low, np.maximum(high - low + 1, 0))


def _signed_object(
    corners: Float[np.ndarray, "F 3 3"],
    distance: Float32[np.ndarray, "x y z"],
    triangle: Int64[np.ndarray, "x y z"],
    low: Int64[np.ndarray, "3"],
    planar: PlanarTriangles,
    cell: float,
) -> tuple[Float32[np.ndarray, "x y z"], Int64[np.ndarray, "x y z"]]:
    """Distance of one object with its sign; infinite outside the band."""
    inside = _inside(corners, low, distance.shape, cell)
    deep = inside & ~np.isfinite(distance)
    if deep.any():
        distance[deep], triangle[deep] = _spread(
            distance <= 0.9 * cell, triangle, deep, low, planar, cell
        )
    return np.where(inside, -distance, distance), triangle


def _inside(
    corners: Float[np.ndarray, "F 3 3"],
    low: Int64[np.ndarray, "3"],
    shape: tuple[int, ...],
    cell: float,
) -> Bool[np.ndarray, "x y z"]:
    """The vote, taken at the nodes within the object's bounding box only."""
    inside = np.zeros(shape, dtype=bool)
    flat = corners.reshape(-1, 3)
    first = np.maximum(np.ceil(flat.min(axis=0) / cell).astype(int) - low, 0)
    last = np.minimum(np.floor(flat.max(axis=0) / cell).astype(int) - low, np.array(shape) - 1)
    box = tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True))
    if inside[box].size:
        ranges = [np.arange(a, b + 1) for a, b in zip(first, last, strict=True)]
        node = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 3)
        inside[box] = enclosed(corners, (node + low) * cell).reshape(inside[box].shape)
    return inside


def _merge(
    total: Float32[np.ndarray, "X Y Z"],
    nearest: Int64[np.ndarray, "X Y Z"],
    signed: Float32[np.ndarray, "x y z"],
    triangle: Int64[np.ndarray, "x y z"],
    low: Int64[np.ndarray, "3"],
) -> None:
    """Union with one object: the smaller signed distance wins."""
    box = tuple(slice(a, a + n) for a, n in zip(low, signed.shape, strict=True))
    smaller = signed < total[box]
    total[box][smaller] = signed[smaller]
    nearest[box][smaller] = triangle[smaller]


def _spread(
    known: Bool[np.ndarray, "x y z"],
    triangle: Int64[np.ndarray, "x y z"],
    wanted: Bool[np.ndarray, "x y z"],
    low: Int64[np.ndarray, "3"],
    planar: PlanarTriangles,
    cell: float,
) -> tuple[Float32[np.ndarray, " W"], Int64[np.ndarray, " W"]]:
    """Distance and nearest triangle at the wanted nodes, carried over from the known ones.

    The feature transform gives each node the triangle of the nearest known node. That node is
    near the nearest point of the surface, but not always on the right triangle: the triangles that
    the six neighbours ended up with are tried as well.
    """
    i, j, k = distance_transform_edt(~known, return_distances=False, return_indices=True)
    carried = triangle[i, j, k]
    node = np.argwhere(wanted)
    best, found = _distances(planar, node + low, carried[wanted], cell), carried[wanted]
    for _ in range(SWEEPS):
        carried[wanted] = found
        for step in (*np.eye(3, dtype=int), *-np.eye(3, dtype=int)):
            beside = np.clip(node + step, 0, np.array(known.shape) - 1)
            other = carried[tuple(beside.T)]
            new = np.flatnonzero(other != found)
            distance = _distances(planar, node[new] + low, other[new], cell)
            closer = distance < best[new]
            best[new[closer]], found[new[closer]] = distance[closer], other[new[closer]]
    return best, found


def _distances(
    planar: PlanarTriangles,
    node: Int64[np.ndarray, "N 3"],
    triangle: Int64[np.ndarray, " N"],
    cell: float,
) -> Float32[np.ndarray, " N"]:
    """Exact distance from each node to its triangle."""
    found = np.zeros(len(node), dtype=np.float32)
    for start in range(0, len(node), 300_000):
        part = slice(start, start + 300_000)
        found[part] = planar.distance((node[part] * cell).astype(np.float32), triangle[part])
    return found

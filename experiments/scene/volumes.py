"""Baking a room's signed distance and nearest-label volumes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float, Float32, UInt8

from experiments.scene.furniture_distance import Solid, furniture_distance
from experiments.scene.scene import MPCAT40, Volumes

WALL, FLOOR = MPCAT40.index("wall"), MPCAT40.index("floor")
MARGIN = 0.2
"""How far the grid reaches beyond the walls and below the floor, metres."""
TOP = 2.4
"""Height up to which the grid reaches, metres; above it the border values hold."""
Axes = tuple[Float[np.ndarray, " X"], Float[np.ndarray, " Y"], Float[np.ndarray, " Z"]]


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
        furniture, label = furniture_distance(solids, room_size, origin, shape, cell, on_step)
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

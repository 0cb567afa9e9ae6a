"""Small made-up rooms, baked for real: for tests, examples and first steps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from experiments.scene.assembly import assemble
from experiments.scene.objects import MaterialPart, PlacedObject
from experiments.scene.scene import MPCAT40, Scene

Box = tuple[tuple[float, float, float], tuple[float, float, float], str]
"""Lower corner, upper corner in metres, mpcat40 class name."""

SEAT: Mapping[str, Box] = {"seat": ((1.2, 1.5, 0.0), (1.8, 2.0, 0.45), "chair")}


def synthetic_room(
    boxes: Mapping[str, Box] = SEAT,
    size: tuple[float, float, float] = (3.0, 3.0, 2.4),
    cell: float = 0.05,
    thickness: float = 0.01,
    scene_id: str = "synthetic",
) -> Scene:
    """A rectangular room with axis-aligned boxes as furniture; about 0.1 s of baking.

    Its exact distance has a closed form: the minimum over the boxes and the five planes.
    """
    objects = [box_object(name, *box) for name, box in boxes.items()]
    return assemble(scene_id, size, objects, cell=cell, thickness=thickness)


def box_object(
    name: str,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    class_name: str,
    *,
    on: str | None = None,
    wall: str | None = None,
) -> PlacedObject:
    """A plain grey box from `low` to `high` (room frame, metres)."""
    corners, normals = _box_triangles(np.array(low), np.array(high))
    return PlacedObject(
        id=name,
        asset="box",
        label=MPCAT40.index(class_name),
        x=(low[0] + high[0]) / 2,
        y=(low[1] + high[1]) / 2,
        z=low[2],
        yaw_deg=0.0,
        parts=(MaterialPart(corners, normals, colour=(0.6, 0.6, 0.6)),),
        on=on,
        wall=wall,
    )


def _box_triangles(
    low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "12 3 3"], Float[np.ndarray, "12 3 3"]]:
    """Twelve outward triangles of a box and their normals."""
    corners, normals = [], []
    for axis in range(3):
        for side, sign in ((0, -1.0), (1, 1.0)):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])[:: int(sign)]
            unit = np.zeros((4, 3))
            unit[:, axis], unit[:, u], unit[:, v] = side, square[:, 0], square[:, 1]
            quad = low + unit * (high - low)
            corners += [quad[[0, 1, 2]], quad[[0, 2, 3]]]
            normals += [np.broadcast_to(sign * np.eye(3)[axis], (3, 3))] * 2
    return np.array(corners, dtype=np.float32), np.array(normals, dtype=np.float32)

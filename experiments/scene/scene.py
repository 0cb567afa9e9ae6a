"""Scene: the labelled triangle mesh of a room and its baked volumes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Integer, UInt8

MPCAT40: tuple[str, ...] = (
    "void", "wall", "floor", "chair", "door", "table", "picture", "cabinet", "cushion", "window",
    "sofa", "bed", "curtain", "chest_of_drawers", "plant", "sink", "stairs", "ceiling", "toilet",
    "stool", "towel", "mirror", "tv_monitor", "shower", "column", "bathtub", "counter", "fireplace",
    "lighting", "beam", "railing", "shelving", "blinds", "gym_equipment", "seating", "board_panel",
    "furniture", "appliances", "clothes", "objects", "misc", "unlabeled",
)  # fmt: skip
N_CLASSES = len(MPCAT40)


@dataclass(frozen=True)
class Instance:
    """One object of a scene, the shell (floor, walls) included."""

    id: str
    asset: str
    label: int
    """mpcat40 class index."""
    pose: dict[str, float]
    """x, y, z in metres and yaw in degrees counter-clockwise from above."""
    aabb: tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class Volumes:
    """Signed distance and nearest-label grids over a scene.

    Node-centred: the value at index (i, j, k) is that of the point `origin + cell * (i, j, k)`, and
    interpolation is corner-aligned. Distance is negative inside solids, below the floor and outside
    the walls; there is no ceiling. `thickened` is `sdf` with half a centimetre-scale thickness
    (`thickness` metres) subtracted on both sides of furniture, so that thin boards register:
    placement may read it, metrics read `sdf`.
    """

    sdf: Float[np.ndarray, "X Y Z"]
    thickened: Float[np.ndarray, "X Y Z"]
    label: UInt8[np.ndarray, "X Y Z"]
    origin: tuple[float, float, float]
    cell: float
    thickness: float


@dataclass(frozen=True)
class Scene:
    """A room: z up, metres, origin at the south-west floor corner, x east, y north."""

    scene_id: str
    vertices: Float[np.ndarray, "V 3"]
    faces: Integer[np.ndarray, "F 3"]
    vertex_label: UInt8[np.ndarray, " V"]
    vertex_instance: Integer[np.ndarray, " V"]
    """Index into `instances`."""
    instances: tuple[Instance, ...]
    room_size: tuple[float, float, float]
    floor_z: float
    volumes: Volumes
    content_hash: str
    meta: dict[str, Any] = field(default_factory=dict)

    def class_names(self) -> tuple[str, ...]:
        """The class names that occur in this scene, without void."""
        present = np.unique(self.vertex_label)
        return tuple(MPCAT40[index] for index in present if index != 0)

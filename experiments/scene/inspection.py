"""Inspecting a room: the layout checks on a layout, or on the mesh of a scene folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from experiments.scene.drawing import draw_labels, draw_plan, draw_slices
from experiments.scene.furnish import furnish
from experiments.scene.layout import Opening, read_layout
from experiments.scene.layout_checks import LayoutReport, check_layout
from experiments.scene.objects import MaterialPart, PlacedObject
from experiments.scene.scene import MPCAT40, Scene
from experiments.scene.scene_folder import is_scene_folder, read_scene
from experiments.scene.settle import surface_heights
from experiments.scene.walk import WalkMap

_NEAR = 0.05
"""Metres between a thing and what it is taken to stand on or hang from."""


@dataclass(frozen=True)
class Inspection:
    """A room with what the checks found."""

    report: LayoutReport
    walk: WalkMap
    size: tuple[float, float, float]
    objects: tuple[PlacedObject, ...]
    openings: tuple[Opening, ...]


def inspect_room(name_or_dir: str | Path) -> Inspection:
    """Check a room by name, a layout file, or a scene folder; InputError if there is none."""
    if is_scene_folder(name_or_dir):
        scene = read_scene(Path(name_or_dir))
        name, size = scene.scene_id, scene.room_size
        openings: tuple[Opening, ...] = ()
        objects = scene_objects(scene)
    else:
        layout = read_layout(name_or_dir)
        name, size, openings = layout.name, layout.size, layout.openings
        objects = furnish(layout)
    report, walk = check_layout(name, size, objects)
    return Inspection(report, walk, size, objects, openings)


def draw_room(inspection: Inspection, scene: Scene, folder: Path) -> list[Path]:
    """Write plan, label and distance pictures of a room into a folder."""
    name = inspection.report.name
    plan, labels, slices = (folder / f"{name}_{what}.png" for what in ("plan", "labels", "slices"))
    draw_plan(plan, name, inspection.size, inspection.objects, inspection.walk, inspection.openings)
    draw_labels(labels, scene)
    draw_slices(slices, scene)
    return [plan, labels, slices]


def scene_objects(scene: Scene) -> tuple[PlacedObject, ...]:
    """The furniture of a scene mesh; supports and walls, which a mesh does not tell, are inferred.

    What reaches lower than 3 cm stands on the floor; else it stands on the object whose surface is
    within 5 cm under it, or belongs to the wall that it is nearest to.
    """
    owner = scene.vertex_instance[scene.faces[:, 0]]
    triangles: dict[int, Float[np.ndarray, "F 3 3"]] = {}
    for index, instance in enumerate(scene.instances):
        shell = MPCAT40[instance.label] in ("wall", "ceiling", "window", "door")
        soup = scene.vertices[scene.faces[owner == index]].astype(float)
        if not shell and instance.id != "floor" and len(soup):
            triangles[index] = soup - np.array([0.0, 0.0, scene.floor_z])
    return tuple(_as_object(index, scene, triangles) for index in triangles)


def _as_object(
    index: int, scene: Scene, triangles: dict[int, Float[np.ndarray, "F 3 3"]]
) -> PlacedObject:
    instance, soup = scene.instances[index], triangles[index]
    support = None if soup[..., 2].min() < 0.03 else _support(index, triangles)
    hangs = soup[..., 2].min() >= 0.03 and support is None
    grey = MaterialPart(soup, np.zeros_like(soup), (0.5, 0.5, 0.5))
    return PlacedObject(
        id=instance.id,
        asset=instance.asset,
        label=instance.label,
        x=instance.pose["x"],
        y=instance.pose["y"],
        z=instance.pose["z"],
        yaw_deg=instance.pose["yaw_deg"],
        parts=(grey,),
        on=None if support is None else scene.instances[support].id,
        wall=_nearest_wall(soup, scene.room_size) if hangs else None,
        soft=MPCAT40[instance.label] in ("cushion", "bed") and support is not None,
    )


def _support(index: int, triangles: dict[int, Float[np.ndarray, "F 3 3"]]) -> int | None:
    """The object whose surface is nearest below the middle of this one."""
    points = triangles[index].reshape(-1, 3)
    middle, bottom = points[:, :2].mean(0, keepdims=True), float(points[:, 2].min())
    best, found = _NEAR, None
    for other, soup in triangles.items():
        low, high = soup[..., :2].min((0, 1)), soup[..., :2].max((0, 1))
        if other != index and np.all(middle[0] >= low) and np.all(middle[0] <= high):
            gap = abs(float(surface_heights(soup, middle)[0]) - bottom)
            if gap < best:
                best, found = gap, other
    return found


def _nearest_wall(soup: Float[np.ndarray, "F 3 3"], size: Sequence[float]) -> str:
    low, high = soup.min((0, 1)), soup.max((0, 1))
    gaps = {"w": low[0], "s": low[1], "e": size[0] - high[0], "n": size[1] - high[1]}
    return min(gaps, key=lambda wall: abs(gaps[wall]))

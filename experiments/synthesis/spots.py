"""Spots of a room: where a body can stand, and where furniture affords sitting, lying or touching.

The published method has sub-goal positions placed by hand or sampled. These are found from the room's
geometry and classes alone, so that any labelled room will do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float

from experiments.body.measures import body_measures
from experiments.body.model import BodyModel
from experiments.motion.rotations import UPRIGHT, about
from experiments.scene.lookup import SceneLookup
from experiments.scene.scene import MPCAT40, Scene
from experiments.scene.surface import surface_samples

Kind = Literal["stand", "sit", "lie", "touch"]
SEATS = ("chair", "sofa", "stool", "seating", "bed", "toilet")
BEDS = ("bed", "sofa", "seating")
FRONTS = ("table", "counter", "shelving", "cabinet", "chest_of_drawers", "appliances", "sink")
CELL_M, SAMPLE_M = 0.1, 0.08
BODY_RADIUS_M = 0.25
"""Least distance of a standing body's axis from everything but the floor."""
SEAT_HEIGHT_M, BED_HEIGHT_M = (0.33, 0.65), (0.28, 0.75)
TOUCH_HEIGHTS_M = (0.75, 1.1, 1.4)
TOUCH_REACH_M = (0.28, 0.45)
"""Distance of a standing body's axis from what its hands can touch."""
N_HEADINGS = 16


@dataclass(frozen=True)
class Spot:
    """A root state that suits a place: what the sub-goal network is asked for."""

    kind: Kind
    place: str
    """Id of the piece of furniture, or "floor"."""
    pelvis: Float[np.ndarray, "3"]
    """Room frame, z up, metres."""
    orientation: Float[np.ndarray, "3 3"]
    """World rotation of the root."""


@dataclass(frozen=True)
class RoomSpots:
    """All spots of a room for one body."""

    free: Float[np.ndarray, "N 2"]
    """Floor positions where the body can stand, metres."""
    furniture: dict[tuple[str, Kind], tuple[Spot, ...]]
    """Spots by (piece of furniture, kind)."""
    standing_z: float
    """Height of the pelvis of a standing body."""


def room_spots(scene: Scene, body: BodyModel) -> RoomSpots:
    """Find every spot of a room; deterministic."""
    free = free_floor(scene)
    rest = _rest_vertices(body)
    standing = scene.floor_z - float(rest[body.body_component, 1].min())
    found = [*_sitting(scene, body), *_lying(scene, rest, body), *_touching(scene, free, standing)]
    groups: dict[tuple[str, Kind], list[Spot]] = {}
    for spot in found:
        groups.setdefault((spot.place, spot.kind), []).append(spot)
    furniture = {key: tuple(groups[key]) for key in sorted(groups)}
    return RoomSpots(free, furniture, standing)


def free_floor(scene: Scene) -> Float[np.ndarray, "N 2"]:
    """Cell centres where a disc of `BODY_RADIUS_M` fits at every height up to 1.7 m."""
    x = np.arange(CELL_M / 2, scene.room_size[0], CELL_M)
    y = np.arange(CELL_M / 2, scene.room_size[1], CELL_M)
    cells = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    height = np.arange(0.1, 1.75, 0.1)
    points = np.concatenate(
        [
            np.repeat(cells[:, None], len(height), axis=1),
            np.broadcast_to(scene.floor_z + height[:, None], (len(cells), len(height), 1)),
        ],
        axis=-1,
    )
    # Near the floor the floor itself is closer than the radius.
    wanted = np.minimum(BODY_RADIUS_M, height - 0.02)
    free = (_reader(scene)(points) > wanted).all(axis=1)
    return np.asarray(cells[free])


def heading(yaw: float) -> Float[np.ndarray, "3"]:
    """The horizontal direction in which an upright body of that yaw (rad) looks: -y at yaw 0."""
    return np.array([np.sin(yaw), -np.cos(yaw), 0.0])


def upright(yaw: float) -> Float[np.ndarray, "3 3"]:
    """Root rotation of an upright body that looks along `heading(yaw)`."""
    return np.asarray(about("z", float(np.degrees(yaw))) @ UPRIGHT)


def _sitting(scene: Scene, body: BodyModel) -> list[Spot]:
    """Seats: free above and for the legs ahead, a back rest behind where the piece has one."""
    measures = body_measures(body)  # type: ignore[arg-type]  # bodies hash by identity
    hips = float(body.rest_joints[1:3, 1].mean() - body.rest_joints[0, 1])
    rise = measures.seat_offset - hips
    distance = _reader(scene)
    found: list[Spot] = []
    for place, points in _tops(scene, SEATS, SEAT_HEIGHT_M).items():
        open_above = np.all([distance(_up(points, h)) > 0.12 for h in (0.25, 0.55)], axis=0)
        spots, backed = [], []
        for yaw in _YAWS:
            ahead = heading(yaw)
            feet = points + 0.5 * ahead
            shins = _up(feet, -0.1)
            feet[:, 2] = scene.floor_z + 0.12
            edge = _up(points + 0.12 * ahead, -0.03)
            good = open_above & (distance(feet) > 0.06) & (distance(shins) > 0.05)
            good &= distance(edge) < 0.02
            rest = [distance(_up(points - 0.28 * ahead, h)) for h in (0.2, 0.3, 0.4)]
            for index in np.flatnonzero(good):
                pelvis = _up(points[index : index + 1], rise)[0]
                spots.append(Spot("sit", place, pelvis, upright(yaw)))
                backed.append(min(float(value[index]) for value in rest) < 0.08)
        found += [spot for spot, back in zip(spots, backed, strict=True) if back or not any(backed)]
    return found


def _lying(scene: Scene, rest: Float[np.ndarray, "V 3"], body: BodyModel) -> list[Spot]:
    """Surfaces long enough to lie on the back, pelvis over the point, head along the heading."""
    rise = float(body.rest_joints[0, 2] - rest[body.regions["buttocks"], 2].min())
    distance = _reader(scene)
    found = []
    for place, points in _tops(scene, BEDS, BED_HEIGHT_M).items():
        for yaw in _YAWS:
            along = heading(yaw)
            across = np.cross(along, [0.0, 0.0, 1.0])
            held = [distance(_up(points + s * along + t * across, -0.06)) < 0.0 for s, t in _HELD]
            clear = [distance(_up(points + s * along, 0.25)) > 0.08 for s in _CLEAR]
            for index in np.flatnonzero(np.all(held + clear, axis=0)):
                # Columns: where the body's left, head and front point.
                turn = np.stack([across, along, np.array([0.0, 0.0, 1.0])], axis=1)
                found.append(Spot("lie", place, _up(points[index : index + 1], rise)[0], turn))
    return found


def _touching(scene: Scene, free: Float[np.ndarray, "N 2"], standing_z: float) -> list[Spot]:
    """Free floor within reach of the front of a piece of furniture, facing it."""
    lookup = SceneLookup(scene)
    wanted = [MPCAT40.index(name) for name in FRONTS]
    found: dict[tuple[float, float], Spot] = {}
    for height in TOUCH_HEIGHTS_M:
        level = np.full((len(free), 1), scene.floor_z + height)
        points = torch.tensor(np.concatenate([free, level], axis=1), dtype=torch.float32)
        points.requires_grad_(True)
        distance, label = lookup.distance(points), lookup.label(points).numpy()
        away = torch.autograd.grad(distance.sum(), points)[0].double().numpy()
        reach = distance.detach().double().numpy()
        near = (reach > TOUCH_REACH_M[0]) & (reach < TOUCH_REACH_M[1]) & np.isin(label, wanted)
        near &= np.hypot(away[:, 0], away[:, 1]) > 0.9
        for index in np.flatnonzero(near):
            yaw = float(np.arctan2(-away[index, 0], away[index, 1]))
            touched = points.detach().double().numpy()[index] - reach[index] * away[index]
            place = _instance_at(scene, touched, int(label[index]))
            pelvis = np.array([*free[index], standing_z])
            found[tuple(free[index])] = Spot("touch", place, pelvis, upright(yaw))
    return list(found.values())


_YAWS = tuple(2 * np.pi * np.arange(N_HEADINGS) / N_HEADINGS)
_HELD = (
    (-0.8, 0.0),
    (-0.4, 0.0),
    (0.0, 0.15),
    (0.0, -0.15),
    (0.35, 0.15),
    (0.35, -0.15),
    (0.6, 0.0),
)
"""Along and across the lying body, metres from the pelvis: where the surface must be."""
_CLEAR = (-0.9, -0.6, -0.3, 0.0, 0.35, 0.7)


def _tops(
    scene: Scene, classes: tuple[str, ...], heights: tuple[float, float]
) -> dict[str, Float[np.ndarray, "N 3"]]:
    """Points on level surfaces of those classes and heights over the floor, by object id."""
    corners = scene.vertices[scene.faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = np.abs(normals[:, 2]) > 0.8 * np.linalg.norm(normals, axis=1)
    labels = [MPCAT40.index(name) for name in classes]
    above = corners[..., 2].mean(1) - scene.floor_z
    chosen = level & np.isin(scene.vertex_label[scene.faces[:, 0]], labels)
    chosen &= (above > heights[0]) & (above < heights[1])
    owner = scene.vertex_instance[scene.faces[:, 0]]
    distance = _reader(scene)
    tops = {}
    for index in np.unique(owner[chosen]):
        faces = np.flatnonzero(chosen & (owner == index))
        # The first samples are the faces' centroids: too many where the mesh is fine.
        points = surface_samples(corners[faces], SAMPLE_M)[0][len(faces) :]
        # Undersides and what lies under a cushion are no seat.
        points = points[distance(_up(points, 0.06)) > 0.03]
        if len(points):
            tops[scene.instances[index].id] = points
    return tops


def _instance_at(scene: Scene, point: Float[np.ndarray, "3"], label: int) -> str:
    """Id of the object of that class whose box is nearest to a point."""
    nearest, name = np.inf, MPCAT40[label]
    for instance in scene.instances:
        if instance.label == label:
            low, high = (np.array(corner) for corner in instance.aabb)
            gap = float(np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0.0)))
            if gap < nearest:
                nearest, name = gap, instance.id
    return name


def _reader(scene: Scene) -> Callable[[Float[np.ndarray, "*N 3"]], Float[np.ndarray, "*N"]]:
    lookup = SceneLookup(scene)

    def distance(points: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N"]:
        read = lookup.distance(torch.tensor(points, dtype=torch.float32))
        return np.asarray(read.double().numpy())

    return distance


def _up(points: Float[np.ndarray, "N 3"], height: float) -> Float[np.ndarray, "N 3"]:
    return np.asarray(points + np.array([0.0, 0.0, height]))


def _rest_vertices(body: BodyModel) -> Float[np.ndarray, "V 3"]:
    zero = torch.zeros((1, 22, 3), dtype=torch.float64)
    return np.asarray(body.posed(zero, zero[:, 0]).vertices[0].numpy())

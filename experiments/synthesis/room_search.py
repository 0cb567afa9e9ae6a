"""Where a window fits into a room: rejection sampling with the room's signed distance.

Nothing learned takes part: candidates are drawn at random, and those that collide, or do not touch
what they should touch, are refused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float

from experiments.scene.lookup import SceneLookup
from experiments.scene.scene import MPCAT40, Scene
from experiments.synthesis.windows import PosedWindow

DEPTH_M = 0.03
"""How far a marker may be inside something: skin gives way, and soles are not flat."""
SEAT_DEPTH_M = 0.06
"""The same for a body that sits or lies: cushions give way."""
CONTACT_M = 0.035
"""Mean distance of the carrying markers, or least distance of the palm, from a surface."""
_WALK_CLEARANCE_M = 0.2
_WALK_HEIGHTS = np.arange(0.3, 1.7, 0.08)
_CANDIDATES = {"none": 1500, "seat": 300, "hands": 300}
_CHECKED = 8
_YAW_DEG = 15.0
_SEATS = ("chair", "stool", "sofa", "seating", "bed")
_TOUCHED = ("table", "cabinet", "shelving", "counter", "appliances", "chest_of_drawers", "sink")


@dataclass(frozen=True)
class Spot:
    """A rigid placement: turn about the vertical through x = y = 0, then shift. Radians, metres."""

    yaw: float
    shift: Float[np.ndarray, "2"]


class RoomSearch:
    """One room, ready to have many windows placed in it."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.lookup = SceneLookup(scene)
        volumes = scene.volumes
        levels = np.round((_WALK_HEIGHTS - volumes.origin[2]) / volumes.cell).astype(int)
        self._free = volumes.sdf[:, :, levels].min(axis=2) > _WALK_CLEARANCE_M
        self._free_xy = np.argwhere(self._free) * volumes.cell + np.array(volumes.origin[:2])

    def place(self, window: PosedWindow, rng: np.random.Generator) -> Spot | None:
        """A collision-free spot that has the contact the window wants; None if none was found."""
        yaw, shift = self._drawn(window, rng)
        if not len(yaw):
            return None
        if window.support == "none":
            good = self._on_free_floor(window, yaw, shift)
        else:
            good = self._touching(window, yaw, shift)
        for index in np.flatnonzero(good)[:_CHECKED]:
            spot = Spot(float(yaw[index]), shift[index])
            if self.depth(window, spot) <= allowed_depth(window):
                return spot
        return None

    def depth(self, window: PosedWindow, spot: Spot) -> float:
        """How deep the deepest marker of any frame is inside something, metres; 0 outside."""
        distance = self._distance(at_spot(window.points, spot))
        return max(0.0, -float(distance.min()))

    def touch(self, window: PosedWindow, spot: Spot) -> float:
        """How far what should touch is from a surface in the window's still frame, metres."""
        points = at_spot(window.points[window.frame, window.rows], spot)
        return float(_touch(window, self._distance(points)[None])[0])

    def _drawn(
        self, window: PosedWindow, rng: np.random.Generator
    ) -> tuple[Float[np.ndarray, " C"], Float[np.ndarray, "C 2"]]:
        """Random turns and shifts: anywhere on the free floor, or at furniture of the right class."""
        count = _CANDIDATES[window.support]
        if window.support == "none":
            yaw = rng.uniform(-np.pi, np.pi, count)
            if not len(self._free_xy):
                return yaw[:0], np.zeros((0, 2))
            return yaw, self._free_xy[rng.integers(len(self._free_xy), size=count)]
        wanted = _SEATS if window.support == "seat" else _TOUCHED
        pieces = [i for i in self.scene.instances if MPCAT40[i.label] in wanted]
        if not pieces:
            return np.zeros(0), np.zeros((0, 2))
        chosen = [pieces[k] for k in rng.integers(len(pieces), size=count)]
        low, high = (np.array([piece.aabb[k][:2] for piece in chosen]) for k in (0, 1))
        target = rng.uniform(low, high)
        front = np.radians([piece.pose["yaw_deg"] for piece in chosen])
        quarter = np.pi if window.support == "hands" else 0.0
        beds = np.array([MPCAT40[piece.label] in ("bed", "stool", "table") for piece in chosen])
        turns = np.where(beds, rng.integers(4, size=count) * np.pi / 2, quarter)
        yaw = front + turns + np.radians(rng.uniform(-_YAW_DEG, _YAW_DEG, count))
        middle = window.points[window.frame, window.rows].mean(axis=0)[None]
        moved = spun(np.repeat(middle[None], count, axis=0), yaw, np.zeros((count, 2)))[:, 0]
        return yaw, target - moved[:, :2]

    def _on_free_floor(
        self, window: PosedWindow, yaw: Float[np.ndarray, " C"], shift: Float[np.ndarray, "C 2"]
    ) -> Bool[np.ndarray, " C"]:
        """Whether the middle of the body stays on the free floor all the way."""
        path = window.points.mean(axis=1)[None].repeat(len(yaw), axis=0)
        moved = spun(path, yaw, shift)[..., :2]
        volumes = self.scene.volumes
        index = np.round((moved - np.array(volumes.origin[:2])) / volumes.cell).astype(int)
        inside = np.all((index >= 0) & (index < self._free.shape), axis=-1)
        index = np.clip(index, 0, np.array(self._free.shape) - 1)
        return np.asarray((inside & self._free[index[..., 0], index[..., 1]]).all(axis=1))

    def _touching(
        self, window: PosedWindow, yaw: Float[np.ndarray, " C"], shift: Float[np.ndarray, "C 2"]
    ) -> Bool[np.ndarray, " C"]:
        """Whether the still frame touches and does not collide."""
        points = window.points[window.frame][None].repeat(len(yaw), axis=0)
        distance = self._distance(spun(points, yaw, shift))
        free = distance.min(axis=1) > -allowed_depth(window)
        return np.asarray(free & (_touch(window, distance[:, window.rows]) < CONTACT_M))

    def _distance(self, points: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N"]:
        with torch.no_grad():
            return np.asarray(self.lookup.distance(torch.from_numpy(points).float()).double())


def allowed_depth(window: PosedWindow) -> float:
    """How deep markers of this window may be inside things, metres."""
    return SEAT_DEPTH_M if window.support == "seat" else DEPTH_M


def at_spot(points: Float[np.ndarray, "*N 3"], spot: Spot) -> Float[np.ndarray, "*N 3"]:
    """Points (m) of a window in the room's frame."""
    moved = spun(points.reshape(1, -1, 3), np.array([spot.yaw]), spot.shift[None])
    return moved.reshape(points.shape)


def spun(
    points: Float[np.ndarray, "C N 3"],
    yaw: Float[np.ndarray, " C"],
    shift: Float[np.ndarray, "C 2"],
) -> Float[np.ndarray, "C N 3"]:
    """C sets of points (m), each turned by its yaw (rad) about the vertical axis, then shifted."""
    cosine, sine = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y = points[..., 0], points[..., 1]
    turned = [cosine * x - sine * y + shift[:, :1], sine * x + cosine * y + shift[:, 1:]]
    return np.stack([*turned, points[..., 2]], axis=-1)


def _touch(window: PosedWindow, distance: Float[np.ndarray, "C K"]) -> Float[np.ndarray, " C"]:
    """Mean distance of all carrying markers, or the least of the palm's."""
    size = np.abs(distance)
    return np.asarray(size.mean(axis=1) if window.support == "seat" else size.min(axis=1))

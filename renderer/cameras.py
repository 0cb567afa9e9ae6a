"""Cameras: four views of a motion in a room, the same for every method that is compared.

The rig is chosen once per (scene, motion) from the room and the bodies of all study methods, so
that the camera tells nothing about the method whose clip is on the screen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Integer

from renderer.cutaway import Cutaway
from renderer.files import InputError
from renderer.framing import fit_camera, swept_box
from renderer.settings import RenderSettings
from renderer.stage import StagePart
from renderer.visibility import BodySamples, sample_bodies

YFOV_DEG = 32.0
ELEVATIONS_DEG = (32.0, 25.0, 40.0)
"""In order of preference: an equal score takes the earlier one."""
OFFSETS_DEG = (45.0, 30.0, 60.0, 15.0, 75.0, 0.0)
"""Azimuth of the first of four views 90 degrees apart, corner views preferred."""
CORNER_BONUS = 0.08
"""Score that a fully corner-on rig may give up before a more frontal one replaces it."""
NEAR_M, FAR_M = 0.1, 60.0


@dataclass(frozen=True)
class CameraView:
    """One fixed camera: looks along its -z axis, y up; the room groups it must not see."""

    name: str
    pose: tuple[tuple[float, ...], ...]
    """Camera to world, 4x4, metres."""
    yfov: float
    """Vertical field of view in radians."""
    hidden: tuple[str, ...]
    azimuth_deg: float
    elevation_deg: float
    score: float
    """Visible share of the body, mean over the key frames of the worst-seen method."""
    worst: float
    """The same in the worst key frame."""

    @property
    def matrix(self) -> Float[np.ndarray, "4 4"]:
        """`pose` as an array."""
        return np.array(self.pose)


@dataclass(frozen=True)
class CameraRig:
    """The views of one (scene, motion), in the order in which they are tiled."""

    views: tuple[CameraView, ...]

    @property
    def score(self) -> float:
        """The lowest score of the views: what the choice maximises."""
        return min(view.score for view in self.views)

    def view(self, name: str) -> CameraView:
        """The view of this name; `InputError` if there is none."""
        for view in self.views:
            if view.name == name:
                return view
        names = ", ".join(view.name for view in self.views)
        raise InputError("camera rig", "view", name, f"one of {names}")

    def best(self) -> CameraView:
        """The view that shows most of the body (the first of equals)."""
        return max(self.views, key=lambda view: (view.score, view.worst))

    def to_dict(self) -> dict[str, Any]:
        """As JSON values, for the catalogue."""
        views = [
            {
                "name": view.name, "pose": [list(row) for row in view.pose], "yfov": view.yfov,
                "hidden": list(view.hidden), "azimuth_deg": view.azimuth_deg,
                "elevation_deg": view.elevation_deg, "score": view.score, "worst": view.worst,
            }
            for view in self.views
        ]  # fmt: skip
        return {"score": self.score, "views": views}

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> CameraRig:
        """Read back what `to_dict` wrote."""
        return cls(tuple(_read_view(raw) for raw in record["views"]))


def choose_cameras(
    parts: Sequence[StagePart],
    room_size: tuple[float, float, float],
    floor_z: float,
    bodies: Sequence[Float[np.ndarray, "_ V 3"]],
    regions: Mapping[str, Integer[np.ndarray, " _"]],
    faces: Integer[np.ndarray, "G 3"],
    settings: RenderSettings,
) -> CameraRig:
    """Four views 90 degrees apart that maximise the visibility of the worst view.

    `bodies` are the vertices (metres, z up) of every study method's answer to this (scene,
    motion). Candidates are 6 azimuth offsets x 3 elevations, each framing the swept box of all
    bodies; the score of a view is the share of camera-facing body surface that the room (after
    the cutaway) does not hide, feet and pelvis weighted up. Deterministic: no randomness.
    """
    _require_bodies(bodies, faces)
    box = swept_box(bodies, room_size, floor_z)
    samples = sample_bodies(bodies, faces, regions, room_size, floor_z)
    cutaway = Cutaway.of_room(parts, room_size, floor_z)
    best: tuple[CameraView, ...] = ()
    best_value = -math.inf
    for offset in OFFSETS_DEG:
        views = tuple(
            _best_elevation(f"view-{k + 1}", offset + 90 * k, box, samples, cutaway, settings)
            for k in range(4)
        )
        corner_on = 1 - abs(offset - 45) / 45
        value = min(_merit(view) for view in views) + CORNER_BONUS * corner_on
        if value > best_value + 1e-9:
            best, best_value = views, value
    return CameraRig(best)


def single_camera(
    pose: Float[np.ndarray, "4 4"], yfov: float, hidden: Sequence[str] = (), name: str = "free"
) -> CameraRig:
    """A rig of one hand-made camera, for stills and turntables."""
    rows = tuple(tuple(float(x) for x in row) for row in pose)
    return CameraRig((CameraView(name, rows, yfov, tuple(hidden), 0.0, 0.0, 1.0, 1.0),))


def _best_elevation(
    name: str,
    azimuth_deg: float,
    box: Float[np.ndarray, "2 3"],
    samples: BodySamples,
    cutaway: Cutaway,
    settings: RenderSettings,
) -> CameraView:
    views = [
        _score_view(name, azimuth_deg, elevation, box, samples, cutaway, settings)
        for elevation in ELEVATIONS_DEG
    ]
    # Rounding lets the preferred elevation win where the others gain next to nothing.
    return max(views, key=lambda view: round(_merit(view), 2))


def _merit(view: CameraView) -> float:
    """What the choice maximises: the mean, with the worst frame as a partner of lesser weight."""
    return 0.7 * view.score + 0.3 * view.worst


def _score_view(
    name: str,
    azimuth_deg: float,
    elevation_deg: float,
    box: Float[np.ndarray, "2 3"],
    samples: BodySamples,
    cutaway: Cutaway,
    settings: RenderSettings,
) -> CameraView:
    yfov = math.radians(YFOV_DEG)
    pose = fit_camera(box, azimuth_deg, elevation_deg, yfov, settings.width / settings.height)
    hidden = cutaway.hidden_from(pose[:3, 3], box, samples)
    per_frame = cutaway.visible_fraction(pose[:3, 3], samples, hidden)
    rows = tuple(tuple(round(float(x), 9) for x in row) for row in pose)
    return CameraView(
        name=name,
        pose=rows,
        yfov=yfov,
        hidden=tuple(sorted(hidden)),
        azimuth_deg=azimuth_deg % 360,
        elevation_deg=elevation_deg,
        score=round(float(per_frame.mean(axis=1).min()), 6),
        worst=round(float(per_frame.min()), 6),
    )


def _read_view(raw: Mapping[str, Any]) -> CameraView:
    pose = tuple(tuple(float(x) for x in row) for row in raw["pose"])
    return CameraView(**{**raw, "pose": pose, "hidden": tuple(raw["hidden"])})


def _require_bodies(bodies: Sequence[np.ndarray], faces: np.ndarray) -> None:
    if not bodies:
        raise InputError("cameras", "bodies", 0, "the vertices of at least one body")
    for index, vertices in enumerate(bodies):
        if len(vertices) == 0:
            raise InputError("cameras", f"bodies[{index}]", "0 frames", "at least one frame")
        if not np.isfinite(vertices).all():
            frame = int(np.argmin(np.isfinite(vertices).all(axis=(1, 2))))
            raise InputError(
                "cameras", f"bodies[{index}]", f"not finite in frame {frame}", "finite numbers"
            )
    if len(faces) and int(faces.max()) >= min(vertices.shape[1] for vertices in bodies):
        raise InputError("cameras", "faces", int(faces.max()), "indices of existing vertices")

"""Repair of artists' meshes: faces turned inside out, faces nobody can see, sheets seen from both sides.

Everything rests on one measure, the openness of a face's two sides: the share of rays from it that
leave the piece without hitting the piece again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Bool, Float

_DIRECTIONS = 24
_LIFT = 2e-4
"""Metres that a ray starts off its face."""
_KEEP_AREA = 0.004
"""Square metres above which a hidden face is never dropped: dropping those left holes in cabinets."""
_SHEET = 0.12
"""Openness of both sides from which a face counts as a sheet."""


@dataclass(frozen=True)
class Openness:
    """Share of rays that escape, per face and side."""

    front: Float[np.ndarray, " F"]
    back: Float[np.ndarray, " F"]


def openness(corners: Float[np.ndarray, "F 3 3"], from_above: bool = False) -> Openness:
    """Cast rays from four points of every face to both sides, against the piece alone.

    `from_above` counts rays that rise only: what cameras above the floor can see.
    """
    scene = EmbreeScene()
    TriangleMesh(scene, corners.astype(np.float32))
    normals = unit_normals(corners)
    centroid = corners.mean(1)
    points = [centroid, *(0.2 * centroid + 0.8 * corners[:, k] for k in range(3))]
    sides = np.zeros((2, len(corners)))
    counts = np.zeros((2, len(corners)))
    for direction in _sphere(2 * _DIRECTIONS if from_above else _DIRECTIONS):
        if from_above and direction[2] < 0.05:
            continue
        facing = normals @ direction
        side = (facing < 0).astype(int)
        lift = np.where(facing[:, None] < 0, -normals, normals) * _LIFT
        grazing = np.abs(facing) < 0.05
        for point in points:
            free = _escapes(scene, point + lift, direction) & ~grazing
            np.add.at(sides, (side, np.arange(len(corners))), free)
            np.add.at(counts, (side, np.arange(len(corners))), ~grazing)
    share = sides / np.maximum(counts, 1)
    return Openness(share[0], share[1])


def repaired(
    corners: Float[np.ndarray, "F 3 3"],
) -> tuple[Bool[np.ndarray, " F"], Bool[np.ndarray, " F"]]:
    """Which faces to keep, and which of them to flip."""
    sides = openness(corners)
    hidden = (sides.front == 0) & (sides.back == 0) & (areas(corners) <= _KEEP_AREA)
    return ~hidden, sides.back > sides.front + 1e-9


def sheets(corners: Float[np.ndarray, "F 3 3"]) -> Bool[np.ndarray, " F"]:
    """Faces that are seen from both sides (from above) and so need a reversed copy."""
    sides = openness(corners, from_above=True)
    return (sides.front > _SHEET) & (sides.back > _SHEET)


def areas(corners: Float[np.ndarray, "F 3 3"]) -> Float[np.ndarray, " F"]:
    """Face areas in square metres."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(cross, axis=1) / 2.0)


def unit_normals(corners: Float[np.ndarray, "F 3 3"]) -> Float[np.ndarray, "F 3"]:
    """Face normals; zero for degenerate faces."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-20))


def _escapes(
    scene: EmbreeScene, origins: Float[np.ndarray, "F 3"], direction: Float[np.ndarray, " 3"]
) -> Bool[np.ndarray, " F"]:
    directions = np.broadcast_to(direction, origins.shape).astype(np.float32)
    hit = scene.run(origins.astype(np.float32), np.ascontiguousarray(directions))
    return np.asarray(hit) < 0


def _sphere(n: int) -> Float[np.ndarray, "n 3"]:
    """Evenly spread directions: a Fibonacci lattice, turned off the axes."""
    k = np.arange(n) + 0.5
    polar = np.arccos(1 - 2 * k / n)
    azimuth = np.pi * (1 + 5**0.5) * k + 0.3
    sine = np.sin(polar)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)], 1)

"""Inside or outside, by vote: the sign of furniture meshes that are not watertight."""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Bool, Float, Float32

_MISSES_ALLOWED = 1


def enclosed(
    corners: Float[np.ndarray, "F 3 3"], points: Float[np.ndarray, "N 3"]
) -> Bool[np.ndarray, " N"]:
    """True where at least 25 of 26 directions from the point hit the object.

    Ray parity and winding numbers fail on catalogue furniture (open shells, overlapping parts,
    flipped faces); being surrounded does not depend on any of these. Metres; one object at a time,
    because a room would enclose everything in it.
    """
    scene = ray_scene(corners)
    misses = np.zeros(len(points), dtype=np.uint8)
    open_ = np.arange(len(points))
    origins = points.astype(np.float32)
    for direction in vote_directions():
        missed = ~occluded(scene, origins, np.broadcast_to(direction, origins.shape))
        misses[open_] += missed
        keep = misses[open_] <= _MISSES_ALLOWED
        open_, origins = open_[keep], origins[keep]
        if not len(open_):
            break
    return misses <= _MISSES_ALLOWED


def vote_directions() -> Float32[np.ndarray, "26 3"]:
    """Towards the 26 neighbours in a cubic grid, turned away from the axes, widely spread in order.

    Furniture stands along the axes: rays along them would run inside its faces and edges.
    """
    steps = np.array([step for step in np.ndindex(3, 3, 3) if step != (1, 1, 1)]) - 1.0
    unit = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    turned = unit @ _rotation(np.array([0.3, 0.5, 0.81]), 0.37).T
    # The most open directions first: upwards, then by turns to all sides.
    order = [int(np.argmax(turned[:, 2]))]
    while len(order) < len(turned):
        nearest = (turned @ turned[order].T).max(axis=1)
        nearest[order] = np.inf
        order.append(int(np.argmin(nearest)))
    spread: Float32[np.ndarray, "26 3"] = turned[order].astype(np.float32)
    return spread


def ray_scene(corners: Float[np.ndarray, "F 3 3"]) -> EmbreeScene:
    """An Embree scene of these triangles, metres."""
    scene = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(corners, dtype=np.float32))
    return scene


def occluded(
    scene: EmbreeScene,
    origins: Float32[np.ndarray, "N 3"],
    directions: Float32[np.ndarray, "N 3"],
    length: float = np.inf,
) -> Bool[np.ndarray, " N"]:
    """Whether each ray meets a triangle within `length` (in lengths of its direction)."""
    if not len(origins):
        return np.zeros(0, dtype=bool)
    reach = np.full(len(origins), min(length, 1e30), dtype=np.float32)
    hit = scene.run(origins, np.ascontiguousarray(directions), reach, query="OCCLUDED")
    found: Bool[np.ndarray, " N"] = np.asarray(hit >= 0)
    return found


def _rotation(axis: Float[np.ndarray, "3"], angle: float) -> Float[np.ndarray, "3 3"]:
    """Rotation matrix about an axis (Rodrigues), radians."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: Float[np.ndarray, "3 3"] = (
        np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    )
    return turned

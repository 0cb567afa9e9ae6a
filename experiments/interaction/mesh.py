"""The vertices that interaction features live on, and how they move and face in a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Integer

from experiments.body.model import JOINT_NAMES, BodyModel
from experiments.motion.motion import Motion


@dataclass(frozen=True)
class MovingBody:
    """Feature vertices of a motion. Axes T, V; world frame of the motion, metres, z up."""

    vertex_ids: Integer[np.ndarray, " V"]
    vertices: Float[np.ndarray, "T V 3"]
    normals: Float[np.ndarray, "T V 3"]
    """Outward unit normals."""
    joints: Float[np.ndarray, "T 22 3"]
    times: Float[np.ndarray, " T"]
    columns: dict[str, Integer[np.ndarray, " _"]]
    """The body's regions, and its head, as positions in `vertex_ids`."""

    def speed(self, points: Float[np.ndarray, "T *N 3"]) -> Float[np.ndarray, "T *N"]:
        """Speed of points by central differences, m/s."""
        velocity = np.gradient(points, self.times, axis=0)
        speed: Float[np.ndarray, "T *N"] = np.linalg.norm(velocity, axis=-1)
        return speed


def feature_vertices(body: BodyModel) -> Integer[np.ndarray, " V"]:
    """The small mesh, and points that thicken its soles, seat and back."""
    return np.union1d(body.subset, body.contact_rows).astype(np.int64)


def moving_body(motion: Motion, body: BodyModel) -> MovingBody:
    """Pose the feature vertices and find where they face."""
    ids = feature_vertices(body)
    touching = body.faces[np.isin(body.faces, ids).any(1)]
    ring = np.unique(np.concatenate([touching.ravel(), ids]))
    pose = torch.as_tensor(motion.pose, dtype=torch.float32)
    transl = torch.as_tensor(motion.transl, dtype=torch.float32)
    mesh = body.posed(pose, transl, ring)
    vertices = mesh.vertices.double().numpy()
    normals = _vertex_normals(vertices, np.searchsorted(ring, touching))
    columns = np.searchsorted(ring, ids)
    regions = {name: np.flatnonzero(np.isin(ids, part)) for name, part in body.regions.items()}
    joints = mesh.joints.double().numpy()
    distance = np.linalg.norm(vertices[0, columns, None] - joints[0, None], axis=-1)
    regions["head"] = np.flatnonzero(distance.argmin(1) == JOINT_NAMES.index("head"))
    return MovingBody(
        vertex_ids=ids,
        vertices=vertices[:, columns],
        normals=normals[:, columns],
        joints=joints,
        times=motion.times,
        columns=regions,
    )


def _vertex_normals(
    vertices: Float[np.ndarray, "T N 3"], faces: Integer[np.ndarray, "F 3"]
) -> Float[np.ndarray, "T N 3"]:
    corners = vertices[:, faces]
    areas = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals.swapaxes(0, 1), faces[:, corner], areas.swapaxes(0, 1))
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    unit: Float[np.ndarray, "T N 3"] = normals / np.maximum(length, 1e-12)
    return unit

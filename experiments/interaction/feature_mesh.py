"""The feature vertices as a closed mesh in body parts: what the networks know of the body's surface."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Integer

from experiments.body.model import JOINT_NAMES
from experiments.body.skinned_body import SkinnedBody
from experiments.interaction.mesh import feature_vertices

PART_OF_JOINT: dict[str, str] = {
    "pelvis": "seat", "left_hip": "seat", "right_hip": "seat",
    "spine1": "back", "spine2": "back", "spine3": "back", "left_collar": "back",
    "right_collar": "back", "neck": "head", "head": "head",
    "left_knee": "left_shin", "right_knee": "right_shin",
    "left_ankle": "left_foot", "right_ankle": "right_foot",
    "left_foot": "left_foot", "right_foot": "right_foot",
    "left_shoulder": "left_arm", "right_shoulder": "right_arm",
    "left_elbow": "left_forearm", "right_elbow": "right_forearm",
    "left_wrist": "left_hand", "right_wrist": "right_hand",
}  # fmt: skip
"""Body parts that rest on one surface at a time. Pelvis and thighs are one: a seat carries both."""
PART_NAMES: tuple[str, ...] = tuple(dict.fromkeys(PART_OF_JOINT.values()))


def vertex_parts(body: SkinnedBody) -> Integer[np.ndarray, " V"]:
    """Index into `PART_NAMES` of every feature vertex, by the joint of its largest skinning weight."""
    part_of = [PART_NAMES.index(PART_OF_JOINT[name]) for name in JOINT_NAMES]
    heaviest = body.weights[feature_vertices(body)].argmax(axis=1)
    return np.asarray(np.array(part_of, dtype=np.int64)[heaviest])


def feature_faces(body: SkinnedBody) -> Integer[np.ndarray, "F 3"]:
    """A closed mesh over all feature vertices, counted as `feature_vertices` orders them.

    The small mesh, and each vertex beside it put into the triangle that is nearest in the zero pose,
    which it splits into three. Needed for spirals, which walk around vertices.
    """
    ids = feature_vertices(body)
    points = body.rest_vertices[ids]
    faces: list[tuple[int, int, int]] = [
        (int(a), int(b), int(c)) for a, b, c in np.searchsorted(ids, body.subset[body.subset_faces])
    ]
    for vertex in np.flatnonzero(~np.isin(ids, body.subset)).tolist():
        nearest = int(_squared_distance(points[vertex], points[np.array(faces)]).argmin())
        a, b, c = faces.pop(nearest)
        faces += [(a, b, vertex), (b, c, vertex), (c, a, vertex)]
    return np.array(faces, dtype=np.int64)


def _squared_distance(
    point: Float[np.ndarray, "3"], corners: Float[np.ndarray, "F 3 3"]
) -> Float[np.ndarray, " F"]:
    """Squared distance of one point to triangles: to their planes inside, else to their edges."""
    start = corners
    edge = np.roll(corners, -1, axis=1) - corners
    along = ((point - start) * edge).sum(-1) / np.maximum((edge * edge).sum(-1), 1e-18)
    on_edge = start + np.clip(along, 0, 1)[..., None] * edge
    to_edges = ((point - on_edge) ** 2).sum(-1).min(axis=1)
    normal = np.cross(edge[:, 0], edge[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-18)
    side = (np.cross(edge, point - start) * normal[:, None]).sum(-1)
    to_plane = ((point - start[:, 0]) * normal).sum(-1) ** 2
    squared: Float[np.ndarray, " F"] = np.where((side >= 0).all(axis=1), to_plane, to_edges)
    return squared

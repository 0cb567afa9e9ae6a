"""Named contact regions of a body, derived from its zero pose and its skinning weights."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Integer

from experiments.body.model import JOINT_NAMES
from experiments.body.surface import vertex_normals

_UP, _FRONT = 1, 2
_SOLE_HEIGHT_M = 0.025
_EXTRA_POINTS = {"left_sole": 16, "right_sole": 16, "buttocks": 20, "thigh_backs": 16, "back": 20}


def body_regions(
    vertices: Float[np.ndarray, "V 3"],
    faces: Integer[np.ndarray, "F 3"],
    weights: Float[np.ndarray, "V 22"],
    joints: Float[np.ndarray, "22 3"],
) -> dict[str, Integer[np.ndarray, " _"]]:
    """Vertex ids of the regions that `BodyModel.regions` promises.

    Takes the zero pose (T-pose, palms down, y up, facing +z, metres). A vertex belongs to the part
    of its heaviest joint; within a part, its place and its normal decide.
    """
    part = np.array(JOINT_NAMES)[weights.argmax(axis=1)]
    normals = vertex_normals(vertices, faces)
    backward, downward = -normals[:, _FRONT], -normals[:, _UP]
    in_skin = np.zeros(len(vertices), dtype=bool)
    in_skin[np.unique(faces)] = True

    def parts(*names: str) -> Bool[np.ndarray, " V"]:
        return in_skin & np.isin(part, names)

    low = vertices[:, _UP] < vertices[in_skin, _UP].min() + _SOLE_HEIGHT_M
    hips, knees = joints[1:3, _UP].mean(), joints[4:6, _UP].mean()
    above_fold = vertices[:, _UP] > hips - 0.18 * (hips - knees)
    behind = vertices[:, _FRONT] < joints[1:3, _FRONT].mean()
    facing = (backward > 0.4) | (behind & (downward > 0.6))
    seat = parts("pelvis", "left_hip", "right_hip") & facing
    below_waist = vertices[:, _UP] < hips + 0.25 * (hips - knees)
    masks = {
        "buttocks": seat & above_fold & below_waist,
        "thigh_backs": parts("left_hip", "right_hip") & (backward > 0.4) & ~above_fold,
        "back": parts("spine1", "spine2", "spine3", "left_collar", "right_collar")
        & (backward > 0.4),
        "forearms": parts("left_elbow", "right_elbow"),
        "calves": parts("left_knee", "right_knee") & (backward > 0.2),
    }
    for side in ("left", "right"):
        hand = parts(f"{side}_wrist")
        sole = parts(f"{side}_ankle", f"{side}_foot") & low & (downward > 0.6)
        masks |= {
            f"{side}_hand": hand,
            f"{side}_palm": hand & (downward > 0.3),
            f"{side}_sole": sole,
        }
    return {name: np.flatnonzero(mask) for name, mask in masks.items()}


def contact_rows(
    vertices: Float[np.ndarray, "V 3"],
    regions: dict[str, Integer[np.ndarray, " _"]],
    subset: Integer[np.ndarray, " S"],
) -> Integer[np.ndarray, " C"]:
    """Vertices that thicken the contact areas of a small mesh: far from each other and from it."""
    # The body is symmetric: without rounding, noise of 1e-17 would decide between left and right.
    vertices = np.round(vertices, 6)
    chosen: list[int] = []
    for name, count in _EXTRA_POINTS.items():
        region = np.setdiff1d(regions[name], subset)
        seeds = np.intersect1d(regions[name], subset)
        picks = farthest_points(vertices[region], count, vertices[seeds])
        chosen.extend(int(vertex) for vertex in region[picks])
    return np.unique(np.array(chosen, dtype=np.int64))


def farthest_points(
    points: Float[np.ndarray, "N 3"], count: int, seeds: Float[np.ndarray, "M 3"]
) -> Integer[np.ndarray, " K"]:
    """Indices of up to `count` points, each the farthest from the seeds and the ones before it."""
    count = min(count, len(points))
    start = seeds if len(seeds) else points.mean(axis=0, keepdims=True)
    distance = np.linalg.norm(points[:, None] - start[None], axis=2).min(axis=1)
    picks = np.zeros(count, dtype=np.int64)
    for index in range(count):
        picks[index] = distance.argmax()
        step = np.linalg.norm(points - points[picks[index]], axis=1)
        distance = np.minimum(distance, step)
    return picks

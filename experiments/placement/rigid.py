"""The rigid part of a placement: a yaw about the clip's horizontal centre, then a translation."""

from __future__ import annotations

import dataclasses

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial.transform import Rotation
from torch import Tensor

from experiments.body.model import BodyModel
from experiments.motion.motion import Motion


def clip_centre(pelvis: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "2"]:
    """Middle of the ground a clip covers: the midrange of the pelvis path in x and y, metres.

    Turning a walk about its first frame instead would swing it out of the room for most yaws.
    """
    path = pelvis[:, :2]
    centre: Float[np.ndarray, "2"] = (path.min(0) + path.max(0)) / 2
    return centre


def clip_floor(lowest: Float[np.ndarray, " T"]) -> float:
    """Height of the floor a clip was captured on: a low percentile of the lowest vertex, metres.

    Not the minimum, because single frames of retargeted capture reach below the floor; not a high
    percentile, because the feet of a sleeper leave it for most of the clip.
    """
    return float(np.percentile(lowest, 10))


def move(
    points: Float[Tensor, "*S 3"],
    yaw: Float[Tensor, "*B"],
    translation: Float[Tensor, "*B 3"],
    centre: Float[Tensor, "2"],
) -> Float[Tensor, "*R 3"]:
    """Turn points by `yaw` (rad) about the vertical through `centre`, then translate (m).

    `yaw` and `translation` may carry one leading axis B of starts; the answer then has it too.
    """
    flat = points.movedim(-1, 0).reshape(3, -1)
    cosine, sine = torch.cos(yaw).flatten(), torch.sin(yaw).flatten()
    zero, one = torch.zeros_like(cosine), torch.ones_like(cosine)
    rows = [cosine, -sine, zero, sine, cosine, zero, zero, zero, one]
    turn = torch.stack(rows).reshape(3, 3, -1).transpose(1, 2)
    pivot = torch.cat([centre, centre.new_zeros(1)])
    offset = pivot[:, None] - turn @ pivot + translation.reshape(-1, 3).T
    # One product for all starts; the answer is a view of coordinate-major memory.
    placed = torch.addmm(offset.reshape(-1, 1), turn.reshape(-1, 3), flat)
    return placed.reshape(3, *yaw.shape, *points.shape[:-1]).movedim(0, -1)


def move_motion(
    motion: Motion,
    body: BodyModel,
    yaw: float,
    translation: Float[np.ndarray, "3"],
    centre: Float[np.ndarray, "2"],
) -> Motion:
    """The same for a motion: root orientation and root translation are turned and moved."""
    turn = Rotation.from_euler("z", yaw)
    pivot = np.array([centre[0], centre[1], 0.0])
    pose = motion.pose.copy()
    pose[:, 0] = (turn * Rotation.from_rotvec(motion.pose[:, 0])).as_rotvec()
    pelvis = motion.transl + body.rest_joints[0]
    moved = turn.apply(pelvis - pivot) + pivot + translation
    return dataclasses.replace(motion, pose=pose, transl=moved - body.rest_joints[0])

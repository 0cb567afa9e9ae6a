"""Points inside the body, along its bones: where no part of a scene may ever be.

A thin board costs little penetration, as nothing is deep inside it: a body could sit through the
back of a chair. Its bones, though, would cross the board.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from experiments.body.model import JOINT_NAMES, PARENTS

_ALONG = (0.15, 0.38, 0.62, 0.85)
_THIN = ("left_foot", "right_foot", "left_wrist", "right_wrist")
"""Ends of bones that lie too near the skin to be a core: the feet and the forearms."""


def bone_points(joints: Float[Tensor, "T 22 3"]) -> Float[Tensor, "T M 3"]:
    """Four points on every bone but those of feet and forearms; the frame of the joints."""
    ends = [
        (joint, parent)
        for joint, parent in enumerate(PARENTS)
        if parent >= 0 and JOINT_NAMES[joint] not in _THIN
    ]
    child = joints[:, [joint for joint, _ in ends]]
    parent = joints[:, [parent for _, parent in ends]]
    points = [parent + share * (child - parent) for share in _ALONG]
    return torch.cat(points, dim=1)

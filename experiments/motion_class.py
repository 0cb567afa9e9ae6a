"""The class of a motion, for tables that break results down: what its body does, not its name."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from experiments.body.model import JOINT_NAMES, BodyModel
from experiments.interaction.geometric import lying_frames, palm_touch, seated_frames
from experiments.interaction.mesh import MovingBody, moving_body
from experiments.motion.motion import Motion

REACH_UP_S = 0.3
"""Hands above the head for longer than this reach for something."""
MotionClass = Literal["lie", "sit", "reach", "walk", "stand"]
CLASSES: tuple[MotionClass, ...] = get_args(MotionClass)
WALK_M = 1.0
"""A pelvis that gets further than this from where it began belongs to someone who walks."""


def motion_class(motion: Motion, body: BodyModel) -> MotionClass:
    """The first of lie, sit, reach, walk and stand that the motion shows.

    Lying, sitting and reaching are the postures of the geometric rule, held for a moment; a clip
    that walks to a chair and sits down is a sit.
    """
    return class_of(moving_body(motion, body))


def hands_up_s(moving: MovingBody) -> float:
    """For how long, in seconds, a wrist is above the head."""
    joint = {name: moving.joints[:, index, 2] for index, name in enumerate(JOINT_NAMES)}
    up = np.maximum(joint["left_wrist"], joint["right_wrist"]) > joint["head"]
    return float(up.sum() * np.median(np.diff(moving.times)))


def class_of(moving: MovingBody) -> MotionClass:
    """The same for a motion that has been posed."""
    floor = float(np.percentile(moving.vertices[..., 2].min(1), 20))
    if lying_frames(moving).any():
        return "lie"
    if seated_frames(moving, floor).any():
        return "sit"
    if any(palm_touch(moving, side, floor).any() for side in ("left", "right")):
        return "reach"
    if hands_up_s(moving) > REACH_UP_S:
        return "reach"
    path = moving.joints[:, 0, :2]
    far = np.linalg.norm(path - path[0], axis=1).max()
    return "walk" if far > WALK_M else "stand"

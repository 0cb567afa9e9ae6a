"""Lengths and heights of a body that motions and chairs need, measured on its mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float, Integer

from experiments.body.model import JOINT_NAMES, BodyModel

SEAT_PRESS_M = 0.012
"""How deep the buttocks press into a hard seat."""
_RECLINE_RAD = np.deg2rad(10.0)


@dataclass(frozen=True)
class BodyMeasures:
    """Measures of one body; metres. Hip height means the middle of both hip joints."""

    stature: float
    """Crown above the soles."""
    leg: float
    """Hip joint to ankle joint with a straight knee."""
    thigh: float
    shank: float
    ankle_height: float
    """Ankle joint above the soles of the flat foot."""
    hip_height: float
    """Standing on straight legs, soles on the floor at height 0."""
    seat_offset: float
    """Hip height above a hard seat, sitting upright, the buttocks pressed in by `SEAT_PRESS_M`."""
    upper_arm: float
    forearm: float
    hand: float
    """Wrist joint to the farthest finger tip, fingers as they are (slightly curled)."""
    shoulder_width: float
    """Left to right shoulder joint."""
    left_sole: Integer[np.ndarray, " L"]
    right_sole: Integer[np.ndarray, " R"]
    """Vertex ids of the soles in full numbering: `BodyModel.regions`."""


@lru_cache(maxsize=16)
def body_measures(body: BodyModel) -> BodyMeasures:
    """Measure a body once; the answer is kept."""
    joints = dict(zip(JOINT_NAMES, body.rest_joints, strict=True))
    rest = _posed(body, np.zeros((22, 3)))
    floor = float(rest[body.body_component, 1].min())
    thigh, shank = (
        _distance(joints[f"left_{upper}"], joints[f"left_{lower}"])
        for upper, lower in (("hip", "knee"), ("knee", "ankle"))
    )
    hips = (joints["left_hip"] + joints["right_hip"]) / 2
    hand = rest[body.regions["left_hand"]] - joints["left_wrist"]
    return BodyMeasures(
        stature=float(rest[body.body_component, 1].max()) - floor,
        leg=thigh + shank,
        thigh=thigh,
        shank=shank,
        ankle_height=float(joints["left_ankle"][1]) - floor,
        hip_height=float(hips[1]) - floor,
        seat_offset=_seat_offset(body),
        upper_arm=_distance(joints["left_shoulder"], joints["left_elbow"]),
        forearm=_distance(joints["left_elbow"], joints["left_wrist"]),
        hand=float(np.linalg.norm(hand, axis=1).max()),
        shoulder_width=_distance(joints["left_shoulder"], joints["right_shoulder"]),
        left_sole=body.regions["left_sole"],
        right_sole=body.regions["right_sole"],
    )


def _seat_offset(body: BodyModel) -> float:
    """Hip height over the lowest point of buttocks and thighs, seated with level thighs."""
    pose = np.zeros((22, 3))
    pose[0, 0] = -_RECLINE_RAD
    for side in ("left", "right"):
        pose[JOINT_NAMES.index(f"{side}_hip"), 0] = _RECLINE_RAD - np.pi / 2
        pose[JOINT_NAMES.index(f"{side}_knee"), 0] = np.pi / 2
    mesh = body.posed(torch.as_tensor(pose[None]), torch.zeros(1, 3, dtype=torch.float64))
    seat = np.concatenate([body.regions["buttocks"], body.regions["thigh_backs"]])
    lowest = float(mesh.vertices[0, seat, 1].min())
    return float(mesh.joints[0, 1:3, 1].mean()) - lowest - SEAT_PRESS_M


def _posed(body: BodyModel, pose: Float[np.ndarray, "22 3"]) -> Float[np.ndarray, "V 3"]:
    mesh = body.posed(torch.as_tensor(pose[None]), torch.zeros(1, 3, dtype=torch.float64))
    return np.asarray(mesh.vertices[0].numpy())


def _distance(start: Float[np.ndarray, "3"], end: Float[np.ndarray, "3"]) -> float:
    return float(np.linalg.norm(end - start))

"""Figure: the measures of one body that motion code works with, in float64 numpy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Integer

from experiments.body.embedded import load_body
from experiments.body.measures import body_measures
from experiments.body.model import BodyModel
from experiments.motion.capture import INDEX
from experiments.motion.motion import Motion

SIDES = ("left", "right")
_SOLE_POINTS = 400
_STRAIGHT = 0.998
"""Share of the leg that a relaxed standing person uses."""


@dataclass(frozen=True)
class Figure:
    """One body's skeleton and soles. Rest axes: y up, facing +z, left = +x; metres."""

    body: BodyModel
    rest_joints: Float[np.ndarray, "22 3"]
    soles: tuple[Integer[np.ndarray, " P"], Integer[np.ndarray, " Q"]]
    """Vertices of the left and of the right sole."""
    ankle_height: float
    ball: Float[np.ndarray, "3"]
    """From the ankle joint to the toe joint of the left foot (for the right one negate x)."""
    heel: Float[np.ndarray, "3"]
    """From the ankle joint to the ground point under the heel of the left foot."""
    seat_offset: float
    """Height of the hip centre above a hard seat."""
    thigh_front: float
    """From the thigh's axis to its skin, in front, three quarters of the way to the knee."""
    back_offset: float
    """Height of the hip centre above a hard floor, lying on the back."""
    belly_front: float
    """From the hip centre forwards to the skin of the belly a hand's breadth above it."""

    @property
    def leg(self) -> tuple[float, float]:
        """Thigh and shank length."""
        return self._bone("left_hip", "left_knee"), self._bone("left_knee", "left_ankle")

    @property
    def arm(self) -> tuple[float, float]:
        """Upper arm and forearm length."""
        return self._bone("left_shoulder", "left_elbow"), self._bone("left_elbow", "left_wrist")

    @property
    def hip_height(self) -> float:
        """Height of the hip centre of a relaxed standing person."""
        return self.ankle_height + _STRAIGHT * sum(self.leg)

    @property
    def shoulder_height(self) -> float:
        """Height of the shoulder joints of a relaxed standing person."""
        above = self.rest_joints[INDEX["left_shoulder"]] - self.rest_joints[INDEX["left_hip"]]
        return self.hip_height + float(above[1])

    @property
    def hip_half_width(self) -> float:
        """Half the distance between the hip joints."""
        left, right = self.rest_joints[INDEX["left_hip"]], self.rest_joints[INDEX["right_hip"]]
        return float(left[0] - right[0]) / 2

    @property
    def hip_from_pelvis(self) -> Float[np.ndarray, "3"]:
        """From the pelvis joint to the hip centre, rest axes."""
        hips = self.rest_joints[[INDEX["left_hip"], INDEX["right_hip"]]]
        return np.asarray(hips.mean(axis=0) - self.rest_joints[0])

    def _bone(self, start: str, end: str) -> float:
        bone = self.rest_joints[INDEX[end]] - self.rest_joints[INDEX[start]]
        return float(np.linalg.norm(bone))


@lru_cache(maxsize=8)
def figure_of(body_name: str) -> Figure:
    """Measures of an embedded body. Raises `InputError` for an unknown name."""
    return measure(load_body(body_name))


def measure(body: BodyModel) -> Figure:
    """Measures of any body model, taken from its zero pose."""
    joints = np.asarray(body.rest_joints, dtype=np.float64)
    cached: Any = body
    hips = joints[[INDEX["left_hip"], INDEX["right_hip"]]].mean(axis=0)
    zero = torch.zeros(1, 22, 3)
    rest = body.posed(zero, torch.zeros(1, 3)).vertices[0].double().numpy()
    soles = tuple(_thinned(body.regions[f"{side}_sole"]) for side in SIDES)
    points = rest[body.regions["left_sole"]]
    ankle = joints[INDEX["left_ankle"]]
    ground = float(points[:, 1].min())
    back = points[points[:, 2] < points[:, 2].min() + 0.03]
    heel = np.array([back[:, 0].mean(), ground, points[:, 2].min() + 0.01])
    return Figure(
        body=body,
        rest_joints=joints,
        soles=(soles[0], soles[1]),
        ankle_height=float(ankle[1] - ground),
        ball=joints[INDEX["left_foot"]] - ankle,
        heel=heel - ankle,
        seat_offset=body_measures(cached).seat_offset,
        thigh_front=_thigh_front(rest, joints),
        back_offset=float(hips[2] - rest[body.regions["buttocks"], 2].min()),
        belly_front=_belly_front(rest, hips),
    )


def _belly_front(rest: Float[np.ndarray, "V 3"], hips: Float[np.ndarray, "3"]) -> float:
    above = rest[:, 1] - hips[1]
    near = (above > 0.08) & (above < 0.22) & (np.abs(rest[:, 0]) < 0.12)
    return float(rest[near, 2].max() - hips[2])


def _thigh_front(rest: Float[np.ndarray, "V 3"], joints: Float[np.ndarray, "22 3"]) -> float:
    hip, knee = joints[INDEX["left_hip"]], joints[INDEX["left_knee"]]
    centre = hip + 0.74 * (knee - hip)
    near = (np.abs(rest[:, 1] - centre[1]) < 0.03) & (np.abs(rest[:, 0] - centre[0]) < 0.05)
    return float(rest[near, 2].max() - centre[2])


def surface(
    figure: Figure, motion: Motion, vertex_ids: Integer[np.ndarray, " V"]
) -> Float[np.ndarray, "T V 3"]:
    """World positions (m) of chosen vertices over time."""
    pose = torch.from_numpy(motion.pose).float()
    transl = torch.from_numpy(motion.transl).float()
    with torch.no_grad():
        vertices = figure.body.posed(pose, transl, vertex_ids).vertices
    return np.asarray(vertices.double().numpy())


def _thinned(ids: Integer[np.ndarray, " V"]) -> Integer[np.ndarray, " P"]:
    keep = np.linspace(0, len(ids) - 1, min(len(ids), _SOLE_POINTS)).round().astype(np.int64)
    return np.asarray(ids[keep])

"""What an alteration costs the motion: bent joints, shifted root, jerk, sliding feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from experiments.body.model import BodyModel
from experiments.motion.motion import Motion

STILL_MM = 0.01
"""Mean joint jerk, mm per frame³, below which a clip is still and a ratio says nothing."""
STANCE_HEIGHT_M = 0.015
"""Sole vertices lower than this above the lowest of the clip stand on the ground."""


@dataclass(frozen=True)
class AlterationCost:
    """Comparison of a placed motion with the motion it was made from; no cost for a rigid method."""

    angle_mean_deg: float
    """Mean change of a joint's rotation over frames and joints, degrees; the root's turn included."""
    angle_max_deg: float
    """Largest change of one joint in one frame, degrees."""
    root_shift_mean_cm: float
    """Mean distance of the root from where the best rigid placement of the original has it, cm."""
    step_change_max_mm: float
    """Largest change of a frame-to-frame step of the root, mm."""
    jerk_change_mm: float
    """Mean joint jerk after minus before, mm per frame³."""
    jerk_before_mm: float
    """Mean joint jerk before, mm per frame³."""
    jerk_ratio: float
    """Mean joint jerk after over before; nan for a clip that is still to begin with."""
    foot_skate_cm_s: float
    """Mean horizontal speed of sole vertices on the ground after, cm/s."""
    foot_skate_before_cm_s: float
    """The same before."""


def alteration_cost(placed: Motion, original: Motion, body: BodyModel) -> AlterationCost:
    """Compare two motions of the same frames, whatever rigid placement lies between them."""
    turn, shift = rigid_between(original, placed, body)
    angles = joint_angles(placed, original, turn)
    expected = turn.apply(original.transl + body.rest_joints[0]) + shift
    residual = placed.transl + body.rest_joints[0] - expected
    steps = np.linalg.norm(np.diff(residual, axis=0), axis=-1)
    jerk, jerk_before = joint_jerk(placed, body), joint_jerk(original, body)
    return AlterationCost(
        angle_mean_deg=float(angles.mean()),
        angle_max_deg=float(angles.max()),
        root_shift_mean_cm=float(100 * np.linalg.norm(residual, axis=-1).mean()),
        step_change_max_mm=float(1000 * steps.max()),
        jerk_change_mm=jerk - jerk_before,
        jerk_before_mm=jerk_before,
        jerk_ratio=jerk / jerk_before if jerk_before > STILL_MM else float("nan"),
        foot_skate_cm_s=foot_skate(placed, body),
        foot_skate_before_cm_s=foot_skate(original, body),
    )


def rigid_between(
    original: Motion, placed: Motion, body: BodyModel
) -> tuple[Rotation, Float[np.ndarray, "3"]]:
    """The turn about the vertical and the translation that best carry one root path to the other.

    Least squares over the root's place and its heading, so that it is defined for a standing body.
    """
    before = original.transl + body.rest_joints[0]
    after = placed.transl + body.rest_joints[0]
    pairs = [(before - before.mean(0), after - after.mean(0))]
    frames = (Rotation.from_rotvec(original.pose[:, 0]), Rotation.from_rotvec(placed.pose[:, 0]))
    pairs += [(frames[0].apply(axis), frames[1].apply(axis)) for axis in np.eye(3)]
    cosine = sum(float((a[:, :2] * b[:, :2]).sum()) for a, b in pairs)
    sine = sum(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()) for a, b in pairs)
    turn = Rotation.from_euler("z", np.arctan2(sine, cosine))
    shift: Float[np.ndarray, "3"] = after.mean(0) - turn.apply(before.mean(0))
    return turn, shift


def joint_angles(placed: Motion, original: Motion, turn: Rotation) -> Float[np.ndarray, "T 22"]:
    """Angle between each joint's rotation before and after, degrees; the rigid turn taken out."""
    n_frames, n_joints = placed.pose.shape[:2]
    before = Rotation.from_rotvec(original.pose.reshape(-1, 3)).as_matrix()
    before = before.reshape(n_frames, n_joints, 3, 3).copy()
    before[:, 0] = turn.as_matrix() @ before[:, 0]
    after = Rotation.from_rotvec(placed.pose.reshape(-1, 3))
    between = Rotation.from_matrix(before.reshape(-1, 3, 3)).inv() * after
    angles: Float[np.ndarray, "T 22"] = np.degrees(between.magnitude()).reshape(n_frames, n_joints)
    return angles


def joint_jerk(motion: Motion, body: BodyModel) -> float:
    """Mean third difference of the joint positions, mm per frame³; zero below four frames."""
    if motion.n_frames < 4:
        return 0.0
    _, joints = body.joint_transforms(torch.as_tensor(motion.pose), torch.as_tensor(motion.transl))
    jerk = np.diff(joints.numpy(), n=3, axis=0)
    return float(1000 * np.linalg.norm(jerk, axis=-1).mean())


def foot_skate(motion: Motion, body: BodyModel) -> float:
    """Mean horizontal speed of the sole vertices that stand on the ground, cm/s; 0 if none does."""
    soles = np.union1d(body.regions["left_sole"], body.regions["right_sole"])
    mesh = body.posed(torch.as_tensor(motion.pose), torch.as_tensor(motion.transl), soles)
    points = mesh.vertices.numpy()
    height = points[..., 2]
    ground = float(np.percentile(height.min(1), 10))
    steps = np.diff(points[..., :2], axis=0) / np.diff(motion.times)[:, None, None]
    speed = np.linalg.norm(steps, axis=-1)
    low = height < ground + STANCE_HEIGHT_M
    standing = low[1:] & low[:-1]
    return float(100 * speed[standing].mean()) if standing.any() else 0.0

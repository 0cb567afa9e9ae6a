"""Checks of a motion on its body: floor, skate, penetration, jumps of joints, jerks of the root."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from experiments.motion.figure import Figure, surface
from experiments.motion.motion import Motion
from experiments.motion.rotations import joint_positions, to_matrix, world_rotations

SKATE_HEIGHT_M = 0.012
SUPPORT_HEIGHT_M = 0.10
_CHUNK = 60


@dataclass(frozen=True)
class MotionChecks:
    """Figures of merit of one motion."""

    floor_error_cm: float
    """Mean distance of the lowest point from the floor, over frames in which it is within 10 cm."""
    foot_skate_cm_s: float
    """Mean horizontal speed of sole points that are less than 1.2 cm above the floor."""
    sole_penetration_mm: float
    """Deepest sole point below the floor."""
    lowest_other_cm: float
    """Height of the lowest vertex outside the soles: negative is below the floor."""
    joint_step_deg: float
    """Largest change of a joint's rotation relative to its parent from one frame to the next."""
    root_acceleration: float
    """Largest acceleration of the pelvis, m/s2."""


def check_motion(motion: Motion, figure: Figure) -> MotionChecks:
    """All figures of one motion, on the full skin (about 1 CPU s for 10 s of motion)."""
    soles = np.unique(np.concatenate([figure.body.regions[f"{s}_sole"] for s in ("left", "right")]))
    others = np.setdiff1d(figure.body.body_component, soles)
    points = surface(figure, motion, soles)
    lowest_other = _lowest(motion, figure, others)
    lowest_sole = points[..., 2].min(axis=1)
    lowest = np.minimum(lowest_sole, lowest_other)
    support = np.abs(lowest[lowest < SUPPORT_HEIGHT_M])
    return MotionChecks(
        floor_error_cm=100 * float(support.mean()) if len(support) else 0.0,
        foot_skate_cm_s=100 * foot_skate(points, motion.fps),
        sole_penetration_mm=1000 * max(0.0, -float(lowest_sole.min())),
        lowest_other_cm=100 * float(lowest_other.min()),
        joint_step_deg=largest_joint_step(motion),
        root_acceleration=peak_root_acceleration(motion, figure),
    )


def foot_skate(points: Float[np.ndarray, "T P 3"], fps: float) -> float:
    """Mean horizontal speed (m/s) of sole points while within 1.2 cm of the floor; 0 if none ever is."""
    speed = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=2) * fps
    height = np.maximum(points[1:, :, 2], points[:-1, :, 2])
    near = height < SKATE_HEIGHT_M
    return float(speed[near].mean()) if near.any() else 0.0


def largest_joint_step(motion: Motion) -> float:
    """Largest turn (degrees) of any joint relative to its parent between neighbouring frames."""
    matrices = to_matrix(motion.pose)
    step = np.swapaxes(matrices[:-1], -1, -2) @ matrices[1:]
    cosine = (np.trace(step, axis1=-2, axis2=-1) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).max())


def peak_root_acceleration(motion: Motion, figure: Figure) -> float:
    """Largest second difference of the pelvis position (m/s2)."""
    pelvis = joint_positions(world_rotations(motion.pose), motion.transl, figure.rest_joints)[:, 0]
    acceleration = np.diff(pelvis, n=2, axis=0) * motion.fps**2
    return float(np.linalg.norm(acceleration, axis=1).max(initial=0.0))


def _lowest(
    motion: Motion, figure: Figure, ids: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
) -> Float[np.ndarray, " T"]:
    from experiments.motion.resample import window

    starts = range(0, motion.n_frames, _CHUNK)
    parts = [window(motion, start, start + _CHUNK) for start in starts]
    heights = [surface(figure, part, ids)[..., 2].min(axis=1) for part in parts]
    return np.concatenate(heights)

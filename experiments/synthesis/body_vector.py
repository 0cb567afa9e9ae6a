"""The body vector of the synthesis networks: root translation, root orientation, 21 joint rotations.

Rotations are the first two columns of their matrices, column after column (Zhou et al. 2019, "On the
continuity of rotation representations in neural networks"). Frame: the room's, z up, metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import roma
import torch
from jaxtyping import Float
from torch import Tensor

from experiments.body.kinematics import rotation_matrices
from experiments.body.measures import body_measures
from experiments.body.model import BodyModel
from experiments.motion.motion import Motion

SIZE = 135
STATE_SIZE = 9
"""Translation (3) and root orientation (6): what a route is made of."""
POSE_SIZE = 126
"""Rotations of the 21 joints below the root."""
STATE = slice(0, STATE_SIZE)
POSE = slice(STATE_SIZE, SIZE)
DESCRIPTOR_SIZE = 10


@dataclass(frozen=True)
class Clip:
    """What a body vector does not hold of a motion: names, body and frame rate."""

    fps: float
    motion_id: str
    label: str
    source: str
    body: str = "male_slim"


def to_vectors(motion: Motion) -> Float[np.ndarray, "T 135"]:
    """Every frame of a motion as a body vector."""
    columns = rotations_to_6d(torch.as_tensor(motion.pose))
    return np.concatenate([motion.transl, columns.reshape(motion.n_frames, -1).numpy()], axis=1)


def to_motion(vectors: Float[np.ndarray, "T 135"], clip: Clip) -> Motion:
    """The motion of a sequence of body vectors, times from 0 s. Inverse of `to_vectors`."""
    pose, transl = to_pose(torch.as_tensor(vectors, dtype=torch.float64))
    return Motion(
        pose=pose.numpy(),
        transl=transl.numpy(),
        times=np.arange(len(vectors)) / clip.fps,
        fps=clip.fps,
        motion_id=clip.motion_id,
        label=clip.label,
        source=clip.source,
        body=clip.body,
    )


def to_pose(
    vectors: Float[Tensor, "T 135"],
) -> tuple[Float[Tensor, "T 22 3"], Float[Tensor, "T 3"]]:
    """Axis-angle pose (rad) and root translation (m) for a `BodyModel`, differentiable."""
    return rotations_from_6d(vectors[:, 3:].reshape(-1, 22, 6)), vectors[:, :3]


def rotations_to_6d(axis_angle: Float[Tensor, "*N 3"]) -> Float[Tensor, "*N 6"]:
    """Axis-angle vectors (rad) to the first two columns of their rotation matrices."""
    return rotation_matrices(axis_angle)[..., :2].transpose(-1, -2).flatten(-2)


def rotations_from_6d(columns: Float[Tensor, "*N 6"]) -> Float[Tensor, "*N 3"]:
    """Axis-angle vectors of two columns of any length and angle, made orthonormal (Gram-Schmidt)."""
    pair = columns.reshape(*columns.shape[:-1], 2, 3).transpose(-1, -2)
    rotvec: Tensor = roma.rotmat_to_rotvec(roma.special_gramschmidt(pair, epsilon=1e-8))
    return rotvec


def body_descriptor(body: BodyModel) -> Float[np.ndarray, "10"]:
    """Ten lengths that tell one body from another: our stand-in for SMPL-X's shape parameters.

    Decimetres away from a 1.75 m adult, so that the numbers are about as large as shape parameters.
    """
    measures = body_measures(body)  # type: ignore[arg-type]  # bodies hash by identity
    lengths = [
        measures.stature,
        measures.thigh,
        measures.shank,
        measures.hip_height,
        measures.seat_offset,
        measures.upper_arm,
        measures.forearm,
        measures.hand,
        measures.shoulder_width,
        _girth(body),
    ]
    descriptor: Float[np.ndarray, "10"] = 10.0 * (np.array(lengths) - _USUAL)
    return descriptor


_USUAL = np.array([1.75, 0.41, 0.44, 0.92, 0.076, 0.27, 0.25, 0.17, 0.36, 0.09])


def _girth(body: BodyModel) -> float:
    """Mean horizontal distance of back and buttocks from the spine in the zero pose, metres."""
    zero = torch.zeros((1, 22, 3), dtype=torch.float64)
    ids = np.union1d(body.regions["back"], body.regions["buttocks"])
    rest = body.posed(zero, zero[:, 0], ids).vertices[0].numpy()
    across = rest[:, [0, 2]] - body.rest_joints[3, [0, 2]]
    return float(np.linalg.norm(across, axis=1).mean())

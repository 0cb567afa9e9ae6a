"""Forward kinematics of the 22 SMPL-X body joints: axis-angle vectors to world rotations and positions."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from experiments.body.model import PARENTS

# Below this squared angle the closed forms divide zero by zero; their series are exact to 1e-17 there.
_SMALL_SQUARED_ANGLE = 1e-8


def forward_kinematics(
    pose: Float[Tensor, "T 22 3"], transl: Float[Tensor, "T 3"], rest_joints: Float[Tensor, "22 3"]
) -> tuple[Float[Tensor, "T 22 3 3"], Float[Tensor, "T 22 3"]]:
    """World rotation and position (metres) of every joint.

    `pose` are axis-angle vectors in radians relative to the parent, the pelvis relative to the
    world. The pelvis stands at `rest_joints[0] + transl`: turning the root turns the body about
    the pelvis joint, as in SMPL-X.
    """
    local = rotation_matrices(pose)
    rotations, positions = [local[:, 0]], [rest_joints[0] + transl]
    for joint in range(1, len(PARENTS)):
        parent = PARENTS[joint]
        offset = rest_joints[joint] - rest_joints[parent]
        rotations.append(rotations[parent] @ local[:, joint])
        positions.append(positions[parent] + rotations[parent] @ offset)
    return torch.stack(rotations, dim=1), torch.stack(positions, dim=1)


def rotation_matrices(vectors: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotation matrices of axis-angle vectors (radians), by Rodrigues' formula.

    R = I + a K + b K^2 with a = sin(t) / t, b = (1 - cos(t)) / t^2 and K the cross-product matrix.
    First and second derivatives are finite everywhere, at the zero vector too.
    """
    squared = (vectors * vectors).sum(-1)
    small = squared < _SMALL_SQUARED_ANGLE
    # The unused branch of `where` still takes part in the gradient, so it gets a harmless angle.
    angle = torch.where(small, torch.ones_like(squared), squared).sqrt()
    half = torch.sin(angle / 2) / angle
    sine = torch.where(small, 1 - squared / 6, torch.sin(angle) / angle)
    # 2 sin^2(t/2) / t^2 equals (1 - cos t) / t^2 without its cancellation in single precision.
    cosine = torch.where(small, 0.5 - squared / 24, 2 * half * half)
    outer = vectors[..., :, None] * vectors[..., None, :]
    identity = torch.eye(3, dtype=vectors.dtype, device=vectors.device)
    square = outer - squared[..., None, None] * identity
    return (
        identity
        + sine[..., None, None] * cross_matrices(vectors)
        + cosine[..., None, None] * square
    )


def cross_matrices(vectors: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The matrices K with K u = v x u."""
    x, y, z = vectors.unbind(-1)
    zero = torch.zeros_like(x)
    rows = [zero, -z, y, z, zero, -x, -y, x, zero]
    return torch.stack(rows, dim=-1).reshape(*vectors.shape[:-1], 3, 3)

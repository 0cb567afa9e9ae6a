"""Trivial rivals of the synthesis networks: the straight line, and the nearest clip of the training data."""

from __future__ import annotations

import numpy as np
import roma
import torch
from jaxtyping import Float
from torch import Tensor

from experiments.synthesis.training_set import TrainingSet, turned_vectors

_BETWEEN = slice(1, 61)


def straight(true: Float[Tensor, "B 62 135"]) -> Float[Tensor, "B 60 135"]:
    """The trivial synthesis: translation linear, every rotation on its shortest arc at even speed."""
    share = torch.arange(1, 61, dtype=true.dtype) / 61
    first, last = true[:, :1], true[:, 61:]
    transl = first[..., :3] + share[:, None] * (last[..., :3] - first[..., :3])
    start, end = (matrices(side[:, 0, 3:]) for side in (first, last))
    arc = roma.rotmat_to_rotvec(start.transpose(-1, -2) @ end)
    steps = roma.rotvec_to_rotmat(share[None, :, None, None] * arc[:, None])
    turned = (start[:, None] @ steps)[..., :2].transpose(-1, -2)
    return torch.cat([transl, turned.flatten(2)], dim=-1)


def nearest_segments(
    train: TrainingSet, true: Float[Tensor, "B 62 135"]
) -> Float[Tensor, "B 60 135"]:
    """The training segment whose two ends are most alike, turned and shifted to start at the start.

    Alike: root way and turn seen from the start, heights, and both end poses.
    """
    windows = np.unique(train.data.window[train.moving])
    local = _at_origin(train._local[torch.as_tensor(windows)].float())
    wanted = _at_origin(true)
    nearest = torch.cdist(_ends_code(wanted), _ends_code(local)).argmin(dim=1)
    found = local[nearest][:, _BETWEEN]
    zero = torch.zeros((len(true), 3))
    moved = turned_vectors(found, zero, _heading(true[:, 0]), zero)
    flat = torch.cat([true[:, 0, :2], zero[:, :1]], dim=1)
    return torch.cat([moved[..., :3] + flat[:, None], moved[..., 3:]], dim=-1)


def matrices(columns: Float[Tensor, "B N"]) -> Float[Tensor, "B J 3 3"]:
    """Rotation matrices of 6D columns, J of them in a row."""
    pair = columns.reshape(len(columns), -1, 2, 3).transpose(-1, -2)
    matrices: Tensor = roma.special_gramschmidt(pair, epsilon=1e-8)
    return matrices


def angles(one: Float[Tensor, "*B N"], two: Float[Tensor, "*B N"]) -> Float[Tensor, "*B J"]:
    """Angle between rotations given as 6D columns, degrees."""
    pairs = [
        roma.special_gramschmidt(
            side.reshape(*side.shape[:-1], -1, 2, 3).transpose(-1, -2), epsilon=1e-8
        )
        for side in (one, two)
    ]
    angle: Tensor = torch.rad2deg(roma.rotmat_geodesic_distance(*pairs))
    return angle


def _ends_code(local: Float[Tensor, "B 62 135"]) -> Float[Tensor, "B 262"]:
    """Numbers that are alike where two windows begin and end alike."""
    first, last = local[:, 0], local[:, 61]
    states = torch.cat([first[:, 2:3], last[:, :9]], dim=1)
    poses = torch.cat([first[:, 9:], last[:, 9:]], dim=1)
    return torch.cat([2.0 * states, 0.3 * poses], dim=1)


def _at_origin(vectors: Float[Tensor, "B T 135"]) -> Float[Tensor, "B T 135"]:
    """Windows that start at x = y = 0 with heading 0."""
    zero = torch.zeros((len(vectors), 3))
    flat = torch.cat([vectors[:, 0, :2], zero[:, :1]], dim=1)[:, None]
    moved = torch.cat([vectors[..., :3] - flat, vectors[..., 3:]], dim=-1)
    return turned_vectors(moved, zero, -_heading(vectors[:, 0]), zero)


def _heading(vectors: Float[Tensor, "B 135"]) -> Float[Tensor, " B"]:
    """Where the pelvis faces: 0 along -y, counter-clockwise, radians."""
    facing = matrices(vectors[:, 3:9])[:, 0, :, 2]
    return torch.atan2(facing[:, 0], -facing[:, 1])

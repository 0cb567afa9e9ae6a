"""Composition: clips moved in the plane, joined at the best seam, cross-faded with least jerk."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from experiments.motion.capture import INDEX
from experiments.motion.figure import Figure
from experiments.motion.foot_lock import minimum_jerk
from experiments.motion.motion import Motion
from experiments.motion.resample import window
from experiments.motion.rotations import (
    about,
    joint_positions,
    slerp,
    to_axis_angle,
    to_matrix,
    world_rotations,
)

_SEAM_JOINTS = tuple(
    INDEX[f"{side}_{part}"]
    for side in ("left", "right")
    for part in ("knee", "ankle", "foot", "wrist")
) + (INDEX["head"],)
_POSITION_WEIGHT, _VELOCITY_WEIGHT = 2.0, 0.3


def join(
    first: Motion, second: Motion, figure: Figure, search: int = 12, blend: int = 10
) -> Motion:
    """`second` after `first`, overlapping by `blend` frames at the most similar place.

    The end of `first` (its last `search` + `blend` frames) and the start of `second` are compared;
    `second` is turned and shifted in the plane to continue where `first` is.
    """
    end, start = best_seam(first, second, figure, search, blend)
    lead, tail = window(first, 0, end + blend), window(second, start, second.n_frames)
    tail = continue_from(tail, lead, end)
    share = minimum_jerk((np.arange(blend) + 1) / (blend + 1))
    pose = slerp(lead.pose[end:], tail.pose[:blend], np.repeat(share[:, None], 22, axis=1))
    transl = lead.transl[end:] * (1 - share[:, None]) + tail.transl[:blend] * share[:, None]
    pose = np.concatenate([lead.pose[:end], pose, tail.pose[blend:]])
    transl = np.concatenate([lead.transl[:end], transl, tail.transl[blend:]])
    times = np.arange(len(pose)) / first.fps
    return dataclasses.replace(first, pose=pose, transl=transl, times=times)


def best_seam(
    first: Motion, second: Motion, figure: Figure, search: int, blend: int
) -> tuple[int, int]:
    """Frame of `first` and frame of `second` between which the body differs least.

    Difference of root-aligned positions of feet, hands and head (m) and of their velocities (m/s).
    """
    ends = np.arange(max(0, first.n_frames - blend - search), first.n_frames - blend)
    starts = np.arange(min(search, second.n_frames - blend - 1))
    one, two = _features(first, figure)[ends], _features(second, figure)[starts]
    cost = np.linalg.norm(one[:, None] - two[None], axis=-1)
    row, column = np.unravel_index(int(cost.argmin()), cost.shape)
    return int(ends[row]), int(starts[column])


def continue_from(motion: Motion, lead: Motion, frame: int) -> Motion:
    """`motion` moved in the plane so that its first frame stands and faces as `lead` does at `frame`."""
    turn = heading(lead)[frame] - heading(motion)[0]
    turned = rotate(motion, np.full(motion.n_frames, turn))
    shift = np.zeros(3)
    shift[:2] = (lead.transl[frame] - turned.transl[0])[:2]
    return dataclasses.replace(turned, transl=turned.transl + shift)


def rotate(motion: Motion, radians: Float[np.ndarray, " T"]) -> Motion:
    """The motion turned about the vertical through the world's origin, by an angle a frame."""
    turn = about("z", np.degrees(radians))
    root = to_axis_angle(turn @ to_matrix(motion.pose[:, 0]))
    pose = np.concatenate([root[:, None], motion.pose[:, 1:]], axis=1)
    transl = (turn @ motion.transl[..., None])[..., 0]
    return dataclasses.replace(motion, pose=pose, transl=transl)


def heading(motion: Motion) -> Float[np.ndarray, " T"]:
    """Yaw (rad, unwrapped) of the pelvis: 0 faces -y. For upright bodies."""
    forward = to_matrix(motion.pose[:, 0])[..., 2]
    return np.asarray(np.unwrap(np.arctan2(forward[:, 0], -forward[:, 1])))


def _features(motion: Motion, figure: Figure) -> Float[np.ndarray, "T D"]:
    turned = rotate(motion, -heading(motion))
    joints = joint_positions(world_rotations(turned.pose), turned.transl, figure.rest_joints)
    place = (joints[:, _SEAM_JOINTS] - joints[:, :1]).reshape(motion.n_frames, -1)
    velocity = np.gradient(place, axis=0) * motion.fps
    parts = [_POSITION_WEIGHT * place, _VELOCITY_WEIGHT * velocity]
    return np.concatenate(parts, axis=1) / np.sqrt(len(_SEAM_JOINTS))

"""Composition: clips moved in the plane and joined at the best seam with least jerk."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from experiments.motion.capture import INDEX
from experiments.motion.figure import SIDES, Figure
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

_SEAM_PARTS = ("knee", "ankle", "foot", "wrist")
_SEAM_JOINTS = (INDEX["head"], *(INDEX[f"{s}_{part}"] for s in SIDES for part in _SEAM_PARTS))
_POSITION_WEIGHT, _VELOCITY_WEIGHT = 2.0, 0.3


def join(first: Motion, second: Motion, figure: Figure, search: int = 6, blend: int = 8) -> Motion:
    """`second` after `first`, cut together where the body differs least.

    One of the last `search` frames of `first` is identified with one of the first `search` frames of
    `second`, which is turned and shifted in the plane to continue there. What differs at that seam is
    shared by both sides and faded out with least jerk over `blend` frames each way, so neither timing
    nor phase changes.
    """
    end, start = best_seam(first, second, figure, search)
    lead = window(first, 0, end + 1)
    tail = continue_from(window(second, start, second.n_frames), lead, end)
    half = np.full(22, 0.5)
    pose = slerp(lead.pose[-1], tail.pose[0], half)
    transl = (lead.transl[-1] + tail.transl[0]) / 2
    before = _bent_to(lead, -1, pose, transl, minimum_jerk(1 - np.arange(end, -1, -1) / blend))
    after = _bent_to(tail, 0, pose, transl, minimum_jerk(1 - np.arange(tail.n_frames) / blend))
    transl = np.concatenate([before.transl[:-1], after.transl])
    return dataclasses.replace(
        first,
        pose=np.concatenate([before.pose[:-1], after.pose]),
        transl=_even_speed(transl, end, blend),
        times=np.arange(len(transl)) / first.fps,
    )


def _even_speed(
    transl: Float[np.ndarray, "T 3"], seam: int, blend: int
) -> Float[np.ndarray, "T 3"]:
    """The path with its jump of velocity at a frame spread over `blend` frames each way."""
    steps = np.diff(transl, axis=0)
    reach = max(min(3, seam, len(steps) - seam), 1)
    jump = steps[seam : seam + reach].mean(axis=0) - steps[seam - reach : seam].mean(axis=0)
    distance = np.arange(len(steps)) - seam + 0.5
    share = np.sign(distance) * minimum_jerk(1 - np.abs(distance) / blend) / 2
    steps = steps - share[:, None] * jump
    return np.concatenate([transl[:1], transl[0] + np.cumsum(steps, axis=0)])


def best_seam(first: Motion, second: Motion, figure: Figure, search: int) -> tuple[int, int]:
    """Frame of `first` and frame of `second` between which the body differs least.

    Difference of root-aligned positions of feet, hands and head (m) and of their velocities (m/s).
    """
    ends = np.arange(max(1, first.n_frames - search), first.n_frames)
    starts = np.arange(min(search, second.n_frames - 1))
    one, two = _features(first, figure)[ends], _features(second, figure)[starts]
    cost = np.linalg.norm(one[:, None] - two[None], axis=-1)
    row, column = np.unravel_index(int(cost.argmin()), cost.shape)
    return int(ends[row]), int(starts[column])


def _bent_to(
    motion: Motion,
    frame: int,
    pose: Float[np.ndarray, "22 3"],
    transl: Float[np.ndarray, "3"],
    share: Float[np.ndarray, " T"],
) -> Motion:
    """The motion with its state at `frame` moved to the one given, other frames by their share of it."""
    own = to_matrix(motion.pose)
    change = to_axis_angle(np.swapaxes(own[frame], -1, -2) @ to_matrix(pose))
    moved = own @ to_matrix(change[None] * share[:, None, None])
    shift = (transl - motion.transl[frame]) * share[:, None]
    return dataclasses.replace(motion, pose=to_axis_angle(moved), transl=motion.transl + shift)


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
    return np.asarray(np.concatenate(parts, axis=1) / np.sqrt(len(_SEAM_JOINTS)))

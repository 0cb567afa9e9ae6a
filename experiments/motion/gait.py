"""Gait: recorded steps strung together, and walked from standing to standing inside an authored clip."""

from __future__ import annotations

import dataclasses
from functools import reduce

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from experiments.motion.capture import INDEX
from experiments.motion.cleanup import BLENDED_SPEED_LIMIT
from experiments.motion.compose import heading, join, rotate
from experiments.motion.deepmimic import pybullet_clip, read_deepmimic
from experiments.motion.figure import Figure
from experiments.motion.foot_lock import lock_feet, minimum_jerk
from experiments.motion.ground import ground
from experiments.motion.motion import Motion
from experiments.motion.resample import FPS, at_times, low_pass, mirror, resample, window
from experiments.motion.retarget import retarget
from experiments.motion.root import drive_root
from experiments.motion.rotations import joint_positions, slerp, world_rotations

WALK, TURN_RIGHT, TURN_LEFT = "walker/0walk_forward", "walker/turn_right0", "walker/turn_left0"
_RAMP_S = 1.1
_SLOWEST = 0.5
"""Share of the normal pace at which a walk starts and ends."""


def gait(figure: Figure, clips: tuple[str, ...]) -> Motion:
    """Recorded steps one after another (names of pybullet clips; `~` before a name mirrors it).

    Cut to begin and end with the ankles side by side.
    """
    parts = [_clip(figure, name) for name in clips]
    whole = low_pass(reduce(lambda first, second: join(first, second, figure, 4, 6), parts))
    passing = _passing_frames(whole, figure)
    return window(whole, passing[0], passing[-1] + 1)


def walk_within(authored: Motion, steps: Motion, figure: Figure, start_s: float) -> Motion:
    """Insert a walk into an authored clip at `start_s`, where the person stands at ease.

    The standing time there is stretched by the walk's length. Amplitude and pace of the walk rise from
    the standing pose and sink back to it; the root is driven by the feet, so the body travels only as
    they push. Afterwards the authored clip goes on from where the walk has led.
    """
    paced, amount = _paced(steps)
    start = round(start_s * FPS)
    length = paced.n_frames
    clock = np.concatenate(
        [np.arange(start), np.full(length, start), np.arange(start, authored.n_frames)]
    )
    # While walking the authored clip plays on in slow motion: breathing never freezes.
    base = at_times(authored, clock / FPS, FPS)
    turn = np.zeros(base.n_frames)
    lead = heading(paced) - heading(paced)[0]
    turn[start : start + length] = gaussian_filter1d(lead, 8.0, mode="nearest")
    turn[start + length :] = lead[-1]
    base = rotate(base, turn)
    return _cleaned(_mixed(base, paced, amount, start), base, figure, start, length)


def _clip(figure: Figure, name: str) -> Motion:
    motion = resample(retarget(read_deepmimic(pybullet_clip(name.removeprefix("~"))), figure))
    return mirror(motion) if name.startswith("~") else motion


def _passing_frames(motion: Motion, figure: Figure) -> list[int]:
    """Frames in which one ankle passes the other."""
    turned = rotate(motion, -heading(motion))
    joints = joint_positions(world_rotations(turned.pose), turned.transl, figure.rest_joints)
    lead = joints[:, INDEX["left_ankle"], 1] - joints[:, INDEX["right_ankle"], 1]
    return [int(frame) for frame in np.flatnonzero(np.diff(np.sign(lead)))]


def _paced(steps: Motion) -> tuple[Motion, Float[np.ndarray, " T"]]:
    """The steps slowed at both ends, and the share (0 to 1) of walking in every frame."""
    total = (steps.n_frames - 1) / steps.fps
    ramp = min(_RAMP_S, 0.45 * total)
    # A ramp covers its length times the mean pace on it.
    length = total + 2 * ramp * (1 - (1 + _SLOWEST) / 2)
    times = np.arange(round(length * FPS) + 1) / FPS
    edge = np.minimum(times, times[-1] - times) / ramp
    share = minimum_jerk(edge)
    pace = _SLOWEST + (1 - _SLOWEST) * share
    clock = np.concatenate([[0.0], np.cumsum((pace[1:] + pace[:-1]) / 2)])
    return at_times(steps, clock / clock[-1] * total, FPS), share


def _mixed(base: Motion, paced: Motion, amount: Float[np.ndarray, " W"], start: int) -> Motion:
    """Pose between standing and walking; height likewise; the root's path is settled afterwards."""
    walk = slice(start, start + paced.n_frames)
    pose, transl = base.pose.copy(), base.transl.copy()
    pose[walk] = slerp(base.pose[walk], paced.pose, np.repeat(amount[:, None], 22, axis=1))
    transl[walk, 2] = base.transl[walk, 2] * (1 - amount) + paced.transl[:, 2] * amount
    return dataclasses.replace(base, pose=pose, transl=transl)


def _cleaned(mixed: Motion, base: Motion, figure: Figure, start: int, length: int) -> Motion:
    """Feet drive the root while walking; before and after, the authored root's own steps are kept."""
    grounded = ground(mixed, figure)
    walking = np.zeros(mixed.n_frames)
    walking[start : start + length] = 1.0
    walking = gaussian_filter1d(walking, 2.0)[:, None]
    height = mixed.transl[:, 2:] * (1 - walking) + grounded.transl[:, 2:] * walking
    driven = np.diff(drive_root(grounded, figure).transl[:, :2], axis=0)
    authored = np.diff(base.transl[:, :2], axis=0)
    step = authored * (1 - walking[1:]) + driven * walking[1:]
    path = base.transl[0, :2] + np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    moved = dataclasses.replace(mixed, transl=np.concatenate([path, height], axis=1))
    return lock_feet(moved, figure, BLENDED_SPEED_LIMIT)

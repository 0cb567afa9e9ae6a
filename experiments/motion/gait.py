"""Gait: recorded steps strung together, and walked from standing to standing inside an authored clip."""

from __future__ import annotations

import dataclasses
from functools import reduce

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from experiments.motion.capture import INDEX
from experiments.motion.compose import heading, join, rotate
from experiments.motion.deepmimic import pybullet_clip, read_deepmimic
from experiments.motion.figure import Figure
from experiments.motion.foot_lock import lock_feet, minimum_jerk
from experiments.motion.ground import ground
from experiments.motion.motion import Motion
from experiments.motion.resample import FPS, at_times, low_pass, mirror, resample, window
from experiments.motion.retarget import retarget
from experiments.motion.rotations import about, joint_positions, slerp, world_rotations

STEP_LEFT, STEP_RIGHT = "humanoid3d_walk[:19]", "~humanoid3d_walk[:19]"
"""One step each; the clip's second half is the first one's mirror image with a jump at the seam."""
WALK, MIRRORED_WALK = (STEP_LEFT, STEP_RIGHT), (STEP_RIGHT, STEP_LEFT)
TURN_RIGHT, TURN_LEFT = "walker/turn_right0", "~walker/turn_right0"
"""Two steps with a quarter turn; the left one mirrored. Both begin as STEP_LEFT (STEP_RIGHT) does."""
_RAMP_S = 1.1
_SLOWEST = 0.5
"""Share of the normal pace at which a walk starts and ends."""
_SPEED_LIMIT = 0.5


def gait(figure: Figure, clips: tuple[str, ...]) -> Motion:
    """Recorded steps one after another, cut to begin and end with the ankles side by side.

    `clips` are names of pybullet clips; `[:n]` after a name takes the first n frames of its 30 a
    second, `~` before it mirrors it.
    """
    parts = [_clip(figure, name) for name in clips]
    whole = low_pass(reduce(lambda first, second: join(first, second, figure), parts))
    passing = _passing_frames(whole, figure)
    return window(whole, passing[0], passing[-1] + 1)


def walk_within(authored: Motion, steps: Motion, figure: Figure, start_s: float) -> Motion:
    """Insert a walk into an authored clip at `start_s`, where the person stands at ease.

    The standing time there is stretched by the walk's length. Amplitude and pace of the walk rise from
    the standing pose and sink back to it. Afterwards the authored clip goes on from where the walk led.
    """
    paced, amount = _paced(steps)
    start, length = round(start_s * FPS), paced.n_frames
    # While walking the authored clip stands still at its state of `start_s`.
    clock = [np.arange(start), np.full(length, start), np.arange(start, authored.n_frames)]
    base = at_times(authored, np.concatenate(clock) / FPS, FPS)
    turn = np.zeros(base.n_frames)
    lead = heading(paced) - heading(paced)[0]
    turn[start : start + length] = gaussian_filter1d(lead, 8.0, mode="nearest")
    turn[start + length :] = lead[-1]
    base = _turned_in_place(base, turn)
    mixed = _mixed(base, paced, amount, start)
    return lock_feet(_grounded(mixed, figure, start, length), figure, _SPEED_LIMIT)


def _turned_in_place(motion: Motion, radians: Float[np.ndarray, " T"]) -> Motion:
    """The motion with its heading turned by an angle a frame; its own small steps turn along."""
    turned = rotate(motion, radians)
    steps = np.diff(motion.transl, axis=0)
    steps = (about("z", np.degrees(radians[1:])) @ steps[..., None])[..., 0]
    path = motion.transl[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return dataclasses.replace(turned, transl=path)


def _grounded(mixed: Motion, figure: Figure, start: int, length: int) -> Motion:
    """On the floor while walking; before and after, the authored heights are right already."""
    walking = np.zeros(mixed.n_frames)
    walking[start : start + length] = 1.0
    share = gaussian_filter1d(walking, 2.0)[:, None]
    transl = mixed.transl * (1 - share) + ground(mixed, figure).transl * share
    return dataclasses.replace(mixed, transl=transl)


def _clip(figure: Figure, name: str) -> Motion:
    clip, _, stop = name.removeprefix("~").removesuffix("]").partition("[:")
    motion = resample(retarget(read_deepmimic(pybullet_clip(clip)), figure))
    part = window(motion, 0, int(stop) if stop else motion.n_frames)
    return mirror(part) if name.startswith("~") else part


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
    """Standing and walking mixed by the amount of walking; half the swing of the legs, half the way.

    Afterwards the standing clip goes on from where the walk has led.
    """
    walk, after = slice(start, start + paced.n_frames), start + paced.n_frames - 1
    pose, transl = base.pose.copy(), base.transl.copy()
    pose[walk] = slerp(base.pose[walk], paced.pose, np.repeat(amount[:, None], 22, axis=1))
    transl[walk, 2] = base.transl[walk, 2] * (1 - amount) + paced.transl[:, 2] * amount
    stride = np.diff(paced.transl[:, :2], axis=0) * ((amount[1:] + amount[:-1]) / 2)[:, None]
    steps = np.diff(base.transl[:, :2], axis=0)
    steps[start:after] += stride
    transl[1:, :2] = transl[0, :2] + np.cumsum(steps, axis=0)
    return dataclasses.replace(base, pose=pose, transl=transl)

"""Filters along time: low-pass, uniform frame rate, mirroring, windows, loops."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float
from scipy.signal import butter, sosfiltfilt

from experiments.body.model import JOINT_NAMES
from experiments.motion.motion import Motion
from experiments.motion.rotations import from_quaternion, to_quaternion

CUTOFF_HZ = 6.0
FPS = 30.0


def low_pass(motion: Motion, cutoff_hz: float = CUTOFF_HZ) -> Motion:
    """Remove tremble above `cutoff_hz`: fourth-order Butterworth, forward and backward (no delay).

    Rotations are filtered as sign-aligned quaternions. Human gait has little above 6 Hz
    (Winter, Biomechanics and Motor Control of Human Movement).
    """
    sections = butter(4, cutoff_hz, fs=motion.fps, output="sos")
    padding = min(motion.n_frames - 1, int(motion.fps))
    quaternion = sosfiltfilt(sections, to_quaternion(motion.pose), axis=0, padlen=padding)
    transl = sosfiltfilt(sections, motion.transl, axis=0, padlen=padding)
    # The filter answers with a reversed view, which torch refuses.
    transl = np.ascontiguousarray(transl)
    return dataclasses.replace(motion, pose=from_quaternion(quaternion), transl=transl)


def resample(motion: Motion, fps: float = FPS) -> Motion:
    """The same motion at uniform `fps`. Low-pass first when going to a lower rate."""
    start, end = motion.times[0], motion.times[-1]
    times = np.arange(int(np.floor((end - start) * fps + 1e-6)) + 1) / fps
    return at_times(motion, start + times, fps)


def at_times(motion: Motion, times: Float[np.ndarray, " S"], fps: float) -> Motion:
    """The motion's state at the times given, played as uniform frames at `fps` from 0 s."""
    quaternion = _interpolate(motion.times, to_quaternion(motion.pose), times)
    return dataclasses.replace(
        motion,
        pose=from_quaternion(quaternion),
        transl=_interpolate(motion.times, motion.transl, times),
        times=np.arange(len(times)) / fps,
        fps=fps,
    )


def window(motion: Motion, start: int, stop: int) -> Motion:
    """Frames `start` to `stop` (exclusive), with time starting at zero."""
    return dataclasses.replace(
        motion,
        pose=motion.pose[start:stop],
        transl=motion.transl[start:stop],
        times=motion.times[start:stop] - motion.times[start],
    )


def mirror(motion: Motion) -> Motion:
    """The motion of the mirror image: left and right exchanged, world x negated."""
    order = [JOINT_NAMES.index(_other_side(name)) for name in JOINT_NAMES]
    return dataclasses.replace(
        motion,
        pose=motion.pose[:, order] * np.array([1.0, -1.0, -1.0]),
        transl=motion.transl * np.array([-1.0, 1.0, 1.0]),
    )


def _other_side(name: str) -> str:
    if name.startswith("left_"):
        return name.replace("left_", "right_")
    return name.replace("right_", "left_")


def _interpolate(
    times: Float[np.ndarray, " T"],
    values: Float[np.ndarray, "T *N"],
    wanted: Float[np.ndarray, " S"],
) -> Float[np.ndarray, "S *N"]:
    # Linear between dense frames; quaternions are normalised by whoever reads them.
    right = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    span = times[right] - times[right - 1]
    share = np.clip((wanted - times[right - 1]) / span, 0, 1)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[right - 1] * (1 - share) + values[right] * share)

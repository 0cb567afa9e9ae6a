"""Spread an alteration that was found at some frames of a motion over all of its frames."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation, Slerp

from experiments.motion.motion import Motion


def spread_alteration(
    whole: Motion,
    kept: Motion,
    delta: Float[np.ndarray, "S 22 3"],
    shift: Float[np.ndarray, "S 3"],
) -> Motion:
    """The whole motion, altered as its kept frames are.

    `delta` (differences of axis-angle vectors, rad) and `shift` (metres) belong to the frames of
    `kept`. Each joint's alteration, the rotation from its original to its altered pose, runs
    between kept frames along the shortest arc, the shift linearly; what the motion itself does
    between them stays. Exact at kept frames. No frame may lie outside the kept ones' time.
    """
    if kept.n_frames == whole.n_frames:
        pose, transl = whole.pose + delta, whole.transl + shift
        return dataclasses.replace(whole, pose=pose, transl=transl)
    pose = np.stack(
        [_turned(whole, kept, delta, joint) for joint in range(whole.pose.shape[1])], axis=1
    )
    moved = [np.interp(whole.times, kept.times, shift[:, axis]) for axis in range(3)]
    return dataclasses.replace(whole, pose=pose, transl=whole.transl + np.stack(moved, axis=1))


def _turned(
    whole: Motion, kept: Motion, delta: Float[np.ndarray, "S 22 3"], joint: int
) -> Float[np.ndarray, "T 3"]:
    original = Rotation.from_rotvec(kept.pose[:, joint])
    altered = Rotation.from_rotvec(kept.pose[:, joint] + delta[:, joint])
    alteration = Slerp(kept.times, original.inv() * altered)(whole.times)
    turned: Float[np.ndarray, "T 3"] = (
        Rotation.from_rotvec(whole.pose[:, joint]) * alteration
    ).as_rotvec()
    return turned

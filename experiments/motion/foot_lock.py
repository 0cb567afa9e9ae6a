"""Foot lock: a weight-bearing foot stays put, the leg follows by inverse kinematics."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import binary_closing, gaussian_filter1d, maximum_filter1d

from experiments.motion.capture import INDEX
from experiments.motion.figure import SIDES, Figure, surface
from experiments.motion.motion import Motion
from experiments.motion.root import contact_velocity
from experiments.motion.rotations import joint_positions, local_pose, world_rotations
from experiments.motion.two_bone import move_end

_MAX_HEIGHT_M = 0.04
_MIN_SPAN = 3
_MAX_GAP = 2
_STRAIGHT = 0.998
_SETTLE_FRAMES = 4.0
_EASE_FRAMES = 1.0
_SWING_CLEARANCE_M = 0.02
"""Toes clear the floor by one to two centimetres in mid-swing (Winter 1992); rigid feet scrape it."""


def lock_feet(motion: Motion, figure: Figure, speed_limit: float = 0.35) -> Motion:
    """Hold the contact point of every weight-bearing foot and set its lowest sole point on the floor.

    A foot bears weight while its contact point moves slower than `speed_limit` (m/s; 0.35 for pure
    recordings, 0.7 for blended clips) within 4 cm of the floor. The *contact point* is held, not the
    ankle, so that the foot still rolls from heel to toe. Foot rotations in the world and the plane in
    which each leg bends are kept.
    """
    offsets = [_offsets(motion, figure, side, speed_limit) for side in range(2)]
    world = world_rotations(motion.pose)
    joints = joint_positions(world, motion.transl, figure.rest_joints)
    targets = [joints[:, INDEX[f"{name}_ankle"]] + offsets[i] for i, name in enumerate(SIDES)]
    drop = _pelvis_drop(joints, targets, sum(figure.leg))
    joints = joints - drop[:, None] * np.array([0.0, 0.0, 1.0])
    for name, target in zip(SIDES, targets, strict=True):
        hip, knee, ankle = (joints[:, INDEX[f"{name}_{p}"]] for p in ("hip", "knee", "ankle"))
        thigh, shank = move_end(hip, knee, ankle, target)
        world[:, INDEX[f"{name}_hip"]] = thigh @ world[:, INDEX[f"{name}_hip"]]
        world[:, INDEX[f"{name}_knee"]] = shank @ world[:, INDEX[f"{name}_knee"]]
    transl = motion.transl - drop * np.array([0.0, 0.0, 1.0])
    return dataclasses.replace(motion, pose=local_pose(world), transl=transl)


def contact_spans(
    points: Float[np.ndarray, "T P 3"], fps: float, speed_limit: float
) -> list[tuple[int, int]]:
    """Frame ranges [start, stop) in which one foot's sole points bear weight."""
    speed = np.linalg.norm(contact_velocity(points, fps), axis=1)
    held = (speed < speed_limit) & (points[..., 2].min(axis=1) < _MAX_HEIGHT_M)
    return [span for span in _spans(_closed(held)) if span[1] - span[0] >= _MIN_SPAN]


def _closed(held: Bool[np.ndarray, " T"]) -> Bool[np.ndarray, " T"]:
    padded = np.pad(held, _MAX_GAP, mode="edge")
    closed = binary_closing(padded, np.ones(_MAX_GAP + 1, dtype=bool)) | padded
    return np.asarray(closed[_MAX_GAP:-_MAX_GAP])


def _spans(held: Bool[np.ndarray, " T"]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], held.astype(np.int8), [0]])))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _offsets(
    motion: Motion, figure: Figure, side: int, speed_limit: float
) -> Float[np.ndarray, "T 3"]:
    """How far the ankle must be moved in every frame."""
    points = surface(figure, motion, figure.soles[side])
    lowest = points[..., 2].min(axis=1)
    velocity = contact_velocity(points, motion.fps)
    spans = contact_spans(points, motion.fps, speed_limit)
    offsets = np.zeros((motion.n_frames, 3))
    for start, stop in spans:
        steps = velocity[start : stop - 1, :2] / motion.fps
        drift = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        offsets[start:stop, :2] = drift.mean(axis=0) - drift
        offsets[start:stop, 2] = -lowest[start:stop]
    _ease_between(offsets, spans)
    short = _clearance(motion.n_frames, spans) - (lowest + offsets[:, 2])
    offsets[:, 2] += np.maximum(short, 0.0)
    # Contact starts and ends within a frame; the leg must not.
    offsets = gaussian_filter1d(offsets, _EASE_FRAMES, axis=0, mode="nearest")
    offsets[:, 2] += np.maximum(-(lowest + offsets[:, 2]), 0.0)
    return offsets


def _swinging(n_frames: int, spans: list[tuple[int, int]]) -> Float[np.ndarray, " T"]:
    """0 while the foot bears weight, 0 to 1 through each swing."""
    phase = np.zeros(n_frames)
    for (_, stop), (start, _) in itertools.pairwise([(0, 0), *spans, (n_frames, n_frames)]):
        phase[stop:start] = (np.arange(stop, start) - stop + 1) / (start - stop + 1)
    return phase


def _clearance(n_frames: int, spans: list[tuple[int, int]]) -> Float[np.ndarray, " T"]:
    """Least height of the sole: on the floor in contact, an arch over it in swing."""
    return np.asarray(_SWING_CLEARANCE_M * np.sin(np.pi * _swinging(n_frames, spans)) ** 0.7)


def _ease_between(offsets: Float[np.ndarray, "T 3"], spans: list[tuple[int, int]]) -> None:
    """Carry the offset from one contact to the next by the minimum-jerk ramp, in place."""
    if not spans:
        return
    offsets[: spans[0][0]] = offsets[spans[0][0]]
    offsets[spans[-1][1] :] = offsets[spans[-1][1] - 1]
    for (_, stop), (start, _) in itertools.pairwise(spans):
        share = minimum_jerk((np.arange(stop, start) - stop + 1) / (start - stop + 1))[:, None]
        offsets[stop:start] = offsets[stop - 1] * (1 - share) + offsets[start] * share


def minimum_jerk(share: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """The ramp from 0 to 1 with least jerk: s^3 (10 - 15 s + 6 s^2) (Flash and Hogan 1985)."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def _pelvis_drop(
    joints: Float[np.ndarray, "T 22 3"], targets: list[Float[np.ndarray, "T 3"]], leg: float
) -> Float[np.ndarray, "T 1"]:
    """How far the pelvis must sink so that both legs reach their feet."""
    needed = np.zeros(len(joints))
    for name, target in zip(SIDES, targets, strict=True):
        gap = joints[:, INDEX[f"{name}_hip"]] - target
        flat = np.sum(gap[:, :2] ** 2, axis=1)
        highest = np.sqrt(np.maximum((leg * _STRAIGHT) ** 2 - flat, 0.0))
        needed = np.maximum(needed, gap[:, 2] - highest)
    return _above(needed, _SETTLE_FRAMES)[:, None]


def _above(needed: Float[np.ndarray, " T"], sigma: float) -> Float[np.ndarray, " T"]:
    """A smooth curve that is nowhere below `needed`."""
    size = 2 * int(np.ceil(3 * sigma)) + 1
    top = maximum_filter1d(needed, size, mode="nearest")
    return np.asarray(gaussian_filter1d(top, sigma, mode="nearest", truncate=3.0))

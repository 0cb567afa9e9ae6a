"""Windows: 62 frames of a clip, augmented, with the body posed for placing it in a room."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Integer

from experiments.body.model import JOINT_NAMES, BodyModel
from experiments.motion.figure import Figure
from experiments.motion.motion import Motion
from experiments.motion.resample import FPS, at_times, mirror
from experiments.synthesis.training_clips import ClipMotion, Support

LENGTH = 62
"""One frame of start, 60 to be synthesised (2 s at 30 fps), one frame of end."""
WARP = 0.15
"""Largest change of pace in augmentation."""
MIN_WAY_M = 0.5
"""Root displacement from first to last frame that a window of RouteNet and PoseNet needs."""
_STILL_M_S = 0.25
_SEATED = 0.72
"""Share of the standing hip height below which a still body counts as carried by something."""
_REACH_M = 0.40
"""Horizontal distance of a still palm from the pelvis that counts as touching."""


@dataclass(frozen=True)
class Window:
    """62 frames at 30 fps. World: z up, metres; the pelvis starts at x = y = 0."""

    pose: Float[np.ndarray, "62 22 3"]
    transl: Float[np.ndarray, "62 3"]
    start_s: float
    """Where in the clip it starts."""

    @property
    def way(self) -> float:
        """Root displacement from first to last frame, metres."""
        return float(np.linalg.norm(self.transl[-1] - self.transl[0]))


@dataclass(frozen=True)
class Markers:
    """Vertices of a body that placing reads, as ids and as rows of that id list."""

    ids: Integer[np.ndarray, " P"]
    seat: Integer[np.ndarray, " S"]
    """Rows of buttocks, thighs and back."""
    palms: tuple[Integer[np.ndarray, " L"], Integer[np.ndarray, " R"]]


@dataclass(frozen=True)
class PosedWindow:
    """Marker positions of a window, and the still frame in which something carries or is touched."""

    points: Float[np.ndarray, "62 P 3"]
    support: Support
    frame: int
    """-1 where `support` is none."""
    rows: Integer[np.ndarray, " K"]
    """Markers that touch in that frame."""


def cut_windows(
    clip: ClipMotion, stride: int, offset: int, rng: np.random.Generator
) -> Iterator[Window]:
    """Windows every `stride` frames from `offset` on, wholly on the floor, each one mirrored or not
    and played up to 15 % slower or faster at random.
    """
    first, last = clip.motion.times[0], clip.motion.times[-1]
    for start in range(offset, clip.motion.n_frames, stride):
        pace = float(rng.uniform(1 - WARP, 1 + WARP))
        flip = bool(rng.random() < 0.5)
        begin = float(clip.motion.times[start])
        times = begin + pace * np.arange(LENGTH) / FPS
        if times[-1] > last:
            return
        frames = slice(start, int(np.ceil((times[-1] - first) * clip.motion.fps)) + 1)
        if clip.on_floor[frames].all():
            yield _window(at_times(clip.motion, times, FPS), flip, begin)


def markers(body: BodyModel) -> Markers:
    """Every fourth vertex of the small mesh, the contact rows and the palms."""
    palms = [body.regions[f"{side}_palm"][::30] for side in ("left", "right")]
    ids = np.unique(np.concatenate([body.subset[::4], body.contact_rows, *palms]))
    carried = np.concatenate([body.regions[n] for n in ("buttocks", "thigh_backs", "back")])
    left, right = (np.flatnonzero(np.isin(ids, palm)) for palm in palms)
    return Markers(ids, np.flatnonzero(np.isin(ids, carried)), (left, right))


def pose_window(window: Window, wanted: Support, figure: Figure, marked: Markers) -> PosedWindow:
    """Skin the markers; find the frame and the markers that touch seat, bed, shelf or table."""
    mesh = figure.body.posed(
        torch.from_numpy(window.pose).float(),
        torch.from_numpy(window.transl).float(),
        marked.ids,
    )
    points = mesh.vertices.double().numpy()
    joints = mesh.joints.double().numpy()
    if wanted == "seat":
        still = _still(joints[:, 0]) & (joints[:, 1:3, 2].mean(1) < _SEATED * figure.hip_height)
        if still.any():
            frame = int(np.flatnonzero(still)[still.sum() // 2])
            height = points[frame, marked.seat, 2]
            return PosedWindow(points, "seat", frame, marked.seat[height < height.min() + 0.05])
    if wanted == "hands":
        frame, side, reach = _farthest_palm(joints)
        if reach > _REACH_M:
            return PosedWindow(points, "hands", frame, marked.palms[side])
    return PosedWindow(points, "none", -1, np.zeros(0, dtype=np.int64))


def _window(motion: Motion, flip: bool, begin: float) -> Window:
    motion = mirror(motion) if flip else motion
    transl = motion.transl - motion.transl[0] * np.array([1.0, 1.0, 0.0])
    return Window(motion.pose, transl, begin)


def _still(path: Float[np.ndarray, "T 3"]) -> Bool[np.ndarray, " T"]:
    speed = np.linalg.norm(np.gradient(path, axis=0), axis=1) * FPS
    return np.asarray(speed < _STILL_M_S)


def _farthest_palm(joints: Float[np.ndarray, "T 22 3"]) -> tuple[int, int, float]:
    """Frame and side (0 left, 1 right) of the still wrist farthest from the pelvis, and how far."""
    best = (0, 0, 0.0)
    for side, name in enumerate(("left_wrist", "right_wrist")):
        wrist = joints[:, JOINT_NAMES.index(name)]
        reach = np.linalg.norm(wrist[:, :2] - joints[:, 0, :2], axis=1)
        reach = np.where(_still(wrist), reach, 0.0)
        if reach.max() > best[2]:
            best = (int(reach.argmax()), side, float(reach.max()))
    return best

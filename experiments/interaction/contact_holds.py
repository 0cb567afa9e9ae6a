"""Holds: spans of a clip in which the body sits, lies, stands still, or keeps a hand in place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Integer
from scipy.ndimage import gaussian_filter1d, label

from experiments.body.model import JOINT_NAMES, BodyModel
from experiments.interaction.canonical import body_yaw
from experiments.interaction.contact_scene import Heading
from experiments.interaction.mesh import feature_vertices
from experiments.motion.motion import Motion

SEATED_SPEED, LYING_SPEED, HAND_SPEED, STANDING_SPEED = 0.30, 0.35, 0.15, 0.12
"""The pelvis, or the hand, is slower than this in a hold, m/s."""
HOLD_FRAMES = 8
LYING_GAP_M = 0.2
"""The trunk of a lying body is this near the lowest of all skin."""
HAND_HEIGHT_M = 0.6
_INDEX = {name: index for index, name in enumerate(JOINT_NAMES)}


@dataclass(frozen=True)
class PosedClip:
    """The feature vertices of a motion. Axes T, V; world with the clip's floor at z = 0, metres."""

    vertices: Float[np.ndarray, "T V 3"]
    joints: Float[np.ndarray, "T 22 3"]
    times: Float[np.ndarray, " T"]
    columns: dict[str, Integer[np.ndarray, " _"]]
    """The body's regions as positions on axis V, besides `head`, `thighs` and `trunk`."""
    palms: dict[str, Float[np.ndarray, "T 3"]]
    """Where the palm of each side faces, unit vectors."""

    def heading(self, frames: slice) -> Heading:
        """Where the body faces in a span, on average."""
        yaw = body_yaw(self.joints[frames])
        return Heading.of(np.array([np.sin(yaw).mean(), -np.cos(yaw).mean(), 0.0]))

    def joint(self, name: str) -> Float[np.ndarray, "T 3"]:
        """Path of one joint."""
        return self.joints[:, _INDEX[name]]


@dataclass(frozen=True)
class Hold:
    """Frames `start` to `stop` (exclusive)."""

    kind: str
    """`seated`, `lying`, `standing`, `left_hand`, `right_hand`."""
    start: int
    stop: int

    @property
    def frames(self) -> slice:
        """As an index."""
        return slice(self.start, self.stop)


def posed_clip(motion: Motion, body: BodyModel) -> PosedClip:
    """Pose the feature vertices of a motion."""
    ids = feature_vertices(body)
    pose = torch.as_tensor(motion.pose, dtype=torch.float32)
    transl = torch.as_tensor(motion.transl, dtype=torch.float32)
    with torch.no_grad():
        mesh = body.posed(pose, transl, ids)
        rest = body.posed(torch.zeros(1, 22, 3), torch.zeros(1, 3), ids)
        turn = body.joint_transforms(pose, transl)[0].double().numpy()
    columns = {name: np.flatnonzero(np.isin(ids, part)) for name, part in body.regions.items()}
    gap = rest.vertices[0][:, None] - rest.joints[0][None]
    part = np.array(JOINT_NAMES)[gap.norm(dim=-1).argmin(1).numpy()]
    columns["head"] = np.flatnonzero(part == "head")
    columns["thighs"] = np.flatnonzero(np.isin(part, ("left_hip", "right_hip")))
    columns["trunk"] = np.flatnonzero(np.isin(part, ("pelvis", "spine1", "spine2", "spine3")))
    # In the zero pose both palms face down its y-axis.
    palms = {side: -turn[:, _INDEX[f"{side}_wrist"], :, 1] for side in ("left", "right")}
    return PosedClip(
        mesh.vertices.double().numpy(), mesh.joints.double().numpy(), motion.times, columns, palms
    )


def find_holds(clip: PosedClip) -> list[Hold]:
    """All holds of a clip; seated, lying and standing ones exclude each other."""
    pelvis = clip.joint("pelvis")
    thigh = _unit(clip.joint("left_knee") + clip.joint("right_knee")
                  - clip.joint("left_hip") - clip.joint("right_hip"))  # fmt: skip
    trunk = _unit(clip.joint("neck") - pelvis)
    speed = _speed(pelvis, clip.times)
    feet = (clip.joint("left_ankle") + clip.joint("right_ankle")) / 2
    ahead = np.linalg.norm((feet - pelvis)[:, :2], axis=1)
    resting = clip.vertices[:, clip.columns["trunk"], 2].min(1) - clip.vertices[..., 2].min(1)
    lying = (trunk[:, 2] < 0.45) & (speed < LYING_SPEED) & (resting < LYING_GAP_M)
    seated = (thigh[:, 2] > -0.45) & (trunk[:, 2] > 0.5) & (speed < SEATED_SPEED)
    # Who squats has the feet below the pelvis, who sits has them ahead of it.
    seated &= (pelvis[:, 2] > 0.28) & (ahead > 0.20) & ~lying
    upright = (thigh[:, 2] < -0.8) & (trunk[:, 2] > 0.75)
    holds = [
        *_spans("seated", seated | _perched(clip, thigh, ahead, speed)),
        *_spans("lying", lying),
    ]
    holds += _spans("standing", upright & (speed < STANDING_SPEED))
    for side in ("left", "right"):
        holds += _spans(f"{side}_hand", _hand_held(clip, side) & (trunk[:, 2] > 0.3) & ~seated)
    return holds


def _perched(
    clip: PosedClip,
    thigh: Float[np.ndarray, "T 3"],
    ahead: Float[np.ndarray, " T"],
    speed: Float[np.ndarray, " T"],
) -> Bool[np.ndarray, " T"]:
    """Half sitting on something high: the pelvis would fall over backwards without it."""
    soles = clip.vertices[
        :, np.concatenate([clip.columns["left_sole"], clip.columns["right_sole"]])
    ]
    down = soles[..., 2].max(1) < 0.08
    leaning = (thigh[:, 2] > -0.93) & (ahead > 0.30)
    trunk = _unit(clip.joint("neck") - clip.joint("pelvis"))
    behind = np.linalg.norm((clip.joint("neck") - clip.joint("pelvis"))[:, :2], axis=1) < 0.25
    return np.asarray(leaning & down & behind & (trunk[:, 2] > 0.8) & (speed < SEATED_SPEED))


def _hand_held(clip: PosedClip, side: str) -> Bool[np.ndarray, " T"]:
    yaw = body_yaw(clip.joints)
    facing = np.stack([np.sin(yaw), -np.cos(yaw)], axis=1)
    hand = clip.joint(f"{side}_wrist")
    reach = ((hand - clip.joint("pelvis"))[:, :2] * facing).sum(1)
    slow = _speed(hand, clip.times) < HAND_SPEED
    return np.asarray((reach > 0.26) & slow & (hand[:, 2] > HAND_HEIGHT_M))


def _spans(kind: str, frames: Bool[np.ndarray, " T"]) -> list[Hold]:
    numbered, count = label(frames)
    spans = [np.flatnonzero(numbered == number) for number in range(1, count + 1)]
    return [Hold(kind, int(s[0]), int(s[-1]) + 1) for s in spans if len(s) >= HOLD_FRAMES]


def _speed(
    path: Float[np.ndarray, "T 3"], times: Float[np.ndarray, " T"]
) -> Float[np.ndarray, " T"]:
    speed = np.linalg.norm(np.gradient(path, times, axis=0), axis=1)
    return np.asarray(gaussian_filter1d(speed, 2.0))


def _unit(vector: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-9))

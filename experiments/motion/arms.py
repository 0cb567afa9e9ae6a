"""Arms of an authored motion: hanging, reaching for a target, resting on the thigh, palm on a surface.

Hanging and reaching arms are built separately and mixed as rotations, so that the hand travels on an
arc about the shoulder and never through it. The frame of an arm bone has its x-axis along the bone
(left; right: against it) and its y-axis on the back of the elbow's hinge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from experiments.motion.capture import INDEX
from experiments.motion.figure import Figure
from experiments.motion.rotations import (
    about,
    joint_positions,
    steady_slerp,
    to_axis_angle,
    to_matrix,
    to_quaternion,
    unit,
)
from experiments.motion.two_bone import middle_joint

_TRUNK_FOLLOW = 0.3
"""Share of the trunk's pitch that a hanging arm takes on: gravity keeps it near the vertical."""
_RHYTHM_SHARE, _RHYTHM_FROM_DEG = 0.28, 40.0
"""Scapulohumeral rhythm: the collar rises with the arm once the arm is well up (Inman 1944)."""
_SOFT_M = 0.03
_RIDE_ALONG = 0.74
_RIDE_ABOVE_M = 0.034
_RIDE_INWARD_DEG = 12.0

Frames = Float[np.ndarray, "T 3 3"]
Path = Float[np.ndarray, "T 3"]


@dataclass(frozen=True)
class _Arm:
    upper: Frames
    fore: Frames


def pose_arm(
    world: Float[np.ndarray, "T 22 3 3"],
    transl: Path,
    channels: dict[str, Float[np.ndarray, "T K"]],
    figure: Figure,
    side: str,
) -> None:
    """Collar (rising with the arm), upper arm, forearm and hand of one side, in place."""
    own = {name: channels[f"{side}_{name}"] for name in _SIDE_NAMES}
    trunk_pitch = channels["pitch"][:, 0] + channels["flex"][:, 0]
    base = world[:, INDEX["spine3"]] @ about(
        "x", -(1 - _TRUNK_FOLLOW) * np.clip(trunk_pitch, -20.0, 70.0)
    )
    joints = joint_positions(world, transl, figure.rest_joints)
    target, palm_frame = _target(own, world, joints, figure, side)
    hanging = _hanging(base, own["hang"], side)
    reaching = _reaching(joints, base, target, own, figure, side)
    _raise_collar(world, _mix(hanging, reaching, base, own), side)
    joints = joint_positions(world, transl, figure.rest_joints)
    reaching = _reaching(joints, base, target, own, figure, side)
    arm = _mix(hanging, reaching, base, own)
    fore, hand = _hand(arm.fore, own, palm_frame, side)
    for part, frames in (("shoulder", arm.upper), ("elbow", fore), ("wrist", hand)):
        world[:, INDEX[f"{side}_{part}"]] = frames


_SIDE_NAMES = (
    "hang", "pronation", "wrist", "hand", "reach", "swivel", "palm", "palm_frame", "ride",
)  # fmt: skip


def _target(
    own: dict[str, Float[np.ndarray, "T K"]],
    world: Float[np.ndarray, "T 22 3 3"],
    joints: Float[np.ndarray, "T 22 3"],
    figure: Figure,
    side: str,
) -> tuple[Path, Frames]:
    """Where the wrist goes and how the palm lies there: a point in the world or on the own thigh."""
    hip, knee = joints[:, INDEX[f"{side}_hip"]], joints[:, INDEX[f"{side}_knee"]]
    along = unit(knee - hip)
    outward = unit(world[:, INDEX[f"{side}_hip"], :, 2])
    above = figure.thigh_front + _RIDE_ABOVE_M
    on_thigh = hip + _RIDE_ALONG * (knee - hip) + above * outward
    sign = 1.0 if side == "left" else -1.0
    thigh_frame = _palm_frame(along, outward, side) @ about(
        "y", np.full(len(hip), sign * _RIDE_INWARD_DEG)
    )
    yaw, tilt, roll = own["palm_frame"].T
    fingers = about("z", yaw) @ about("x", -tilt)
    free_frame = _palm_frame(-fingers[..., 1], fingers[..., 2], side) @ about("x", sign * roll)
    ride = own["ride"]
    frame = steady_slerp(free_frame, thigh_frame, ride[:, 0])
    return own["hand"] * (1 - ride) + on_thigh * ride, frame


def _palm_frame(fingers: Path, back: Path, side: str) -> Frames:
    """Hand frame with fingers pointing one way and the back of the hand facing another."""
    x = fingers if side == "left" else -fingers
    return np.stack([x, back, np.cross(x, back)], axis=-1)


def _hanging(base: Frames, hang: Float[np.ndarray, "T 4"], side: str) -> _Arm:
    """Arm from its angles in the (gravity-following) frame of the chest."""
    out, forward, elbow, inward = np.radians(hang).T
    sign = 1.0 if side == "left" else -1.0
    upper = np.stack(
        [
            sign * np.sin(out) * np.cos(forward),
            -np.cos(out) * np.cos(forward),
            np.sin(forward),
        ],
        axis=-1,
    )
    hinge = np.stack([-np.cos(inward), np.zeros_like(inward), -sign * np.sin(inward)], axis=-1)
    hinge = unit(hinge - np.sum(hinge * upper, axis=-1, keepdims=True) * upper)
    fore = to_matrix(hinge * elbow[:, None]) @ upper[..., None]
    upper, fore, hinge = ((base @ v.reshape(-1, 3, 1))[..., 0] for v in (upper, fore, hinge))
    return _Arm(_bone_frame(upper, hinge, side), _bone_frame(fore, hinge, side))


def _reaching(
    joints: Float[np.ndarray, "T 22 3"],
    base: Frames,
    target: Path,
    own: dict[str, Float[np.ndarray, "T K"]],
    figure: Figure,
    side: str,
) -> _Arm:
    """Two-bone solution with the elbow down and outwards."""
    shoulder = joints[:, INDEX[f"{side}_shoulder"]]
    swivel = np.radians(own["swivel"][:, 0])
    sign = 1.0 if side == "left" else -1.0
    pole = np.stack([sign * np.sin(swivel), -np.cos(swivel), np.full(len(swivel), -0.25)], axis=-1)
    pole = (base @ pole[..., None])[..., 0]
    elbow, wrist = middle_joint(shoulder, target, pole, figure.arm, _SOFT_M)
    upper, fore = unit(elbow - shoulder), unit(wrist - elbow)
    hinge = unit(np.cross(upper, fore))
    return _Arm(_bone_frame(upper, hinge, side), _bone_frame(fore, hinge, side))


def _bone_frame(bone: Path, hinge: Path, side: str) -> Frames:
    x, y = (bone, -hinge) if side == "left" else (-bone, hinge)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _mix(
    hanging: _Arm, reaching: _Arm, base: Frames, own: dict[str, Float[np.ndarray, "T K"]]
) -> _Arm:
    """From hanging (0) to reaching (1): upper arm in the chest's frame, forearm about the elbow."""
    share = np.clip(own["reach"][:, 0], 0.0, 1.0)
    inverse = np.swapaxes(base, -1, -2)
    upper = base @ steady_slerp(inverse @ hanging.upper, inverse @ reaching.upper, share)
    bent = [np.swapaxes(arm.upper, -1, -2) @ arm.fore for arm in (hanging, reaching)]
    return _Arm(upper, upper @ steady_slerp(bent[0], bent[1], share))


def _raise_collar(world: Float[np.ndarray, "T 22 3 3"], arm: _Arm, side: str) -> None:
    sign = 1.0 if side == "left" else -1.0
    bone = sign * arm.upper[..., 0]
    chest_up = world[:, INDEX["spine3"], :, 1]
    elevation = np.degrees(np.arccos(np.clip(-np.sum(bone * chest_up, axis=-1), -1.0, 1.0)))
    # A soft corner at the threshold: the collar must not start with a jerk.
    excess = np.logaddexp(0.0, (elevation - _RHYTHM_FROM_DEG) / 12.0) * 12.0
    joint = INDEX[f"{side}_collar"]
    world[:, joint] = world[:, joint] @ about("z", sign * _RHYTHM_SHARE * excess)


def _hand(
    fore: Frames, own: dict[str, Float[np.ndarray, "T K"]], palm_frame: Frames, side: str
) -> tuple[Frames, Frames]:
    """Forearm with its share of the pronation, and the hand: by angles or laid on a surface."""
    sign = 1.0 if side == "left" else -1.0
    by_angles = about("x", own["pronation"][:, 0]) @ about("z", sign * own["wrist"][:, 0])
    laid = np.swapaxes(fore, -1, -2) @ palm_frame
    palm = np.clip((np.maximum(own["palm"], own["ride"]) * own["reach"])[:, 0], 0.0, 1.0)
    local = steady_slerp(by_angles, laid, palm)
    twist = _twist_about_x(local)
    return fore @ about("x", 0.5 * twist), fore @ local


def _twist_about_x(local: Frames) -> Float[np.ndarray, " T"]:
    """Angle (degrees) of the part of a rotation that is about the bone: swing-twist decomposition."""
    quaternion = to_quaternion(to_axis_angle(local))
    return np.asarray(np.degrees(np.unwrap(2 * np.arctan2(quaternion[:, 0], quaternion[:, 3]))))

"""Perform: a score becomes body parameters, limb by limb, by construction (no search)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from experiments.motion.arms import pose_arm
from experiments.motion.capture import INDEX
from experiments.motion.figure import SIDES, Figure
from experiments.motion.life import add_life
from experiments.motion.motion import Motion
from experiments.motion.rotations import (
    UPRIGHT,
    about,
    joint_positions,
    local_pose,
    to_axis_angle,
    to_matrix,
    unit,
)
from experiments.motion.score import Score
from experiments.motion.two_bone import middle_joint

FPS = 30.0
_STRAIGHT = 0.9985
_SPINE_SHARES = {"spine1": 0.35, "spine2": 0.35, "spine3": 0.30}
_NECK_SHARE = 0.4
_GAZE_LIMIT_DEG = np.array([50.0, 70.0, 20.0])

Channels = dict[str, Float[np.ndarray, "T K"]]


def perform(score: Score, label: str, seed: int, life: float = 1.0) -> Motion:
    """The authored motion on the score's body at 30 fps, up to the score's beat.

    `seed` draws the sway and breathing, `life` scales them (0: none).
    """
    times = np.arange(round(score.beat * FPS) + 1) / FPS
    channels = add_life(score.sample(times), times, np.random.default_rng(seed), life)
    world = np.tile(UPRIGHT, (len(times), 22, 1, 1))
    hip = channels["hip"].copy()
    _pose_trunk(world, channels)
    ankles = {side: _pose_foot(world, channels, score.figure, side) for side in SIDES}
    hip[:, 2] -= _drop(world, hip, ankles, score.figure)
    transl = hip - world[:, 0] @ score.figure.hip_from_pelvis - score.figure.rest_joints[0]
    for side in SIDES:
        _pose_leg(world, transl, channels, score.figure, side, ankles[side])
    for side in SIDES:
        pose_arm(world, transl, channels, score.figure, side)
    return Motion(
        pose=local_pose(world),
        transl=transl,
        times=times,
        fps=FPS,
        motion_id=label.replace(" ", "_"),
        label=label,
        source="authored key poses",
        body=score.figure.body.name,
    )


def _pose_trunk(world: Float[np.ndarray, "T 22 3 3"], channels: Channels) -> None:
    """Pelvis, spine, collars, neck and head, in place."""
    yaw, pitch, roll = (channels[name][:, 0] for name in ("yaw", "pitch", "roll"))
    below = about("z", yaw) @ about("x", pitch) @ about("y", roll) @ UPRIGHT
    world[:, 0] = below
    flex, twist, bend = (channels[name][:, 0] for name in ("flex", "twist", "bend"))
    for name, share in _SPINE_SHARES.items():
        turn = about("y", share * twist) @ about("x", share * flex) @ about("z", -share * bend)
        below = below @ turn
        world[:, INDEX[name]] = below
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        lift, forward = channels[f"{side}_shrug"][:, 0], channels[f"{side}_protract"][:, 0]
        world[:, INDEX[f"{side}_collar"]] = (
            below @ about("y", -sign * forward) @ about("z", sign * lift)
        )
    _pose_head(world, channels)


def _pose_head(world: Float[np.ndarray, "T 22 3 3"], channels: Channels) -> None:
    """The head seeks its gaze in the world, within what a neck can do, unless it is free."""
    chest = world[:, INDEX["spine3"]]
    gaze = channels["gaze"]
    wanted = about("z", gaze[:, 1]) @ about("x", gaze[:, 0]) @ UPRIGHT
    wanted = wanted @ about("z", -channels["gaze_roll"][:, 0])
    turn = _clamped(np.degrees(to_axis_angle(np.swapaxes(chest, -1, -2) @ wanted)))
    free = channels["head_free"]
    nod = channels["head_flex"] * np.array([1.0, 0.0, 0.0])
    turn = np.radians(turn * (1 - free) + nod * free)
    world[:, INDEX["neck"]] = chest @ to_matrix(_NECK_SHARE * turn)
    world[:, INDEX["head"]] = chest @ to_matrix(turn)


def _clamped(turn: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    # tanh bends softly towards the limit, so that the head never stops dead at it.
    return np.asarray(_GAZE_LIMIT_DEG * np.tanh(turn / _GAZE_LIMIT_DEG))


def _pose_foot(
    world: Float[np.ndarray, "T 22 3 3"], channels: Channels, figure: Figure, side: str
) -> Float[np.ndarray, "T 3"]:
    """Foot and toes in place; the ankle's path. Heel lifts pivot at the ball, toe lifts at the heel."""
    pitch = channels[f"{side}_heel"][:, 0]
    heading = about("z", channels[f"{side}_toe_out"][:, 0]) @ UPRIGHT
    tilt = about("x", pitch)
    world[:, INDEX[f"{side}_ankle"]] = heading @ tilt
    world[:, INDEX[f"{side}_foot"]] = heading @ about("x", np.minimum(pitch, 0.0))
    mirror = np.array([1.0 if side == "left" else -1.0, 1.0, 1.0])
    pivot = np.where(pitch[:, None] > 0, figure.ball * mirror, figure.heel * mirror)
    rise = np.array([0.0, figure.ankle_height, 0.0]) + pivot - _apply(tilt, pivot)
    return np.asarray(channels[f"{side}_foot"] + _apply(heading, rise))


def _drop(
    world: Float[np.ndarray, "T 22 3 3"],
    hip: Float[np.ndarray, "T 3"],
    ankles: dict[str, Float[np.ndarray, "T 3"]],
    figure: Figure,
) -> Float[np.ndarray, " T"]:
    """How far the hips must sink for both feet to be within reach; smooth, never too little."""
    needed = np.zeros(len(hip))
    for side in SIDES:
        half = figure.rest_joints[INDEX[f"{side}_hip"]] - figure.rest_joints[0]
        joint = hip + world[:, 0] @ (half - figure.hip_from_pelvis)
        gap = joint - ankles[side]
        span = (_STRAIGHT * sum(figure.leg)) ** 2 - np.sum(gap[:, :2] ** 2, axis=1)
        needed = np.maximum(needed, gap[:, 2] - np.sqrt(np.maximum(span, 0.0)))
    return np.asarray(gaussian_filter1d(maximum_filter1d(needed, 13), 2.0, mode="nearest"))


def _pose_leg(
    world: Float[np.ndarray, "T 22 3 3"],
    transl: Float[np.ndarray, "T 3"],
    channels: Channels,
    figure: Figure,
    side: str,
    ankle: Float[np.ndarray, "T 3"],
) -> None:
    """Thigh and shank in place: the knee points between where pelvis and foot point, plus splay."""
    hip = joint_positions(world, transl, figure.rest_joints)[:, INDEX[f"{side}_hip"]]
    sign = 1.0 if side == "left" else -1.0
    splay = about("y", sign * channels[f"{side}_splay"][:, 0])
    forward = _apply(world[:, 0] @ splay, np.tile([0.0, 0.0, 1.0], (len(hip), 1)))
    toes = world[:, INDEX[f"{side}_ankle"], :, 2]
    pole = forward + 0.6 * toes
    knee, ankle = middle_joint(hip, ankle, pole, figure.leg)
    hinge = unit(np.cross(hip - ankle, pole))
    for name, bone in (("hip", knee - hip), ("knee", ankle - knee)):
        up = -unit(bone)
        world[:, INDEX[f"{side}_{name}"]] = np.stack([hinge, up, np.cross(hinge, up)], axis=-1)


def _apply(
    matrices: Float[np.ndarray, "T 3 3"], vectors: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "T 3"]:
    return np.asarray((matrices @ vectors[..., None])[..., 0])

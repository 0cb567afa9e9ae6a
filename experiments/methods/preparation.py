"""What every placement method does first: features, frame weights, thinning, the problem itself."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int64

from experiments.body.model import BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.motion.motion import Motion
from experiments.placement.features import choose_features
from experiments.placement.problem import Problem, build_problem
from experiments.placement.settings import PlacementSettings
from experiments.scene.scene import Scene
from experiments.weighting.frame_weights import frame_weights
from experiments.weighting.thinning import kept_frames, kept_weights
from experiments.weighting.weights import FrameWeights

Weigh = Callable[[Motion, BodyModel, InteractionFeatures, PlacementSettings, int], FrameWeights]
"""(motion, body, features, settings, seed) -> k of every frame."""


def prepare(
    motion: Motion,
    scene: Scene,
    body: BodyModel,
    settings: PlacementSettings,
    seed: int,
    weigh: Weigh = frame_weights,
    energy: PlacementSettings | None = None,
) -> Problem:
    """The problem that a method solves. Raises `PlacementError` where no feature map has a start.

    Features are those of the whole clip, chosen with `settings`, so that all methods are asked for
    the same contacts; `energy` may hold other terms than `settings`. Clips faster than 30 fps are
    thinned by PACE's frame weights, whatever the method weighs with: all optimise the same frames.
    """
    motion = dataclasses.replace(motion, pose=unwrapped(motion.pose))
    features = choose_features(motion, scene, body, settings)
    weights = weigh(motion, body, features, settings, seed)
    importance = frame_weights(motion, body, features, settings, seed).values
    kept = kept_frames(motion.times, importance)
    problem = build_problem(
        at_frames(motion, kept),
        scene,
        body,
        energy or settings,
        features_at(features, kept),
        kept_weights(weights, kept),
    )
    return dataclasses.replace(problem, whole=motion)


def at_frames(motion: Motion, frames: Int64[np.ndarray, " S"]) -> Motion:
    """Some frames of a motion with their time stamps."""
    if len(frames) == motion.n_frames:
        return motion
    return dataclasses.replace(
        motion,
        pose=motion.pose[frames],
        transl=motion.transl[frames],
        times=motion.times[frames],
    )


def features_at(
    features: InteractionFeatures, frames: Int64[np.ndarray, " S"]
) -> InteractionFeatures:
    """The features of some frames."""
    return dataclasses.replace(
        features, contact=features.contact[frames], semantics=features.semantics[frames]
    )


def unwrapped(pose: Float[np.ndarray, "T 22 3"]) -> Float[np.ndarray, "T 22 3"]:
    """The same rotations with axis-angle vectors that do not jump by a full turn between frames.

    An alteration is a difference of these vectors: where they jump, a smooth difference would be
    a sudden change of the body.
    """
    smooth = pose.copy()
    for frame in range(1, len(pose)):
        angle = np.linalg.norm(smooth[frame], axis=-1, keepdims=True)
        axis = smooth[frame] / np.maximum(angle, 1e-9)
        along = np.sum(smooth[frame - 1] * axis, axis=-1, keepdims=True)
        turns = np.round((along - angle) / (2 * np.pi))
        smooth[frame] = np.where(turns != 0, axis * (angle + 2 * np.pi * turns), smooth[frame])
    return smooth

"""PAAK-style placement: POSA's loss over all frames, each weighted by what the motion does in it.

PAAK (Mullen et al.) has no public code and its paper does not print the weights; the weights here
are ours (`experiments.weighting`), and every table names the method "PAAK-style (re-implemented)".
"""

from __future__ import annotations

from experiments.body.model import BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.methods.preparation import prepare
from experiments.methods.rigid import place_rigid
from experiments.motion.motion import Motion
from experiments.placement.placement import Placement
from experiments.placement.settings import PlacementSettings
from experiments.scene.scene import Scene
from experiments.weighting.frame_weights import frame_weights, keyframes_only
from experiments.weighting.weights import FrameWeights


def paak(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings, seed: int
) -> Placement:
    """Place a motion rigidly, minimising E(tau, theta) = sum_i K_i (L_afford,i + L_pen,i).

    Raises `PlacementError` where there is no place.
    """
    problem = prepare(motion, scene, body, settings, seed, paak_weights)
    return place_rigid(problem, "paak", seed)


def paak_weights(
    motion: Motion,
    body: BodyModel,
    features: InteractionFeatures,
    settings: PlacementSettings,
    seed: int,
) -> FrameWeights:
    """K of all frames (`soft`), or of the keyframes alone (`top_k`) as PAAK's name suggests."""
    weights = frame_weights(motion, body, features, settings, seed)
    if settings.paak_mode == "soft":
        return weights
    return keyframes_only(weights, settings.paak_top_share)

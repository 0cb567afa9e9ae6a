"""The frame weights k of PAAK and PACE: K = lambda_g K_g^ + lambda_b W_d (PACE, equation 2)."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from experiments.body.model import BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.interaction.mesh import moving_body
from experiments.motion.motion import Motion
from experiments.placement.settings import PlacementSettings
from experiments.weighting.geometric import geometric_weights
from experiments.weighting.weights import FrameWeights
from renderer.files import InputError


def frame_weights(
    motion: Motion,
    body: BodyModel,
    features: InteractionFeatures,
    settings: PlacementSettings,
    seed: int,
) -> FrameWeights:
    """k of every frame of a motion, mean 1, by the rule that `settings.weighting` names.

    Depends on the motion and on what it is expected to touch, not on where it goes; methods that
    are given the same features and seed use the same weights.
    """
    if settings.weighting != "geometric":
        raise InputError("placement settings", "weighting", settings.weighting, "geometric")
    moving = moving_body(motion, body)
    columns = np.searchsorted(moving.vertex_ids, features.vertex_ids)
    return geometric_weights(moving.vertices[:, columns], motion.times, features)


def keyframes_only(weights: FrameWeights, share: float) -> FrameWeights:
    """Keep the frames of highest weight, that share of them (at least one), and drop the others.

    Ties go to the earlier frame. The weights kept are scaled to mean 1 over all frames.
    """
    count = max(1, round(share * len(weights.values)))
    kept = np.argsort(-weights.values, kind="stable")[:count]
    values: Float[np.ndarray, " T"] = np.zeros(len(weights.values))
    values[kept] = weights.values[kept]
    return dataclasses.replace(
        weights, values=values / values.mean(), rule=f"{weights.rule}, top {share:.0%}"
    )

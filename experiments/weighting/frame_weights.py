"""The frame weights k of PAAK and PACE: K = lambda_g K_g^ + lambda_b W_d (PACE, equation 2)."""

from __future__ import annotations

import dataclasses
import hashlib

import numpy as np
import torch
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from experiments.body.model import BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.interaction.mesh import moving_body
from experiments.motion.motion import Motion
from experiments.placement.settings import PlacementSettings
from experiments.weighting.diversity import diversity, gradient_factors
from experiments.weighting.geometric import geometric_weights
from experiments.weighting.inputs import MotionInputs, motion_inputs
from experiments.weighting.network import FrameWeightNetwork
from experiments.weighting.weights import FrameWeights, uniform_weights
from experiments.weighting.weights_file import load_network
from renderer.files import InputError

RULES = ("paak", "geometric", "uniform")
LAMBDA_G = 0.7
"""Share of the estimated geometric weight (ours: PACE gives neither factor)."""
LAMBDA_B = 0.3
"""Share of the diversity score (ours): at equal shares a held sit, whose frames are all alike, would
weigh less than the walk that led to it."""
SMOOTHING_FRAMES = 2.0
"""Standard deviation of the smoothing of W_d over time, in frames at 30 per second: k also stiffens
E_alt, and neighbours that look alike must not differ by the luck of the draw."""


def frame_weights(
    motion: Motion,
    body: BodyModel,
    features: InteractionFeatures,
    settings: PlacementSettings,
    seed: int,
) -> FrameWeights:
    """k of every frame of a motion, mean 1, by the rule that `settings.weighting` names.

    `paak` is the printed K; `geometric` is K_g itself, which the network only estimates; `uniform`
    lets every frame count alike. Depends on the motion and on what it is expected to touch, not on
    where it goes: methods that are given the same features and seed use the same weights.
    """
    if settings.weighting not in RULES:
        wanted = "one of " + ", ".join(RULES)
        raise InputError("placement settings", "weighting", settings.weighting, wanted)
    if settings.weighting == "uniform":
        return uniform_weights(motion.n_frames)
    moving = moving_body(motion, body)
    if settings.weighting == "geometric":
        columns = np.searchsorted(moving.vertex_ids, features.vertex_ids)
        return geometric_weights(moving.vertices[:, columns], motion.times, features)
    inputs = motion_inputs(moving, body, features)
    values = active_weights(load_network(), inputs, clip_seed(motion, seed))
    return FrameWeights(values, "paak")


def active_weights(
    network: FrameWeightNetwork, inputs: MotionInputs, seed: int
) -> Float[np.ndarray, " T"]:
    """K = lambda_g K_g^ + lambda_b W_d, both of mean 1 and W_d smoothed, scaled to mean 1."""
    with torch.no_grad():
        hidden = network.hidden(inputs)
        scores = network.head(hidden)
        estimate = np.asarray(network.expectation(scores).double().numpy())
    drawn = diversity(*gradient_factors(scores, hidden), seed)
    spread = gaussian_filter1d(drawn, SMOOTHING_FRAMES * inputs.stride, mode="nearest")
    mixed = LAMBDA_G * estimate / estimate.mean() + LAMBDA_B * spread / spread.mean()
    return np.asarray(mixed / mixed.mean())


def clip_seed(motion: Motion, seed: int) -> int:
    """The seed of a motion's diversity score: motions of one set draw independently."""
    digest = hashlib.sha256(f"{seed} {motion.motion_id}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


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

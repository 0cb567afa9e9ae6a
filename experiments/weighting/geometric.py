"""The geometric frame weight K_g: frames that move, interact rarely or interact strongly count more.

PAAK (Mullen et al.) describes such a weight and does not print it; this formula is ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d
from scipy.stats import rankdata

from experiments.interaction.features import InteractionFeatures
from experiments.weighting.weights import FrameWeights

SMOOTHING_S = 2.0 / 30.0
"""Standard deviation of the smoothing of speed over time: two frames at 30 per second."""
EVEN_SHARE = 0.25
"""Given to every frame before the ranks: k also stiffens E_alt, and a frame with a weight near zero
would be free to jump."""
MOTION_SHARE, RARITY_SHARE, STRENGTH_SHARE = 0.3, 0.5, 0.2
CONTACT_THRESHOLD = 0.5
_FLOOR = 2


def geometric_weights(
    vertices: Float[np.ndarray, "T V 3"],
    times: Float[np.ndarray, " T"],
    features: InteractionFeatures,
) -> FrameWeights:
    """K_g per frame, mean 1: a mix of the ranks of speed, rarity and strength of interaction.

    `vertices` are those of the features, metres, in any fixed frame; `times` seconds.
    """
    return FrameWeights(frame_cues(vertices, times, features).weights(), "geometric")


@dataclass(frozen=True)
class FrameCues:
    """What K_g ranks, per frame."""

    speed: Float[np.ndarray, " T"]
    """Mean vertex speed, m/s, smoothed."""
    histogram: Float[np.ndarray, "T 42"]
    """What the frame touches; see `class_histogram`."""
    strength: Float[np.ndarray, " T"]
    """Share of the vertices in contact with something other than the floor."""

    def weights(self, part: slice = slice(None)) -> Float[np.ndarray, " t"]:
        """K_g of the clip, or of a part of it taken as a clip of its own; mean 1."""
        mix = (
            EVEN_SHARE
            + MOTION_SHARE * relative_rank(self.speed[part])
            + RARITY_SHARE * relative_rank(interaction_rarity(self.histogram[part]))
            + STRENGTH_SHARE * relative_rank(self.strength[part])
        )
        weights: Float[np.ndarray, " t"] = mix / mix.mean()
        return weights


def frame_cues(
    vertices: Float[np.ndarray, "T V 3"],
    times: Float[np.ndarray, " T"],
    features: InteractionFeatures,
) -> FrameCues:
    """Speed, classes touched and strength of contact of every frame; arguments as above."""
    contact = features.contact > CONTACT_THRESHOLD
    return FrameCues(
        speed=motion_speed(vertices, times),
        histogram=class_histogram(features, contact),
        strength=interaction_strength(features, contact),
    )


def motion_speed(
    vertices: Float[np.ndarray, "T V 3"], times: Float[np.ndarray, " T"]
) -> Float[np.ndarray, " T"]:
    """Mean vertex speed by central differences, m/s, smoothed over time."""
    speed = np.linalg.norm(np.gradient(vertices, times, axis=0), axis=-1).mean(-1)
    frames = SMOOTHING_S / float(np.median(np.diff(times)))
    smooth: Float[np.ndarray, " T"] = gaussian_filter1d(speed, frames)
    return smooth


def interaction_rarity(histogram: Float[np.ndarray, "T 42"]) -> Float[np.ndarray, " T"]:
    """One minus the mean cosine of a frame's class histogram with all frames' histograms."""
    unit = histogram / np.linalg.norm(histogram, axis=1, keepdims=True)
    rarity: Float[np.ndarray, " T"] = 1.0 - unit @ unit.mean(0)
    return rarity


def class_histogram(
    features: InteractionFeatures, contact: Bool[np.ndarray, "T V"]
) -> Float[np.ndarray, "T 42"]:
    """What a frame touches: contact mass by class, with "nothing" in the place of void. Rows sum to 1."""
    scores = features.semantics.astype(np.float64)
    scores = np.exp(scores - scores.max(-1, keepdims=True))
    scores[..., 0] = 0.0
    share = scores / scores.sum(-1, keepdims=True)
    mass = np.einsum("tv,tvc->tc", np.where(contact, features.contact, 0.0), share)
    mass[:, 0] = ~contact.any(1)
    histogram: Float[np.ndarray, "T 42"] = mass / mass.sum(1, keepdims=True)
    return histogram


def interaction_strength(
    features: InteractionFeatures, contact: Bool[np.ndarray, "T V"]
) -> Float[np.ndarray, " T"]:
    """Share of the vertices in contact with something other than the floor."""
    beyond = contact & (features.semantics.argmax(-1) != _FLOOR)
    strength: Float[np.ndarray, " T"] = beyond.mean(1)
    return strength


def relative_rank(values: Float[np.ndarray, " T"]) -> Float[np.ndarray, " T"]:
    """Ranks scaled to (0, 1], ties sharing their mean rank; never zero, so no frame is free.

    Values are rounded first: float noise must not rank frames that are the same.
    """
    scale = float(np.abs(values).max()) or 1.0
    ranks: Float[np.ndarray, " T"] = rankdata(np.round(values / scale, 6)) / len(values)
    return ranks

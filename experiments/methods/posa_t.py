"""POSA-T: POSA's placement with its loss summed over all frames; one rigid motion, equal weights."""

from __future__ import annotations

from experiments.body.model import BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.methods.preparation import prepare
from experiments.methods.rigid import place_rigid
from experiments.motion.motion import Motion
from experiments.placement.placement import Placement
from experiments.placement.settings import PlacementSettings
from experiments.scene.scene import Scene
from experiments.weighting.weights import FrameWeights, uniform_weights


def posa_t(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings, seed: int
) -> Placement:
    """Place a motion rigidly; the baseline of PACE's study. Raises `PlacementError`."""
    return place_rigid(prepare(motion, scene, body, settings, seed, alike), "posa_t", seed)


def alike(
    motion: Motion,
    _body: BodyModel,
    _features: InteractionFeatures,
    _settings: PlacementSettings,
    _seed: int,
) -> FrameWeights:
    """POSA-T's frame weights: all frames count alike."""
    return uniform_weights(motion.n_frames)

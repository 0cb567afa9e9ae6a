"""POSA-T: POSA's placement with its loss summed over all frames; one rigid motion, equal weights."""

from __future__ import annotations

from experiments.body.model import BodyModel
from experiments.methods.outcome import to_placement
from experiments.motion.motion import Motion
from experiments.placement.candidates import find_starts
from experiments.placement.features import choose_features
from experiments.placement.placement import Placement
from experiments.placement.problem import build_problem
from experiments.placement.settings import PlacementSettings
from experiments.placement.solver import fit_rigid
from experiments.scene.scene import Scene
from experiments.weighting.weights import uniform_weights


def posa_t(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings, seed: int
) -> Placement:
    """Place a motion rigidly; the baseline of PACE's study. Raises `PlacementError`."""
    features = choose_features(motion, scene, body, settings)
    weights = uniform_weights(motion.n_frames)
    problem = build_problem(motion, scene, body, settings, features, weights)
    starts = find_starts(problem)
    fits = [
        fit_rigid(problem, float(starts.yaw[i]), starts.translation[i]) for i in range(len(starts))
    ]
    return to_placement(problem, fits, "posa_t", seed, {})

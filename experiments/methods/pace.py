"""PACE: place a motion and alter it, pose by pose, to fit the scene."""

from __future__ import annotations

from collections.abc import Sequence

from experiments.body.model import BodyModel
from experiments.methods.outcome import fault, to_placement
from experiments.methods.preparation import prepare
from experiments.methods.rigid import rigid_fits
from experiments.motion.motion import Motion
from experiments.placement.placement import Placement
from experiments.placement.problem import Problem
from experiments.placement.settings import PlacementSettings
from experiments.placement.solver import Fit, fit_altered
from experiments.scene.scene import Scene


def pace(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings, seed: int
) -> Placement:
    """Minimise E_p + E_alt over place, pose and translation (Mullen and Manocha 2023, eq. 4 to 7).

    One energy over all variables; the frame weights are PAAK's. Raises `PlacementError`.
    """
    problem = prepare(motion, scene, body, settings, seed)
    return place_altered(problem, rigid_fits(problem), "pace", seed)


def place_altered(problem: Problem, rigid: Sequence[Fit], method: str, seed: int) -> Placement:
    """The answer of a method that alters the motion, given the rigid fits it begins at."""
    pairs = alter_best(problem, rigid)
    return to_placement(problem, [fit for _, fit in pairs], method, seed, rigid_energies(pairs))


def alter_best(problem: Problem, rigid: Sequence[Fit]) -> list[tuple[Fit, Fit]]:
    """Alter the best `n_altered` rigid fits, each from its own optimum; pairs of (rigid, altered).

    A fit with a fault does not count, so that a worse start may still give a sound answer.
    """
    settings = problem.settings
    pairs: list[tuple[Fit, Fit]] = []
    for fit in rigid:
        if sum(not fault(problem, found) for _, found in pairs) == settings.n_altered:
            break
        limit = None
        if pairs and settings.give_up_factor is not None:
            limit = settings.give_up_factor * min(found.energy for _, found in pairs)
        pairs.append((fit, fit_altered(problem, fit, give_up_above=limit)))
    return pairs


def rigid_energies(pairs: Sequence[tuple[Fit, Fit]]) -> dict[str, list[float]]:
    """What the altered fits began at, for the record."""
    return {"rigid_energies": [rigid.energy for rigid, _ in pairs]}

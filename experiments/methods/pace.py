"""PACE: place a motion and alter it, pose by pose, to fit the scene; and its two ablations."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Literal

from experiments.body.model import BodyModel
from experiments.methods.outcome import fault, to_placement
from experiments.motion.motion import Motion
from experiments.placement.candidates import find_starts
from experiments.placement.features import choose_features
from experiments.placement.placement import Placement
from experiments.placement.problem import Problem, build_problem
from experiments.placement.settings import PlacementSettings
from experiments.placement.solver import Fit, fit_altered, fit_rigid
from experiments.scene.scene import Scene
from experiments.weighting.geometric import geometric_weights

_TOLERANCE = 1e-3
"""Share by which a variant's energy may exceed what the full method reached in it."""


def pace(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings, seed: int
) -> Placement:
    """Minimise E_p + E_alt over place, pose and translation. Raises `PlacementError`."""
    problem = pace_problem(motion, scene, body, settings)
    fits = alter_best(problem, rigid_fits(problem))
    return to_placement(problem, [fit for _, fit in fits], "pace", seed, _origin(fits))


def pace_without(
    weight: Literal["lambda_pose", "lambda_mot"],
    motion: Motion,
    scene: Scene,
    body: BodyModel,
    settings: PlacementSettings,
    seed: int,
) -> Placement:
    """An ablation: PACE with one weight of E_alt set to zero, everything else alike.

    Fewer terms cannot raise the optimum. Where a variant ends above the full method's solution
    (judged by the variant's energy), its optimiser failed; it is run again from that solution and
    `info["rerun"]` counts it.
    """
    problem = pace_problem(motion, scene, body, settings)
    variant = (
        dataclasses.replace(settings, lambda_pose=0.0)
        if weight == "lambda_pose"
        else dataclasses.replace(settings, lambda_mot=0.0)
    )
    fits, rerun = [], 0
    for rigid, full in alter_best(problem, rigid_fits(problem)):
        fit = fit_altered(problem, rigid, variant)
        again = fit_altered(problem, full, variant) if _worse(fit, full, weight) else fit
        rerun += again is not fit
        fits.append((rigid, again))
    name = "pace_no_pose" if weight == "lambda_pose" else "pace_no_motion"
    info = {**_origin(fits), "rerun": rerun}
    return to_placement(problem, [fit for _, fit in fits], name, seed, info)


pace_no_pose = partial(pace_without, "lambda_pose")
pace_no_motion = partial(pace_without, "lambda_mot")


def pace_problem(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings
) -> Problem:
    """Features and geometric frame weights of a motion, for PACE and its ablations."""
    features = choose_features(motion, scene, body, settings)
    problem = build_problem(motion, scene, body, settings, features)
    vertices = problem.vertices.double().numpy()
    weights = geometric_weights(vertices, motion.times, features)
    return problem.weighted(weights)


def rigid_fits(problem: Problem) -> list[Fit]:
    """The rigid optimum of every start, lowest energy first."""
    starts = find_starts(problem)
    fits = [
        fit_rigid(problem, float(starts.yaw[i]), starts.translation[i]) for i in range(len(starts))
    ]
    return sorted(fits, key=lambda fit: fit.energy)


def alter_best(problem: Problem, rigid: list[Fit]) -> list[tuple[Fit, Fit]]:
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


def _worse(variant: Fit, full: Fit, weight: str) -> bool:
    """Whether the variant's energy lies above that of the full method's solution in its terms."""
    dropped = {"pose"} if weight == "lambda_pose" else {"motion", "translation"}
    reached = sum(value for name, value in full.terms.items() if name not in dropped)
    return variant.energy > reached * (1 + _TOLERANCE)


def _origin(fits: list[tuple[Fit, Fit]]) -> dict[str, list[float]]:
    return {"rigid_energies": [rigid.energy for rigid, _ in fits]}

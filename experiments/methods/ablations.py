"""PACE with one weight of E_alt set to zero, and a check that its optimiser did its work."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import Literal

from experiments.body.model import BodyModel
from experiments.methods.outcome import to_placement
from experiments.methods.pace import alter_best, rigid_energies
from experiments.methods.preparation import prepare
from experiments.methods.rigid import rigid_fits
from experiments.motion.motion import Motion
from experiments.placement.placement import Placement
from experiments.placement.problem import Problem
from experiments.placement.settings import PlacementSettings
from experiments.placement.solver import Fit, fit_altered
from experiments.scene.scene import Scene

_TOLERANCE = 1e-3
"""Share by which a variant's energy may exceed what the full method reached in it."""
_SMOOTHER = (0.03, 0.01, 0.003)
"""Rounding of the penalty's kink, metres, for a second try."""

Weight = Literal["lambda_pose", "lambda_mot"]
Outcome = Literal["first run", "smoother", "from PACE", "failed"]
"""Which run of a variant reached what it must, see `fit_variant`."""


def pace_without(
    weight: Weight,
    motion: Motion,
    scene: Scene,
    body: BodyModel,
    settings: PlacementSettings,
    seed: int,
) -> Placement:
    """An ablation: PACE with one weight of E_alt set to zero. Raises `PlacementError`."""
    problem = prepare(motion, scene, body, settings, seed)
    return place_variant(problem, rigid_fits(problem), weight, seed)


def place_variant(problem: Problem, rigid: Sequence[Fit], weight: Weight, seed: int) -> Placement:
    """The answer of an ablation, given the rigid fits that it and PACE begin at.

    The starts are altered by the full method first, and the variant keeps its change of variables.
    `info["optimiser"]` is "failed" if the fit it answers with ended above what PACE reached in the
    variant's energy, and `info["runs"]` counts which run of each start reached it.
    """
    pairs = alter_best(problem, rigid)
    found = [fit_variant(problem, start, full, weight) for start, full in pairs]
    name = "pace_no_pose" if weight == "lambda_pose" else "pace_no_motion"
    runs = dict(Counter(outcome for _, outcome in found))
    placement = to_placement(
        problem, [fit for fit, _ in found], name, seed, {**rigid_energies(pairs), "runs": runs}
    )
    outcome = found[placement.info["chosen_start"]][1]
    state = "failed" if outcome == "failed" else "reached"
    return dataclasses.replace(placement, info={**placement.info, "optimiser": state})


pace_no_pose = partial(pace_without, "lambda_pose")
pace_no_motion = partial(pace_without, "lambda_mot")


def fit_variant(problem: Problem, rigid: Fit, full: Fit, weight: Weight) -> tuple[Fit, Outcome]:
    """Minimise the variant's energy from the rigid optimum, and say how it was reached.

    Fewer terms cannot raise the optimum: a variant that ends above PACE's solution `full`, judged
    by the variant's energy, has an optimiser that failed. It is run again with a wider rounding of
    the penalty, then from `full`, unless `settings.rescue` is off.
    """
    variant = without(problem.settings, weight)
    bound = bound_of(full, weight)
    fit = fit_altered(problem, rigid, variant)
    if fit.energy <= bound:
        return fit, "first run"
    if not problem.settings.rescue:
        return fit, "failed"
    wider = dataclasses.replace(
        problem, settings=dataclasses.replace(problem.settings, huber_widths=_SMOOTHER)
    )
    fit = fit_altered(wider, rigid, variant)
    if fit.energy <= bound:
        return fit, "smoother"
    fit = fit_altered(problem, full, variant)
    return (fit, "from PACE") if fit.energy <= bound else (fit, "failed")


def without(settings: PlacementSettings, weight: Weight) -> PlacementSettings:
    """The settings with that weight at zero."""
    if weight == "lambda_pose":
        return dataclasses.replace(settings, lambda_pose=0.0)
    return dataclasses.replace(settings, lambda_mot=0.0)


def bound_of(full: Fit, weight: Weight) -> float:
    """What PACE's solution costs in the variant's energy, and a little more."""
    dropped = {"pose"} if weight == "lambda_pose" else {"motion", "translation"}
    reached = sum(value for name, value in full.terms.items() if name not in dropped)
    return reached * (1 + _TOLERANCE)

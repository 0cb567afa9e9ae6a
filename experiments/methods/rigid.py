"""Rigid placement, which every method begins with and POSA-T and PAAK-style end with."""

from __future__ import annotations

from experiments.methods.outcome import to_placement
from experiments.placement.candidates import find_starts
from experiments.placement.placement import Placement
from experiments.placement.problem import Problem
from experiments.placement.solver import Fit, fit_rigid


def place_rigid(problem: Problem, method: str, seed: int) -> Placement:
    """The answer of a method that moves the motion as a whole."""
    return to_placement(problem, rigid_fits(problem), method, seed, {})


def rigid_fits(problem: Problem) -> list[Fit]:
    """The rigid optimum of every start, lowest energy first."""
    starts = find_starts(problem)
    fits = [
        fit_rigid(problem, float(starts.yaw[i]), starts.translation[i]) for i in range(len(starts))
    ]
    return sorted(fits, key=lambda fit: fit.energy)

"""Rigid placement, which every method begins with and POSA-T and PAAK-style end with."""

from __future__ import annotations

from experiments.methods.outcome import fault, to_placement
from experiments.placement.candidates import find_starts
from experiments.placement.placement import Placement
from experiments.placement.problem import Problem
from experiments.placement.solver import Fit, fit_rigid


def place_rigid(problem: Problem, method: str, seed: int) -> Placement:
    """The answer of a method that moves the motion as a whole."""
    return to_placement(problem, rigid_fits(problem), method, seed, {})


def rigid_fits(problem: Problem) -> list[Fit]:
    """The rigid optimum of the best starts, lowest energy first.

    Goes on to worse starts, `spare_starts` at most, until `n_starts` of the fits have no fault.
    """
    settings = problem.settings
    starts = find_starts(problem, settings.spare_starts)
    fits: list[Fit] = []
    sound = 0
    for yaw, translation in zip(starts.yaw, starts.translation, strict=True):
        fits.append(fit_rigid(problem, float(yaw), translation))
        sound += not fault(problem, fits[-1])
        if sound == settings.n_starts:
            break
    return sorted(fits, key=lambda fit: fit.energy)

"""Engines: two ways to compute the same energy, by name. `settings.engine` chooses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from experiments.placement.batched import batched_bodies, batched_moved, batched_terms
from experiments.placement.problem import Problem, RigidProblem
from experiments.placement.reference import reference_bodies, reference_moved, reference_terms
from experiments.placement.settings import PlacementSettings

Terms = Callable[[RigidProblem, Float[Tensor, "*B T V 3"], float, bool], dict[str, Tensor]]
"""(problem, bodies, huber, semantics) -> E_p by terms."""
Bodies = Callable[[Problem, Tensor, Tensor, Tensor], Float[Tensor, "T V 3"]]
"""(problem, placed, delta, shift) -> vertices of an altered motion in the scene's frame."""
Moved = Callable[[RigidProblem, Tensor, Tensor], Float[Tensor, "*B T V 3"]]
"""(problem, yaw, translation) -> vertices of the unaltered motion in the scene's frame."""


@dataclass(frozen=True)
class Engine:
    """All that start scoring and the optimiser ask for."""

    terms: Terms
    bodies: Bodies
    moved: Moved
    prunes: bool
    """Takes many starts at once and lets a coarse score drop most of them; else every start is
    scored exactly, one after the other."""


ENGINES: dict[str, Engine] = {
    "batched": Engine(batched_terms, batched_bodies, batched_moved, prunes=True),
    "reference": Engine(reference_terms, reference_bodies, reference_moved, prunes=False),
}


def engine_of(settings: PlacementSettings) -> Engine:
    """The engine that the settings name."""
    return ENGINES[settings.engine]

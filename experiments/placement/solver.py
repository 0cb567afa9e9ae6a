"""From a start to a fit: the rigid part alone (POSA-T), or with an altered motion (PACE)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from experiments.placement.engines import engine_of
from experiments.placement.objectives import alteration_terms, total
from experiments.placement.optimiser import Energy, Minimum, minimise
from experiments.placement.problem import Problem
from experiments.placement.settings import PlacementSettings
from experiments.placement.steadiness import Steadiness
from experiments.placement.whitening import alteration_basis

GIVE_UP_STEPS = 3


@dataclass(frozen=True)
class Fit:
    """A placement of one start: the rigid part, the alteration (zero if rigid) and its energy."""

    yaw: float
    """Radians, about the clip's centre."""
    translation: Float[np.ndarray, "3"]
    """Metres."""
    delta: Float[Tensor, "T 22 3"]
    """Change of axis-angle vectors, rad."""
    shift: Float[Tensor, "T 3"]
    """Change of the root's place relative to frame 0, metres, clip frame."""
    terms: dict[str, float]
    """The energy's terms with the printed, unrounded penalty."""
    evaluations: int = 0
    iterations: int = 0
    reason: str = ""
    trace: tuple[float, ...] = ()
    """Energy at the start of every outer step and at the end, with the rounded penalty."""
    history: tuple[dict[str, float], ...] = ()
    """The terms, as in `terms`, at the start and after every outer step."""

    @property
    def energy(self) -> float:
        """E = E_p + E_alt; infinite where it is not a number, so that it loses every comparison."""
        value = sum(self.terms.values())
        return math.inf if math.isnan(value) else value


def fit_rigid(problem: Problem, yaw: float, translation: Float[np.ndarray, "3"]) -> Fit:
    """Minimise E_p over yaw and translation; the motion keeps its shape."""
    engine = engine_of(problem.settings)
    origin, scale = _rigid_state(problem, yaw, translation)

    def bodies(state: Float[Tensor, " N"]) -> Float[Tensor, "T V 3"]:
        rigid = origin + scale * state
        return engine.moved(problem, rigid[0], rigid[1:])

    def energy(huber: float) -> Energy:
        return lambda state: total(engine.terms(problem, bodies(state), huber, False))

    def fit(rigid: Float[Tensor, "4"]) -> Fit:
        return _fit(problem, rigid, _unaltered(problem), problem.settings)

    def describe(state: Float[Tensor, " N"]) -> dict[str, float]:
        return fit(origin + scale * state).terms

    minimum = _minimise(problem, energy, torch.zeros_like(origin), None, describe)
    # The rounded penalty is minimised, the printed one decides: never answer worse than the start.
    best = min(fit(origin + scale * minimum.state), fit(origin), key=lambda item: item.energy)
    return _counted(best, minimum)


def fit_altered(
    problem: Problem,
    rigid: Fit,
    energy_settings: PlacementSettings | None = None,
    give_up_above: float | None = None,
) -> Fit:
    """Minimise E_p + E_alt over the rigid part and the pose and translation of every frame.

    Begins at `rigid` (its alteration included) and never ends above it. `energy_settings` may hold
    other weights than the problem's for ablations; the change of variables stays that of the full
    method, so that a variant differs in its energy alone.
    """
    weights = energy_settings or problem.settings
    engine = engine_of(problem.settings)
    variables = _Variables(problem, rigid)
    steadiness = Steadiness(problem, weights)

    def energy(huber: float) -> Energy:
        def value(state: Float[Tensor, " N"]) -> Float[Tensor, ""]:
            placed, delta, shift = variables.decode(state)
            bodies = altered_bodies(problem, placed, delta, shift)
            terms = engine.terms(problem, bodies, huber, False)
            costs = alteration_terms(delta, shift, problem.stiffness, problem.step_scale, weights)
            extra = steadiness.terms(bodies, placed, delta, shift)
            return total({**terms, **costs, **extra})

        return value

    def fit(state: Float[Tensor, " N"]) -> Fit:
        placed, delta, shift = variables.decode(state)
        return _fit(problem, placed, (delta, shift), weights)

    minimum = _minimise(
        problem, energy, variables.start(), give_up_above, lambda state: fit(state).terms
    )
    before = _fit(problem, _rigid_tensor(problem, rigid), (rigid.delta, rigid.shift), weights)
    return _counted(min(fit(minimum.state), before, key=lambda item: item.energy), minimum)


def altered_bodies(
    problem: Problem,
    placed: Float[Tensor, "4"],
    delta: Float[Tensor, "T 22 3"],
    shift: Float[Tensor, "T 3"],
) -> Float[Tensor, "T V 3"]:
    """The vertices of the energy for an altered motion, in the scene's frame."""
    return engine_of(problem.settings).bodies(problem, placed, delta, shift)


class _Variables:
    """One flat vector: rigid part, then the alteration in its basis; all of order one."""

    def __init__(self, problem: Problem, rigid: Fit) -> None:
        self._origin, self._scale = _rigid_state(problem, rigid.yaw, rigid.translation)
        basis = alteration_basis(
            problem.stiffness.double().cpu().numpy(),
            problem.step_scale.double().cpu().numpy(),
            problem.settings,
        )
        self._pose = torch.as_tensor(basis.pose).to(self._origin)
        self._translation = torch.as_tensor(basis.translation).to(self._origin)
        self._delta, self._shift = rigid.delta, rigid.shift
        self._n_pose = basis.pose.shape[1] * 66

    def start(self) -> Float[Tensor, " N"]:
        """The state of the fit it was made from."""
        length = 4 + self._n_pose + self._translation.shape[1] * 3
        return self._origin.new_zeros(length)

    def decode(
        self, state: Float[Tensor, " N"]
    ) -> tuple[Float[Tensor, "4"], Float[Tensor, "T 22 3"], Float[Tensor, "T 3"]]:
        """Rigid part (yaw, translation), pose change and shift."""
        placed = self._origin + self._scale * state[:4]
        waves = state[4 : 4 + self._n_pose].reshape(-1, 66)
        steps = state[4 + self._n_pose :].reshape(-1, 3)
        delta = self._delta + (self._pose @ waves).reshape(-1, 22, 3)
        return placed, delta, self._shift + self._translation @ steps


def _minimise(
    problem: Problem,
    energy: Callable[[float], Energy],
    start: Float[Tensor, " N"],
    give_up_above: float | None,
    describe: Callable[[Float[Tensor, " N"]], dict[str, float]],
) -> Minimum:
    """Walk through the roundings of the penalty in equal shares of the outer steps."""
    settings = problem.settings
    widths = settings.huber_widths
    stages = {width: energy(width) for width in widths}
    share = np.arange(settings.outer_steps) * len(widths) // settings.outer_steps
    return minimise(
        [stages[widths[index]] for index in share],
        start,
        inner_iterations=settings.inner_iterations,
        memory=settings.history,
        relative_tolerance=settings.relative_tolerance,
        give_up_above=give_up_above,
        describe=describe,
    )


def _rigid_state(
    problem: Problem, yaw: float, translation: Float[np.ndarray, "3"]
) -> tuple[Float[Tensor, "4"], Float[Tensor, "4"]]:
    """Where the rigid part begins, and units in which the contact term has curvature about one."""
    attraction = 2.0 * problem.settings.contact_weight * (problem.k @ problem.contact.to(problem.k))
    metre = float((attraction.sum() + 1.0).rsqrt())
    reach = problem.vertices[..., :2] - problem.centre
    radius = float(reach.square().sum(-1).mean().sqrt().clamp(min=0.3))
    origin = problem.k.new_tensor([yaw, *translation])
    return origin, origin.new_tensor([metre / radius, metre, metre, metre])


def _rigid_tensor(problem: Problem, fit: Fit) -> Float[Tensor, "4"]:
    return problem.k.new_tensor([fit.yaw, *fit.translation])


def _unaltered(problem: Problem) -> tuple[Float[Tensor, "T 22 3"], Float[Tensor, "T 3"]]:
    return torch.zeros_like(problem.pose), torch.zeros_like(problem.transl)


def _fit(
    problem: Problem,
    placed: Float[Tensor, "4"],
    alteration: tuple[Float[Tensor, "T 22 3"], Float[Tensor, "T 3"]],
    weights: PlacementSettings,
) -> Fit:
    """Name every term of a state, with the printed penalty and the class mismatches."""
    delta, shift = (part.detach() for part in alteration)
    with torch.no_grad():
        bodies = altered_bodies(problem, placed, delta, shift)
        terms = engine_of(problem.settings).terms(problem, bodies, 0.0, True)
        costs = alteration_terms(delta, shift, problem.stiffness, problem.step_scale, weights)
        extra = Steadiness(problem, weights).terms(bodies, placed, delta, shift)
    named = {name: float(value) for name, value in {**terms, **costs, **extra}.items()}
    numbers = placed.detach().double().cpu().numpy()
    return Fit(float(numbers[0]), numbers[1:], delta, shift, named)


def _counted(fit: Fit, minimum: Minimum) -> Fit:
    return dataclasses.replace(
        fit,
        evaluations=minimum.evaluations,
        iterations=minimum.iterations,
        reason=minimum.reason,
        trace=minimum.trace,
        history=minimum.history,
    )

"""L-BFGS with strong Wolfe line search, as POSA and PACE use it, with a trace and a way back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

Energy = Callable[[Float[Tensor, " N"]], Float[Tensor, ""]]
"""Energy of a state, differentiable."""

Reason = Literal["steps", "converged", "not finite", "diverged", "given up"]

FAILED: tuple[Reason, ...] = ("not finite", "diverged")
"""Reasons that make an end worthless: the energy or the state broke."""

_DIVERGED = 2.0
"""An outer step that leaves this many times the energy it began with has broken."""


@dataclass(frozen=True)
class Minimum:
    """Where an optimisation ended and how it came there."""

    state: Float[Tensor, " N"]
    """The last sound state."""
    trace: tuple[float, ...]
    """Energy at the start of every outer step and at the end."""
    history: tuple[dict[str, float], ...]
    """What `describe` said of the start and of the state after every outer step."""
    evaluations: int
    iterations: int
    reason: Reason


def minimise(
    energies: Sequence[Energy],
    start: Float[Tensor, " N"],
    *,
    inner_iterations: int = 20,
    memory: int = 100,
    relative_tolerance: float = 1e-4,
    give_up_above: float | None = None,
    describe: Callable[[Float[Tensor, " N"]], dict[str, float]] = lambda _: {},
) -> Minimum:
    """Minimise an energy in `len(energies)` outer steps of L-BFGS, learning rate 1.

    Outer step i minimises `energies[i]`; where it differs from the one before, the curvature memory
    begins anew. Stops early when two successive steps on the last energy each gain less than
    `relative_tolerance` of it, or when the energy after three steps is above `give_up_above`.
    A state that is not finite, or whose energy is far above what the step began with, is thrown
    away and the last sound one returned.
    """
    state = start.detach().clone().requires_grad_(True)
    last = state.detach().clone()
    trace: list[float] = []
    history = [describe(last)]
    counts = {"func_evals": 0, "n_iter": 0}
    reason: Reason = "steps"
    quiet, optimiser, current = 0, None, None
    for step, energy in enumerate(energies):
        if energy is not current:
            optimiser, current, quiet = _lbfgs(state, inner_iterations, memory), energy, 0
        assert optimiser is not None
        before = (
            optimiser.state[state].get("func_evals", 0),
            optimiser.state[state].get("n_iter", 0),
        )
        begin = _step(optimiser, energy, state)
        after = optimiser.state[state]
        counts["func_evals"] += after["func_evals"] - before[0]
        counts["n_iter"] += after["n_iter"] - before[1]
        with torch.no_grad():
            end = float(energy(state))
        trace.append(begin)
        if not (torch.isfinite(state).all() and _finite(end)):
            reason = "not finite"
            break
        if end > _DIVERGED * abs(begin) + 1e-6:
            reason = "diverged"
            break
        last = state.detach().clone()
        history.append(describe(last))
        quiet = quiet + 1 if begin - end < relative_tolerance * abs(begin) else 0
        final = energy is energies[-1]
        if step >= 2 and give_up_above is not None and end > give_up_above:
            reason = "given up"
        elif final and quiet >= 2:
            reason = "converged"
        if reason != "steps":
            break
    with torch.no_grad():
        trace.append(float(current(last)) if current is not None else float("nan"))
    ends = tuple(trace), tuple(history)
    return Minimum(last, *ends, counts["func_evals"], counts["n_iter"], reason)


def _lbfgs(state: Tensor, inner_iterations: int, memory: int) -> torch.optim.LBFGS:
    return torch.optim.LBFGS(
        [state],
        lr=1.0,
        max_iter=inner_iterations,
        history_size=memory,
        tolerance_grad=1e-5,
        tolerance_change=1e-9,
        line_search_fn="strong_wolfe",
    )


def _step(optimiser: torch.optim.LBFGS, energy: Energy, state: Float[Tensor, " N"]) -> float:
    """One outer step in place; the energy before it."""

    def closure() -> Float[Tensor, ""]:
        optimiser.zero_grad()
        value = energy(state)
        value.backward()  # type: ignore[no-untyped-call]
        return value

    before: Float[Tensor, ""] = optimiser.step(closure)  # type: ignore[no-untyped-call]
    return float(before.detach())


def _finite(value: float) -> bool:
    return value == value and abs(value) != float("inf")

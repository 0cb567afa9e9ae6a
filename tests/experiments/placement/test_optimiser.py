from __future__ import annotations

import pytest
import torch

from experiments.placement.losses import smoothed_depth
from experiments.placement.optimiser import minimise


def bowl(state: torch.Tensor) -> torch.Tensor:
    return ((state - torch.tensor([1.0, -2.0, 3.0])) ** 2 * torch.tensor([1.0, 10.0, 100.0])).sum()


def test_a_quadratic_bowl_is_solved_and_the_trace_falls() -> None:
    found = minimise([bowl] * 10, torch.zeros(3))
    assert found.state.tolist() == pytest.approx([1.0, -2.0, 3.0], abs=1e-4)
    assert found.reason == "converged"
    assert all(late <= early for early, late in zip(found.trace, found.trace[1:], strict=False))
    assert found.evaluations >= found.iterations > 0


def test_a_state_that_is_not_finite_is_thrown_away() -> None:
    calls = 0

    def breaks(state: torch.Tensor) -> torch.Tensor:
        nonlocal calls
        calls += 1
        return bowl(state) if calls < 12 else bowl(state) * float("nan")

    found = minimise([breaks] * 10, torch.zeros(3), inner_iterations=4)
    assert found.reason == "not finite"
    assert torch.isfinite(found.state).all()


def test_a_hopeless_start_is_given_up_after_three_steps() -> None:
    def hopeless(state: torch.Tensor) -> torch.Tensor:
        return bowl(state) + 100.0

    found = minimise([hopeless] * 10, torch.zeros(3), inner_iterations=1, give_up_above=50.0)
    assert (found.reason, len(found.trace)) == ("given up", 4)


def test_rounding_the_kink_first_lands_below_the_kinked_energy() -> None:
    # A sum of kinks along a ridge: rounding them in stages must not end higher.
    generator = torch.Generator().manual_seed(2)
    rows = torch.randn((40, 6), generator=generator)
    offset = torch.randn(40, generator=generator)

    def energy(width: float):
        return lambda x: 10 * smoothed_depth(rows @ x - offset, width).sum() + (x * x).sum()

    printed, wide, narrow = energy(0.0), energy(0.01), energy(0.003)
    kinked = minimise([printed] * 10, torch.zeros(6))
    staged = minimise([wide] * 5 + [narrow] * 5, torch.zeros(6))
    assert printed(staged.state) <= printed(kinked.state) + 0.05


def test_a_step_that_ends_far_above_its_begin_is_thrown_away() -> None:
    calls = 0

    def jumps(state: torch.Tensor) -> torch.Tensor:
        # Every evaluation is higher than the one before, whatever the state.
        nonlocal calls
        calls += 1
        return bowl(state) * 0.0 + state.sum() * 1e-9 + 3.0**calls

    found = minimise([jumps] * 5, torch.zeros(3))
    assert found.reason == "diverged"
    assert found.state.tolist() == [0.0, 0.0, 0.0]


def test_the_history_describes_the_start_and_every_sound_step() -> None:
    def describe(state: torch.Tensor) -> dict[str, float]:
        return {"first": float(state[0]), "energy": float(bowl(state))}

    found = minimise([bowl] * 4, torch.zeros(3), inner_iterations=2, describe=describe)
    assert len(found.history) == len(found.trace)
    assert [item["energy"] for item in found.history] == pytest.approx(found.trace)
    assert found.history[0]["first"] == 0.0

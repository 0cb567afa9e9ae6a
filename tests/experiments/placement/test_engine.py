"""The fast engine against the slow one, and the energy's gradient."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from experiments.placement.batched import batched_terms
from experiments.placement.candidates import Starts, exact_scores
from experiments.placement.objectives import alteration_terms, total
from experiments.placement.pointwise import pointwise_scores, pointwise_terms
from experiments.placement.solver import altered_bodies


@pytest.fixture(scope="module")
def state():
    rng = np.random.default_rng(7)
    delta, shift = 0.05 * rng.normal(size=(6, 22, 3)), 0.02 * rng.normal(size=(6, 3))
    return 0.4, np.array([1.5, 1.6, -0.02]), delta, shift


@pytest.mark.parametrize("tolerance", [None, 0.003])
@pytest.mark.parametrize("printed", [True, False])
def test_the_fast_engine_equals_the_slow_one(make_problem, state, tolerance, printed) -> None:
    changes = {"time_aware": not printed, "weighted_alteration": printed}
    changes |= {"contact_tolerance": tolerance}
    problem = make_problem(6, torch.float64, fps=20.0, **changes)
    yaw, translation, delta, shift = state
    slow = pointwise_terms(problem, yaw, translation, delta, shift)
    placed = torch.tensor([yaw, *translation], dtype=torch.float64)
    parts = torch.as_tensor(delta), torch.as_tensor(shift)
    fast = batched_terms(problem, altered_bodies(problem, placed, *parts))
    fast |= alteration_terms(*parts, problem.stiffness, problem.step_scale, problem.settings)
    assert {name: float(value) for name, value in fast.items()} == pytest.approx(slow, rel=1e-9)
    assert min(slow.values()) > 0


def test_batched_scores_equal_the_slow_ones_start_by_start(make_problem) -> None:
    problem = make_problem(5, torch.float64)
    rng = np.random.default_rng(3)
    yaw = rng.uniform(0, 2 * np.pi, 4)
    translation = np.column_stack([rng.uniform(0.4, 2.6, (4, 2)), rng.uniform(-0.05, 0.05, 4)])
    starts = Starts(yaw, translation, np.zeros(4))
    slow = pointwise_scores(problem, yaw, translation)
    assert exact_scores(problem, starts) == pytest.approx(slow, rel=1e-9)


def test_the_whole_energy_has_the_gradient_of_its_formula(make_problem, state) -> None:
    problem = make_problem(4, torch.float64)
    yaw, translation, delta, shift = state
    generator = torch.Generator().manual_seed(1)
    directions = torch.randn((3, 4 + 4 * 66 + 12), generator=generator, dtype=torch.float64)

    def along(steps: torch.Tensor) -> torch.Tensor:
        placed = torch.tensor([yaw, *translation], dtype=torch.float64)
        offset = 0.01 * steps @ directions
        parts = torch.as_tensor(delta[:4]), torch.as_tensor(shift[:4])
        turned = parts[0] + offset[4:268].reshape(4, 22, 3), parts[1] + offset[268:].reshape(4, 3)
        bodies = altered_bodies(problem, placed + offset[:4], *turned)
        terms = batched_terms(problem, bodies, huber=0.003, semantics=False)
        costs = alteration_terms(*turned, problem.k, problem.step_scale, problem.settings)
        return total({**terms, **costs})

    steps = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(along, (steps,), eps=1e-7, atol=1e-4)

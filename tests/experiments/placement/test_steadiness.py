from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from experiments.placement.settings import PlacementSettings
from experiments.placement.solver import altered_bodies
from experiments.placement.steadiness import (
    STANCE_HEIGHT_M,
    Steadiness,
    bend_loss,
    slide_loss,
    sole_columns,
    stance_shares,
)

WEIGHTS = PlacementSettings(slide_weight=300.0, bend_weight=20.0)


def random(*shape: int, seed: int = 0) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(*shape, generator=generator, dtype=torch.float64)


def test_gradients_of_the_steadiness_terms_are_right() -> None:
    scale = random(6).abs() + 0.5
    error, series = random(6, 4, 3).requires_grad_(), random(6, 2, 3, seed=1).requires_grad_()
    stance = (random(6, 4, seed=2) > 0).double()
    assert torch.autograd.gradcheck(lambda x: slide_loss(x, stance, scale).sum(), (error,))
    assert torch.autograd.gradcheck(lambda x: bend_loss(x, scale).sum(), (series,))


def test_a_foot_that_glides_at_constant_speed_costs_its_speed_squared() -> None:
    error = torch.zeros(10, 3, 3, dtype=torch.float64)
    error[..., 0] = 0.02 * torch.arange(10)[:, None]
    stance = torch.full((10, 3), 1 / 3, dtype=torch.float64)
    stance[0] = 0.0
    loss = slide_loss(error, stance, torch.ones(10).double())
    assert loss.tolist() == pytest.approx([0.0] + [0.0004] * 9)


def test_lifting_or_displacing_a_foot_for_good_is_no_sliding() -> None:
    error = random(1, 3, 3).expand(8, 3, 3).clone()
    error[:, :, 2] += random(8, 3, seed=3)
    assert float(slide_loss(error, torch.ones(8, 3).double(), torch.ones(8).double()).sum()) == 0.0


def test_a_straight_ramp_does_not_bend_and_a_single_peak_does() -> None:
    ramp = torch.arange(9).double()[:, None] * torch.tensor([[0.3, -0.1]]).double()
    peak = torch.zeros(9, 1, dtype=torch.float64)
    peak[4] = 0.5
    ones = torch.ones(9).double()
    assert float(bend_loss(ramp, ones).sum()) == pytest.approx(0.0, abs=1e-20)
    assert bend_loss(peak, ones).tolist() == pytest.approx([0, 0, 0, 0.25, 1.0, 0.25, 0, 0, 0])


def test_a_foot_counts_once_however_many_vertices_it_has() -> None:
    height, foot = np.zeros((5, 7)), np.array([0, 0, 1, 1, 1, 1, 1])
    height[3] = STANCE_HEIGHT_M + 0.001
    shares = stance_shares(height, foot, 0.0)
    # A step needs two frames on the ground: none ends in frame 0, 3 or 4.
    assert shares.sum(1) == pytest.approx([0, 2, 2, 0, 0])
    assert shares[1] == pytest.approx([1 / 2] * 2 + [1 / 5] * 5)


def test_the_terms_equal_a_sum_over_frames_and_vertices(make_problem) -> None:
    problem = make_problem(n_frames=12, dtype=torch.float64)
    delta, shift = 0.02 * random(12, 22, 3), 0.01 * random(12, 3, seed=4)
    placed = torch.tensor([0.7, 0.3, -0.2, 0.01], dtype=torch.float64)
    bodies = altered_bodies(problem, placed, delta, shift)
    found = Steadiness(problem, WEIGHTS).terms(bodies, placed, delta, shift)
    error = (bodies - problem.moved(placed[0], placed[1:])).numpy()
    k, slide = problem.k.numpy(), 0.0
    height = problem.vertices[..., 2].numpy() - problem.floor
    for side in ("left_sole", "right_sole"):
        foot = np.flatnonzero(np.isin(problem.vertex_ids, problem.body.regions[side]))
        for frame in range(1, 12):
            for vertex in foot:
                if max(height[frame - 1, vertex], height[frame, vertex]) < STANCE_HEIGHT_M:
                    step = error[frame, vertex, :2] - error[frame - 1, vertex, :2]
                    slide += k[frame] * float(step @ step) / len(foot)
    assert slide > 0 and float(found["slide"]) == pytest.approx(300.0 * slide, rel=1e-9)
    both = np.concatenate([delta.numpy().reshape(12, -1), np.sqrt(50.0) * shift.numpy()], axis=1)
    bends = (np.diff(both, n=2, axis=0) ** 2).sum(1) @ k[1:-1]
    assert float(found["bend"]) == pytest.approx(20.0 * bends, rel=1e-9)


def test_without_weights_there_are_no_steadiness_terms(make_problem) -> None:
    problem = make_problem(n_frames=6)
    zero = torch.zeros(6, 22, 3), torch.zeros(6, 3)
    bodies = problem.vertices
    off = dataclasses.replace(WEIGHTS, slide_weight=0.0, bend_weight=0.0)
    assert Steadiness(problem, off).terms(bodies, torch.zeros(4), *zero) == {}


def test_an_unaltered_motion_is_steady_wherever_it_stands(make_problem) -> None:
    problem = make_problem(n_frames=6, dtype=torch.float64)
    placed = torch.tensor([2.0, 0.4, 0.1, 0.0], dtype=torch.float64)
    zero = torch.zeros(6, 22, 3).double(), torch.zeros(6, 3).double()
    terms = Steadiness(problem, WEIGHTS).terms(problem.moved(placed[0], placed[1:]), placed, *zero)
    assert terms.keys() == {"slide", "bend"} and all(float(v) == 0.0 for v in terms.values())


def test_soles_of_both_feet_are_found_among_the_vertices(slim) -> None:
    ids = np.concatenate([slim.regions["left_sole"][:5], slim.regions["right_sole"][:3], [0]])
    columns, foot = sole_columns(slim, np.sort(ids))
    assert np.bincount(foot).tolist() == [5, 3]
    assert np.isin(
        np.sort(ids)[columns], np.union1d(slim.regions["left_sole"], slim.regions["right_sole"])
    ).all()

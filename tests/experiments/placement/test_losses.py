from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from experiments.placement import losses

TOUCHES = torch.tensor([[True, False, True], [False, False, True]])


def test_contact_is_the_squared_distance_of_contact_vertices_on_both_sides() -> None:
    distance = torch.tensor([[0.1, 0.7, -0.2], [0.9, 0.9, 0.0]])
    assert losses.contact_loss(distance, TOUCHES).tolist() == pytest.approx([0.05, 0.0])


def test_penetration_sums_depth_and_leaves_contact_vertices_out() -> None:
    distance = torch.tensor([[-0.5, -0.1, 0.3], [-0.2, -0.3, -0.9]])
    assert losses.penetration_loss(distance, TOUCHES).tolist() == pytest.approx([0.1, 0.5])


def test_with_a_tolerance_contact_vertices_pay_for_what_is_deeper() -> None:
    distance = torch.tensor([[-0.5, -0.1, 0.3], [-0.2, -0.3, -0.003]])
    paid = losses.penetration_loss(distance, TOUCHES, contact_tolerance=0.003)
    assert paid.tolist() == pytest.approx([0.1 + 0.497, 0.5])


@given(st.floats(-0.1, 0.1), st.floats(0.0005, 0.02))
def test_the_rounded_depth_is_below_the_printed_one_by_at_most_half_its_width(
    depth: float, width: float
) -> None:
    printed = losses.smoothed_depth(torch.tensor(depth, dtype=torch.float64), 0.0)
    rounded = losses.smoothed_depth(torch.tensor(depth, dtype=torch.float64), width)
    assert 0.0 <= float(printed - rounded) <= width / 2 + 1e-12
    if depth >= width:
        assert float(printed - rounded) == pytest.approx(width / 2)


def test_semantics_counts_contact_vertices_near_another_class() -> None:
    scene = torch.tensor([[3, 5, 2], [2, 2, 2]])
    wanted = torch.tensor([[3, 0, 10], [0, 0, 2]])
    assert losses.semantic_loss(scene, wanted, TOUCHES).tolist() == [1, 0]


def test_pose_is_the_sum_of_squares_over_joints() -> None:
    delta = torch.zeros(2, 22, 3)
    delta[1, 4], delta[1, 7, 0] = torch.tensor([0.1, 0.2, 0.0]), 0.3
    assert losses.pose_loss(delta).tolist() == pytest.approx([0.0, 0.14])


@given(st.floats(-2, 2), st.integers(2, 9))
def test_a_constant_offset_costs_no_motion(offset: float, n_frames: int) -> None:
    scale = torch.linspace(0.5, 2.0, n_frames, dtype=torch.float64)
    delta = torch.full((n_frames, 22, 3), offset, dtype=torch.float64)
    assert losses.motion_loss(delta, scale).sum() == 0.0
    assert losses.translation_loss(delta[:, 0], scale).sum() == 0.0


def test_a_step_after_a_gap_of_three_frames_counts_as_a_third() -> None:
    shift = torch.tensor([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.6, 0.0, 0.0]])
    scale = torch.tensor([1.0, 1.0, 1.0 / 3.0])
    cost = losses.translation_loss(shift, scale)
    assert cost.tolist() == pytest.approx([0.0, 0.09, 0.01])


@pytest.mark.parametrize("huber", [0.003, 0.01])
@pytest.mark.parametrize("tolerance", [None, 0.003])
def test_scene_losses_have_the_gradient_of_their_formula(
    huber: float, tolerance: float | None
) -> None:
    generator = torch.Generator().manual_seed(4)
    distance = 0.02 * torch.randn((2, 2, 3), generator=generator, dtype=torch.float64)
    distance.requires_grad_(True)

    def penalty(x: torch.Tensor) -> torch.Tensor:
        return losses.penetration_loss(x, TOUCHES, huber, tolerance)

    assert torch.autograd.gradcheck(penalty, (distance,), eps=1e-8, atol=1e-5)
    assert torch.autograd.gradcheck(lambda x: losses.contact_loss(x, TOUCHES), (distance,))


def test_alteration_losses_have_the_gradient_of_their_formula() -> None:
    generator = torch.Generator().manual_seed(5)
    delta = torch.randn((3, 22, 3), generator=generator, dtype=torch.float64, requires_grad=True)
    shift = torch.randn((3, 3), generator=generator, dtype=torch.float64, requires_grad=True)
    scale = torch.tensor([1.0, 0.5, 1.0], dtype=torch.float64)
    assert torch.autograd.gradcheck(losses.pose_loss, (delta,))
    assert torch.autograd.gradcheck(lambda x: losses.motion_loss(x, scale), (delta,))
    assert torch.autograd.gradcheck(lambda x: losses.translation_loss(x, scale), (shift,))

"""Reading packed volumes equals the plain lookup, with the gradient of its formula."""

from __future__ import annotations

import pytest
import torch

from experiments.placement.packed_volumes import cells_with_inside
from experiments.placement.scene_field import SceneField


@pytest.fixture(scope="module")
def field(seat_room) -> SceneField:
    return SceneField(seat_room, torch.float64)


def points_anywhere(count: int, seed: int) -> torch.Tensor:
    """Inside the room, behind its walls and above its volume; (3, P) metres."""
    generator = torch.Generator().manual_seed(seed)
    share = torch.rand((3, count), generator=generator, dtype=torch.float64)
    return share * torch.tensor([[5.0], [5.0], [4.5]]) - 1.0


@pytest.mark.parametrize("thick", [False, True])
def test_distances_equal_the_plain_lookup_inside_and_beyond_the_grid(field, thick) -> None:
    points = points_anywhere(4000, 1)
    columns = torch.arange(0, 4000, 3)
    first = torch.full_like(columns, field.packed.thick_from if thick else 0)
    plain = (field.thick if thick else field.plain).distance(points[:, columns].T)
    torch.testing.assert_close(field.packed.distance(points, columns, first), plain)


def test_labels_equal_the_plain_lookup(field) -> None:
    points = points_anywhere(4000, 2)
    every = torch.arange(4000)
    assert torch.equal(
        field.packed.nearest_label(points, every).long(), field.plain.label(points.T)
    )


def test_no_vertex_with_a_depth_is_passed_over(field) -> None:
    points = points_anywhere(20_000, 3)
    inside = field.thick.distance(points.T) < 0
    possible = field.packed.possibly_inside(points)
    assert possible[inside].all()
    assert inside.any() and not possible.all()


def test_the_distance_has_the_gradient_of_its_interpolant(field) -> None:
    points = points_anywhere(60, 4).requires_grad_(True)
    columns, first = torch.arange(0, 60, 2), torch.zeros(30, dtype=torch.int32)
    assert torch.autograd.gradcheck(
        lambda moved: field.packed.distance(moved, columns, first), (points,), eps=1e-7
    )


def test_a_cell_counts_as_inside_if_one_of_its_corners_is() -> None:
    sdf = torch.ones((4, 4, 4))
    sdf[3, 1, 2] = -0.1
    found = cells_with_inside(sdf).nonzero().tolist()
    # The cells that touch the node; the last nodes of an axis stand for the cell below them.
    assert found == [[i, j, k] for i in (2, 3) for j in (0, 1) for k in (1, 2, 3)]


def test_a_point_that_is_not_a_number_reads_as_such_and_nothing_breaks(field) -> None:
    points = points_anywhere(4, 5)
    points[1, 2], points[0, 3] = float("nan"), float("inf")
    columns, first = torch.arange(4), torch.zeros(4, dtype=torch.int32)
    distance = field.packed.distance(points, columns, first)
    assert torch.isnan(distance).tolist() == [False, False, True, False]
    assert len(field.packed.possibly_inside(points)) == len(
        field.packed.nearest_label(points, columns)
    )

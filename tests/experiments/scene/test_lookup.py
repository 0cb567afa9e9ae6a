from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from experiments.scene.lookup import SceneLookup, trilinear, trilinear_reference
from experiments.scene.scene import MPCAT40, Scene
from experiments.scene.synthetic import synthetic_room


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PACE_CACHE", str(tmp_path_factory.mktemp("cache")))
        return synthetic_room(cell=0.1)


coordinate = st.floats(-1.0, 4.0, allow_nan=False)


@given(st.tuples(coordinate, coordinate, coordinate), st.booleans())
def test_distance_equals_the_textbook_interpolation(
    room: Scene, point: tuple[float, float, float], thickened: bool
) -> None:
    lookup = SceneLookup(room, thickened=thickened, dtype=torch.float64)
    fast = lookup.distance(torch.tensor(point, dtype=torch.float64))
    slow = trilinear_reference(room.volumes, thickened, np.array(point))
    assert float(fast) == pytest.approx(slow, abs=1e-9)


def test_the_gradient_of_the_distance_is_right(room: Scene) -> None:
    lookup = SceneLookup(room, dtype=torch.float64)
    rng = np.random.default_rng(3)
    # Strictly inside cells: the interpolant has kinks on their faces.
    node = rng.integers(0, np.array(room.volumes.sdf.shape) - 1, (40, 3))
    inner = node + rng.uniform(0.1, 0.9, (40, 3))
    points = torch.tensor(np.array(room.volumes.origin) + room.volumes.cell * inner)
    assert torch.autograd.gradcheck(lookup.distance, points.requires_grad_())


def test_a_linear_field_is_reproduced_exactly_with_its_gradient() -> None:
    slope, origin, cell = torch.tensor([0.3, -1.2, 2.0]), torch.tensor([1.0, 2.0, -0.5]), 0.25
    index = torch.stack(torch.meshgrid(*(torch.arange(n) for n in (4, 5, 6)), indexing="ij"), -1)
    volume = (origin + cell * index) @ slope
    points = (origin + cell * torch.tensor([[0.5, 3.2, 4.9], [2.9, 0.1, 0.0]])).requires_grad_()
    values = trilinear(volume, origin, cell, points)
    torch.testing.assert_close(values, points.detach() @ slope)
    (gradient,) = torch.autograd.grad(values.sum(), points)
    torch.testing.assert_close(gradient[0], slope, rtol=1e-4, atol=1e-5)


def test_beyond_the_grid_the_border_value_holds_without_gradient(room: Scene) -> None:
    lookup = SceneLookup(room)
    high = torch.tensor([[1.5, 0.6, 2.4], [1.5, 0.6, 9.0]], requires_grad=True)
    at_border, beyond = lookup.distance(high)
    (gradient,) = torch.autograd.grad(beyond, high)
    assert at_border.item() == beyond.item() == pytest.approx(0.6, abs=1e-6)
    assert float(gradient[1, 2]) == 0.0


def test_labels_are_those_of_the_nearest_node(room: Scene) -> None:
    points = torch.tensor([[1.5, 1.75, 0.5], [1.5, 0.4, 0.1], [0.1, 1.5, 1.2], [-5.0, 1.0, 1.0]])
    names = [MPCAT40[int(index)] for index in SceneLookup(room).label(points)]
    assert names == ["chair", "floor", "wall", "wall"]


def test_any_leading_shape_of_points_is_kept(room: Scene) -> None:
    lookup = SceneLookup(room)
    points = torch.rand(2, 5, 3, generator=torch.Generator().manual_seed(0))
    assert lookup.distance(points).shape == lookup.label(points).shape == (2, 5)
    torch.testing.assert_close(lookup.distance(points)[1, 3], lookup.distance(points[1, 3]))

from __future__ import annotations

import numpy as np
import pytest
import torch

from experiments.scene.lookup import SceneLookup
from experiments.synthesis.scene_encoder import N_POINTS, SceneEncoder, scene_points


@pytest.fixture(scope="module")
def encoder() -> SceneEncoder:
    torch.manual_seed(3)
    return SceneEncoder().double()


def test_the_encoder_equals_its_definition_written_out_point_by_point(encoder) -> None:
    points = torch.randn(1, 7, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    values = list(points[0])
    for layer in encoder.layers:
        rows = torch.stack([layer.weight @ value + layer.bias for value in values])
        mean = rows.mean(0)
        spread = ((rows - mean) ** 2).mean(0)
        values = [((row - mean) / (spread + 1e-5).sqrt()).clamp(min=0) for row in rows]
    wanted = torch.stack(values).max(0).values
    assert torch.allclose(encoder(points)[0], wanted, atol=1e-12)


def test_the_normalisation_is_torchs_instance_norm_without_affine(encoder) -> None:
    points = torch.randn(2, 50, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    values = points.transpose(1, 2)
    for layer in encoder.layers:
        values = torch.nn.functional.conv1d(values, layer.weight[..., None], layer.bias)
        values = torch.relu(torch.nn.functional.instance_norm(values))
    assert torch.allclose(encoder(points), values.amax(-1), atol=1e-9)


def test_the_order_of_the_points_and_the_other_rooms_do_not_matter(encoder) -> None:
    generator = torch.Generator().manual_seed(4)
    rooms = torch.randn(3, 40, 3, dtype=torch.float64, generator=generator)
    shuffled = rooms[:, torch.randperm(40, generator=generator)]
    assert torch.allclose(encoder(rooms), encoder(shuffled), atol=1e-12)
    assert torch.allclose(encoder(rooms)[1], encoder(rooms[1:2])[0], atol=1e-12)


def test_a_shifted_room_has_the_same_feature(encoder) -> None:
    # A consequence of the published normalisation: the network cannot know where the origin is.
    room = torch.randn(1, 40, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(5))
    assert torch.allclose(encoder(room), encoder(room + 7.0), atol=1e-6)


def test_points_of_a_room_lie_on_its_surfaces_and_depend_on_the_seed_alone(seat_room) -> None:
    points = scene_points(seat_room)
    distance = SceneLookup(seat_room).distance(torch.tensor(points))
    # The underside of the seat lies on the floor: a surface of the mesh, inside the solids.
    under = np.all((points[:, :2] > [1.2, 1.5]) & (points[:, :2] < [1.8, 2.0]), axis=1)
    seen = ~(under & (points[:, 2] < 1e-6))
    assert points.shape == (N_POINTS, 3)
    assert float(distance[torch.tensor(seen)].abs().max()) < 0.03
    assert np.array_equal(points, scene_points(seat_room))
    assert not np.array_equal(points, scene_points(seat_room, seed=1))


def test_points_are_spread_by_area(seat_room) -> None:
    corners = seat_room.vertices[seat_room.faces].astype(float)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    share = area[corners[..., 2].max(1) < 1e-6].sum() / area.sum()
    found = (scene_points(seat_room, count=20_000)[:, 2] < 1e-6).mean()
    assert found == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 20_000))

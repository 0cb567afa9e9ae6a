from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.scene.occlusion import (
    DARKEST,
    FULL_AT,
    SKY,
    Surface,
    bake_occlusion,
    cosine_directions,
)
from experiments.scene.synthetic import box_object


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PACE_CACHE", str(tmp_path))


def rectangle(
    centre: tuple[float, float, float], side: float, normal: tuple[float, float, float], group: str
) -> Surface:
    up = np.array(normal, dtype=float)
    u = np.cross(up, [0.3, 0.5, 0.8])
    u /= np.linalg.norm(u)
    v = np.cross(up, u)
    ring = np.array(centre) + side / 2 * np.array([-u - v, u - v, u + v, -u + v])
    corners = np.float32([ring[[0, 1, 2]], ring[[0, 2, 3]]])
    normals = np.broadcast_to(np.float32(normal), (2, 3, 3))
    return Surface(corners, np.ascontiguousarray(normals), group)


def test_the_open_sky_is_the_mean_of_its_own_gradient() -> None:
    (open_floor,) = bake_occlusion([rectangle((0, 0, 0), 2.0, (0, 0, 1), "floor")])
    np.testing.assert_array_equal(open_floor.factor, 1.0)
    (ceiling,) = bake_occlusion([rectangle((0, 0, 3), 2.0, (0, 0, -1), "room")])
    # Cosine-weighted mean of z over the lower hemisphere is -2/3.
    light = 1 - SKY - SKY * 2 / 3
    wanted = DARKEST + (1 - DARKEST) * min(1.0, light / FULL_AT)
    np.testing.assert_allclose(ceiling.factor, wanted, atol=0.005)


def test_a_lid_close_above_makes_the_darkest_floor() -> None:
    small, lid = (
        rectangle((0, 0, 0), 0.1, (0, 0, 1), "floor"),
        rectangle((0, 0, 0.004), 50.0, (0, 0, -1), "lid"),
    )
    under, _ = bake_occlusion([small, lid])
    assert under.factor.max() < DARKEST + 0.02


def test_a_hidden_object_gives_all_of_its_light_back() -> None:
    floor = rectangle((0, 0, 0), 0.4, (0, 0, 1), "floor")
    box = box_object("box", (-0.6, -0.6, 0.2), (0.6, 0.6, 1.4), "cabinet").parts[0]
    tall = Surface(box.corners, box.normals, "object:box")
    with_box, own = bake_occlusion([floor, tall], ["object:box"])
    (without,) = bake_occlusion([floor])
    assert with_box.factor.max() < 0.8
    freed = with_box.factor + with_box.released["object:box"]
    np.testing.assert_allclose(freed, without.factor, atol=2e-3)
    assert own.released == {}


def test_the_same_seed_bakes_the_same_and_the_cache_tells_rooms_apart(tmp_path: Path) -> None:
    surfaces = [rectangle((0, 0, z), 1.0, (0, 0, 1), "room") for z in (0.0, 0.3)]
    first, again = bake_occlusion(surfaces), bake_occlusion(surfaces)
    np.testing.assert_array_equal(first[0].factor, again[0].factor)
    assert len(list(tmp_path.rglob("*.npz"))) == 1
    bake_occlusion(surfaces[:1])
    bake_occlusion(surfaces, seed=1)
    assert len(list(tmp_path.rglob("*.npz"))) == 3


def test_directions_are_unit_above_the_surface_and_cosine_weighted() -> None:
    normal = np.array([[0.0, 0.6, 0.8], [0.0, 0.0, -1.0]])
    rays = cosine_directions(normal, 256, np.random.default_rng(0)).reshape(2, 256, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=2), 1, atol=1e-5)
    height = (rays * normal[:, None]).sum(axis=2)
    assert (height >= 0).all()
    # E[cos] = 2/3 and E[cos^2] = 1/2 under a cosine density; sideways it is balanced.
    np.testing.assert_allclose([height.mean(), (height**2).mean()], [2 / 3, 1 / 2], atol=0.01)
    np.testing.assert_allclose(rays.mean(axis=1), 2 / 3 * normal, atol=0.02)

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from experiments.scene.exact import exact_distance, nearest_triangle
from experiments.scene.narrow_band import PlanarTriangles
from experiments.scene.scene import MPCAT40, Volumes
from experiments.scene.synthetic import box_object
from experiments.scene.volumes import Solid, bake_volumes, shell_distance

ROOM = (2.0, 1.8, 2.2)
CHAIR, TABLE = MPCAT40.index("chair"), MPCAT40.index("table")


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> np.ndarray:
    return box_object("box", low, high, "chair").triangles()


def nodes(volumes: Volumes) -> np.ndarray:
    index = np.stack(np.meshgrid(*map(np.arange, volumes.sdf.shape), indexing="ij"), axis=-1)
    return np.array(volumes.origin) + volumes.cell * index


def room_distance(points: np.ndarray) -> np.ndarray:
    return shell_distance(ROOM, (points[:, 0, 0, 0], points[0, :, 0, 1], points[0, 0, :, 2]))[0]


def at(volumes: Volumes, *point: float) -> tuple[int, ...]:
    return tuple(np.round((np.array(point) - volumes.origin) / volumes.cell).astype(int))


@pytest.fixture(scope="module")
def table() -> Volumes:
    """A top of 4 cm on four legs, baked as one object."""
    legs = [((x, y, 0.0), (x + 0.06, y + 0.06, 0.7)) for x in (0.5, 1.3) for y in (0.5, 1.1)]
    parts = [box((0.45, 0.45, 0.7), (1.41, 1.21, 0.74)), *(box(*leg) for leg in legs)]
    return bake_volumes(ROOM, [Solid(np.concatenate(parts), TABLE)], cell=0.02)


@pytest.mark.parametrize("cell", [0.05, 0.03])
def test_a_box_on_the_floor_has_its_exact_distance_everywhere(cell: float) -> None:
    low, high = (0.5, 0.6, 0.0), (1.1, 1.3, 0.45)
    volumes = bake_volumes(ROOM, [Solid(box(low, high), CHAIR)], cell=cell)
    points = nodes(volumes)
    # Floor and box are one solid: the box goes on downwards, as far as its inside is concerned.
    beyond = np.abs(points - np.add(low, high) / 2) - np.subtract(high, low) / 2
    beyond[..., 2] = points[..., 2] - high[2]
    exact = np.linalg.norm(np.maximum(beyond, 0), axis=-1) + np.minimum(beyond.max(axis=-1), 0)
    above = points[..., 2] > -1e-9
    shell = room_distance(points)
    wanted = np.where(above, np.minimum(exact, shell), shell)
    np.testing.assert_allclose(volumes.sdf, wanted, atol=2e-6)


def test_an_empty_room_is_its_shell() -> None:
    volumes = bake_volumes(ROOM, [], cell=0.1)
    values = {place: float(volumes.sdf[at(volumes, *place)]) for place in PLACES}
    assert values == pytest.approx(PLACES, abs=1e-6)
    assert MPCAT40[volumes.label[at(volumes, 1.0, 0.9, 0.1)]] == "floor"
    assert MPCAT40[volumes.label[at(volumes, 0.1, 0.9, 1.0)]] == "wall"


PLACES = {
    (1.0, 0.9, 0.3): 0.3,
    (1.0, 0.9, 2.2): 0.9,
    (0.2, 0.9, 1.0): 0.2,
    (1.0, 0.9, -0.1): -0.1,
    (-0.1, 0.9, -0.2): -np.hypot(0.1, 0.2),
}


def test_volumes_agree_with_every_triangle_asked_in_turn() -> None:
    rng = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.3)
    ball.apply_translation((0.7, 0.8, 0.35))
    stand = trimesh.creation.cylinder(radius=0.2, height=0.5, sections=16)
    stand.apply_transform(trimesh.transformations.rotation_matrix(0.5, (1, 0.3, 0), (0, 0, 0)))
    stand.apply_translation((1.4, 1.0, 0.4))
    solids = [Solid(np.float32(m.triangles), c) for m, c in ((ball, CHAIR), (stand, TABLE))]
    volumes = bake_volumes(ROOM, solids, cell=0.04)
    chosen = rng.integers(0, volumes.sdf.shape, (500, 3))
    points = np.array(volumes.origin) + volumes.cell * chosen
    baked, label = volumes.sdf[tuple(chosen.T)], volumes.label[tuple(chosen.T)]
    exact = np.array([exact_distance(point, ROOM, solids) for point in points])
    error = baked - exact[:, 0]
    band = np.abs(exact[:, 0]) <= 0.08
    assert np.abs(error[band]).max() < 1e-5
    assert np.abs(error).max() < 0.004
    assert (np.sign(baked[~band]) == np.sign(exact[~band, 0])).all()
    assert (label == exact[:, 1]).mean() > 0.995


def test_under_a_table_is_air_and_its_legs_and_top_are_solid(table: Volumes) -> None:
    assert table.sdf[at(table, 0.96, 0.84, 0.40)] == pytest.approx(0.29, abs=0.05)
    assert table.sdf[at(table, 0.96, 0.84, 0.60)] == pytest.approx(0.10, abs=0.01)
    assert table.sdf[at(table, 0.96, 0.84, 0.72)] == pytest.approx(-0.02, abs=1e-5)
    assert table.sdf[at(table, 0.52, 0.52, 0.40)] == pytest.approx(-0.02, abs=1e-5)


def test_where_objects_overlap_the_outer_surface_counts() -> None:
    cushion, seat = box((0.7, 0.7, 0.3), (1.0, 1.0, 0.5)), box((0.5, 0.5, 0.0), (1.3, 1.3, 0.4))
    volumes = bake_volumes(ROOM, [Solid(cushion, CHAIR), Solid(seat, TABLE)], cell=0.05)
    assert volumes.sdf[at(volumes, 0.85, 0.85, 0.4)] == pytest.approx(-0.1, abs=1e-6)
    assert volumes.sdf[at(volumes, 0.85, 0.85, 0.3)] == pytest.approx(-0.1, abs=1e-6)


def test_thickening_takes_a_centimetre_off_on_both_sides_of_furniture_only(table: Volumes) -> None:
    for place in ((0.96, 0.84, 0.72), (0.96, 0.84, 0.78), (0.96, 0.84, 0.66)):
        there = at(table, *place)
        assert table.thickened[there] == pytest.approx(float(table.sdf[there]) - 0.01, abs=1e-6)
    for place in ((1.8, 0.84, 0.04), (0.04, 0.84, 1.0), (-0.1, 0.84, 1.0)):
        assert table.thickened[at(table, *place)] == table.sdf[at(table, *place)]


def test_a_furniture_piece_that_reaches_through_a_wall_is_cut_off_by_the_grid() -> None:
    volumes = bake_volumes(ROOM, [Solid(box((1.5, 0.5, 0.0), (4.0, 1.0, 0.5)), CHAIR)], cell=0.05)
    assert volumes.sdf[at(volumes, 1.75, 0.75, 0.25)] == pytest.approx(-0.25, abs=1e-6)
    assert np.isfinite(volumes.sdf).all()


def test_flat_and_empty_triangles_do_not_disturb_the_distance() -> None:
    sound = box((0.5, 0.5, 0.0), (1.0, 1.0, 0.5))
    spoilt = np.concatenate([sound, np.repeat(sound[:2, :1], 3, axis=1)])
    clean, other = (bake_volumes(ROOM, [Solid(c, CHAIR)], cell=0.1) for c in (sound, spoilt))
    np.testing.assert_array_equal(clean.sdf, other.sdf)


def test_triangle_distances_agree_with_the_obvious_ones() -> None:
    rng = np.random.default_rng(7)
    corners = rng.normal(size=(200, 3, 3)).astype(np.float32)
    points = rng.normal(size=(200, 3)).astype(np.float32) * 2
    fast = PlanarTriangles.of(corners).distance(points, np.arange(200))
    slow = [
        nearest_triangle(p.astype(float), t[None])[0] for p, t in zip(points, corners, strict=True)
    ]
    np.testing.assert_allclose(fast, slow, atol=2e-6)


def test_progress_runs_to_the_end() -> None:
    shares: list[float] = []
    solids = [Solid(box((0.5, 0.5, 0.0), (1.0, 1.0, 0.5)), CHAIR)] * 3
    bake_volumes(ROOM, solids, cell=0.1, on_step=shares.append)
    assert shares == sorted(shares) and shares[-1] == 1.0 and len(shares) >= 4

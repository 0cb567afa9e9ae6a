from __future__ import annotations

import numpy as np
import pytest

from experiments.scene.furniture_distance import Solid
from experiments.scene.scene import MPCAT40, Volumes
from experiments.scene.synthetic import box_object
from experiments.scene.volumes import bake_volumes

ROOM = (2.4, 2.0, 2.2)
Point = tuple[float, float, float]


def box(low: Point, high: Point) -> np.ndarray:
    return box_object("box", low, high, "cabinet").triangles()


def bake(*parts: np.ndarray, cell: float = 0.025) -> Volumes:
    solid = Solid(np.concatenate(parts), MPCAT40.index("cabinet"))
    return bake_volumes(ROOM, [solid], cell=cell)


def at(volumes: Volumes, *point: float) -> float:
    index = np.round((np.array(point) - volumes.origin) / volumes.cell).astype(int)
    return float(volumes.sdf[tuple(index)])


def cabinet(depth: float, without: str = "") -> list[np.ndarray]:
    """Boards of 2 cm around the space [0.7, 1.5] x [0.8, 0.8 + depth] x [0.2, 1.0]."""
    x, y, z, t = (0.7, 1.5), (0.8, 0.8 + depth), (0.2, 1.0), 0.02
    boards = {
        "left": box((x[0] - t, y[0], z[0]), (x[0], y[1], z[1])),
        "right": box((x[1], y[0], z[0]), (x[1] + t, y[1], z[1])),
        "front": box((x[0], y[0] - t, z[0]), (x[1], y[0], z[1])),
        "back": box((x[0], y[1], z[0]), (x[1], y[1] + t, z[1])),
        "bottom": box((x[0] - t, y[0] - t, z[0] - t), (x[1] + t, y[1] + t, z[0])),
        "top": box((x[0] - t, y[0] - t, z[1]), (x[1] + t, y[1] + t, z[1] + t)),
    }
    return [board for name, board in boards.items() if name != without]


def test_a_closed_cabinet_is_solid_through_and_through() -> None:
    volumes = bake(*cabinet(0.6))
    assert at(volumes, 1.1, 1.1, 0.6) == pytest.approx(-0.32, abs=1e-5)
    assert at(volumes, 1.1, 0.8, 0.6) == pytest.approx(-0.02, abs=1e-5)


def test_a_deep_shelf_that_is_open_in_front_is_air_to_its_back() -> None:
    volumes = bake(*cabinet(0.6, without="front"))
    assert at(volumes, 1.1, 1.1, 0.6) > 0.25
    assert at(volumes, 0.75, 1.35, 0.25) == pytest.approx(0.05, abs=1e-5)


def test_the_hollow_of_a_seat_that_is_open_at_its_base_is_solid() -> None:
    assert at(bake(*cabinet(0.6, without="bottom")), 1.1, 1.1, 0.7) < -0.25


def test_a_seam_of_two_centimetres_does_not_let_the_air_in() -> None:
    boards = cabinet(0.6, without="top")
    lid = [box((0.68, 0.78, 1.0), (1.09, 1.42, 1.02)), box((1.11, 0.78, 1.0), (1.52, 1.42, 1.02))]
    assert at(bake(*boards, *lid), 0.9, 1.1, 0.6) < -0.15


def test_the_missing_back_of_a_cabinet_against_the_wall_is_closed_by_the_wall() -> None:
    boards = [board + np.float32([0.0, 0.6, 0.0]) for board in cabinet(0.6, without="back")]
    assert at(bake(*boards), 1.1, 1.7, 0.6) < -0.25


def test_boards_buried_inside_do_not_make_the_depth_smaller() -> None:
    hollow = bake(*cabinet(0.6))
    filled = bake(*cabinet(0.6), box((0.9, 0.9, 0.4), (1.3, 1.3, 0.8)))
    np.testing.assert_allclose(filled.sdf, hollow.sdf, atol=2e-5)


def test_a_sign_change_is_never_far_from_a_surface() -> None:
    volumes = bake(*cabinet(0.6, without="front"), cell=0.04)
    inner = volumes.sdf[:, :, 6:]
    for axis in range(3):
        a, b = (np.take(inner, range(s, inner.shape[axis] - 1 + s), axis) for s in (0, 1))
        assert (np.abs(a - b)[np.sign(a) != np.sign(b)] <= 0.04 + 1e-5).mean() > 0.999

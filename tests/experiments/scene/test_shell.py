from __future__ import annotations

import numpy as np
import pytest

from experiments.scene.layout import Layout, Opening
from experiments.scene.shell import ShellPart, shell_parts, shell_walls
from experiments.scene.textures import BRIGHTEST, floor_texture, paint_texture

SIZE = (3.0, 2.5, 2.4)
WINDOW = Opening("n", "window", 0.8, 2.0, 0.9, 2.0)
DOOR = Opening("e", "door", 0.5, 1.3, 0.0, 2.0)


def layout(*openings: Opening) -> Layout:
    return Layout("test", SIZE, "wood", (0.6, 0.45, 0.3), (0.8, 0.8, 0.75), openings, ())


def area(parts: list[ShellPart]) -> float:
    corners = np.concatenate([part.material.corners for part in parts]).astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(normal, axis=1).sum() / 2)


def of(parts: list[ShellPart], instance: str, textured: bool = True) -> list[ShellPart]:
    return [p for p in parts if p.instance == instance and (p.material.uv is not None) == textured]


def test_walls_lose_exactly_the_area_of_their_openings() -> None:
    parts = shell_parts(layout(WINDOW, DOOR))
    assert area(of(parts, "floor")) == pytest.approx(3.0 * 2.5, rel=1e-5)
    assert area(of(parts, "wall_n")) == pytest.approx(3.0 * 2.4 - 1.2 * 1.1, rel=1e-5)
    assert area(of(parts, "wall_e")) == pytest.approx(2.5 * 2.4 - 0.8 * 2.0, rel=1e-5)
    assert area(of(parts, "wall_s")) == pytest.approx(3.0 * 2.4, rel=1e-5)


def test_every_face_turns_the_way_its_normal_says_and_none_looks_out() -> None:
    centre = np.array(SIZE) / 2
    for part in shell_parts(layout(WINDOW, DOOR)):
        corners, normals = part.material.corners, part.material.normals
        turn = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert ((turn * normals[:, 0]).sum(axis=1) > 0).all()
        if part.material.uv is not None:
            inward = ((centre - corners[:, 0]) * normals[:, 0]).sum(axis=1)
            assert (inward > 0).all()


def test_floor_and_walls_are_cut_finely_enough_for_occlusion() -> None:
    for part in shell_parts(layout(WINDOW)):
        if part.occlusion is None:
            edges = part.material.corners - np.roll(part.material.corners, 1, axis=1)
            assert np.linalg.norm(edges, axis=2).max() < 0.19


def test_a_window_is_glazed_and_a_door_closed() -> None:
    parts = shell_parts(layout(WINDOW, DOOR))
    pane, leaf = of(parts, "wall_n", textured=False)[0], of(parts, "wall_e", textured=False)[0]
    assert area([pane]) == pytest.approx(1.2 * 1.1, rel=1e-5)
    assert area([leaf]) == pytest.approx(0.8 * 2.0, rel=1e-5)
    assert pane.material.corners[..., 1].min() > SIZE[1]
    assert leaf.material.corners[..., 0].min() > SIZE[0]


def test_skirting_runs_along_every_wall_but_not_through_the_door() -> None:
    parts = [
        p for p in shell_parts(layout(DOOR)) if p.instance == "wall_e" and p.material.uv is None
    ]
    low = np.concatenate([p.material.corners for p in parts]).reshape(-1, 3)
    skirting = low[(low[:, 2] <= 0.081) & (low[:, 0] < SIZE[0] - 0.01)]
    assert skirting[:, 1].min() == 0.0 and skirting[:, 1].max() == SIZE[1]
    assert not ((skirting[:, 1] > 0.51) & (skirting[:, 1] < 1.29)).any()


def test_the_bare_shell_closes_the_room_on_five_sides() -> None:
    walls = shell_walls(SIZE)
    assert set(walls) == {"floor", "wall_n", "wall_e", "wall_s", "wall_w"}
    corners = np.concatenate(list(walls.values())).astype(float)
    # The divergence theorem: the missing lid is what the volume lacks.
    signed = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert -signed == pytest.approx(np.prod(SIZE) - 3.0 * 2.5 * 2.4 / 3, rel=1e-6)


@pytest.mark.parametrize("kind", ["wood", "tile", "carpet"])
def test_floor_textures_keep_their_tint_and_repeat_without_a_seam(kind: str) -> None:
    tint = (0.6, 0.45, 0.3)
    texture = floor_texture(kind, tint).astype(float) / 255
    np.testing.assert_allclose(texture.mean(axis=(0, 1)), tint, rtol=0.08)
    assert texture.max() <= BRIGHTEST + 1e-9
    inner = np.abs(np.diff(texture, axis=1)).mean(axis=(0, 2))
    seam = np.abs(texture[:, 0] - texture[:, -1]).mean()
    assert seam <= max(inner.max(), 0.02)


def test_textures_follow_their_seed() -> None:
    colour = (0.8, 0.8, 0.75)
    np.testing.assert_array_equal(paint_texture(colour, 1), paint_texture(colour, 1))
    assert (paint_texture(colour, 1) != paint_texture(colour, 2)).any()
    assert np.ptp(paint_texture(colour).astype(int), axis=(0, 1)).max() < 25

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from experiments.body.decimate import closed_subset
from experiments.body.skinned_body import SkinnedBody
from experiments.body.surface import (
    euler_characteristic,
    fill_holes,
    is_closed,
    largest_component,
    vertex_normals,
)

BOX = np.asarray(trimesh.creation.box().faces)
SPHERE = trimesh.creation.icosphere(subdivisions=4)


def test_a_box_is_closed_and_an_open_box_is_not() -> None:
    assert is_closed(BOX) and euler_characteristic(BOX) == 2
    assert not is_closed(BOX[1:])
    assert not is_closed(np.concatenate([BOX[:1, ::-1], BOX[1:]]))


def test_a_ring_has_euler_characteristic_zero() -> None:
    ring = trimesh.creation.torus(1.0, 0.3)
    assert euler_characteristic(np.asarray(ring.faces)) == 0


@pytest.mark.parametrize("cut", [0, 17, 300])
def test_filling_the_holes_of_a_sphere_closes_it_again(cut: int) -> None:
    faces = np.asarray(SPHERE.faces)
    opened = faces[~np.isin(faces, faces[cut]).any(axis=1)]
    filled = fill_holes(opened)
    assert is_closed(filled) and euler_characteristic(filled) == 2
    np.testing.assert_array_equal(filled[: len(opened)], opened)


def test_a_hole_in_the_finger_mesh_is_filled_without_repeating_an_edge(male: SkinnedBody) -> None:
    skin = male.faces[np.isin(male.faces, male.body_component).all(axis=1)]
    filled = fill_holes(skin[~np.isin(skin, skin[100]).any(axis=1)])
    assert is_closed(filled) and euler_characteristic(filled) == 2


def test_normals_of_a_sphere_point_outwards() -> None:
    normals = vertex_normals(np.asarray(SPHERE.vertices), np.asarray(SPHERE.faces))
    np.testing.assert_allclose(normals, SPHERE.vertices, atol=0.02)


def test_the_largest_part_of_two_is_found() -> None:
    faces = np.concatenate([BOX, np.asarray(SPHERE.faces) + 8])
    np.testing.assert_array_equal(largest_component(faces), np.arange(8, 8 + len(SPHERE.vertices)))


@pytest.mark.parametrize("count", [40, 200, 900])
def test_a_decimated_sphere_stays_a_closed_sphere_of_its_own_vertices(count: int) -> None:
    vertices = np.asarray(SPHERE.vertices)
    subset, faces = closed_subset(vertices, np.asarray(SPHERE.faces), count)
    assert len(subset) == len(np.unique(subset)) == count
    assert is_closed(faces) and euler_characteristic(faces) == 2
    small = trimesh.Trimesh(vertices[subset], faces, process=False)
    assert small.volume == pytest.approx(4 / 3 * np.pi, rel=12 / count)


def test_collapsing_a_subdivided_box_costs_no_volume() -> None:
    box = trimesh.creation.box().subdivide().subdivide().subdivide()
    subset, faces = closed_subset(np.asarray(box.vertices), np.asarray(box.faces), 40)
    small = trimesh.Trimesh(box.vertices[subset], faces, process=False)
    assert len(subset) == 40
    assert small.volume == pytest.approx(1.0, abs=1e-9)


def test_a_surface_with_an_edge_of_three_faces_is_refused() -> None:
    faces = np.concatenate([BOX, [[BOX[0, 0], BOX[0, 1], 8]]])
    with pytest.raises(ValueError, match="more than two faces"):
        closed_subset(np.zeros((9, 3)), faces, 4)

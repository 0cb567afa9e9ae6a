from __future__ import annotations

import numpy as np
import trimesh

from experiments.scene.enclosure import enclosed, vote_directions
from experiments.scene.exact import enclosed_by_intersection


def test_the_directions_are_26_and_balanced() -> None:
    directions = vote_directions()
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(directions.sum(axis=0), 0, atol=1e-5)
    assert (np.abs(directions) < 0.9999).all()


def test_inside_a_torus_is_its_tube_not_its_hole() -> None:
    torus = trimesh.creation.torus(major_radius=0.5, minor_radius=0.2)
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.8, 0.8, (4000, 3))
    tube = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.5, points[:, 2])
    clear = np.abs(tube - 0.2) > 0.01
    found = enclosed(torus.triangles, points)
    np.testing.assert_array_equal(found[clear], (tube < 0.2)[clear])


def test_flipped_and_doubled_faces_change_nothing() -> None:
    box = trimesh.creation.box((1, 1, 1)).triangles
    spoilt = np.concatenate([box[:, ::-1], box[:5], 0.5 * box])
    points = np.random.default_rng(1).uniform(-0.7, 0.7, (500, 3))
    np.testing.assert_array_equal(enclosed(spoilt, points), (np.abs(points) < 0.5).all(axis=1))


def test_a_box_with_a_small_hole_is_still_solid_and_an_open_one_is_not() -> None:
    fine = trimesh.creation.box((1, 1, 1)).subdivide_to_size(0.2).triangles
    centre = np.zeros((1, 3))
    top = fine[..., 2].min(axis=1) > 0.49
    assert enclosed(fine[1:], centre).all()
    assert not enclosed(fine[~top], centre).any()


def test_the_vote_equals_hand_written_intersections() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=1).triangles[:-4]
    points = np.random.default_rng(2).uniform(-1.1, 1.1, (300, 3)).astype(np.float32)
    slow = [bool(enclosed_by_intersection(point, sphere)) for point in points.astype(float)]
    np.testing.assert_array_equal(enclosed(sphere, points), slow)

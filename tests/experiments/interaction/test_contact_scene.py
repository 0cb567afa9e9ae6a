"""Boxes and half-spaces: distances in closed form against points on their surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from experiments.interaction.contact_scene import (
    Box,
    ContactScene,
    HalfSpace,
    Heading,
    tilted_slab,
)

FLOOR = HalfSpace(np.array([0.0, 0.0, 1.0]), 0.0, 2)


def some_box(seed: int) -> Box:
    rng = np.random.default_rng(seed)
    axes = Rotation.random(rng=rng).as_matrix()
    return Box(rng.normal(size=3), rng.uniform(0.1, 0.8, 3), axes, 3)


def surface_points(box: Box, n: int) -> np.ndarray:
    """A dense lattice on the six faces."""
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n)), -1).reshape(-1, 2)
    sides = [np.insert(grid, k, sign, axis=1) for k in range(3) for sign in (-1.0, 1.0)]
    return np.concatenate(sides) * box.half @ box.axes + box.centre


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=15)
def test_the_distance_to_a_box_is_that_to_its_nearest_surface_point(seed: int) -> None:
    box = some_box(seed)
    points = box.centre + np.random.default_rng(seed).normal(size=(20, 3))
    brute = np.linalg.norm(points[:, None] - surface_points(box, 60), axis=-1).min(1)
    # The lattice's nearest point is at most half a cell's diagonal away from the true one.
    assert np.abs(box.signed(points)) == pytest.approx(brute, abs=0.02)
    assert (np.abs(box.signed(points)) <= brute + 1e-12).all()


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=15)
def test_the_sign_says_inside(seed: int) -> None:
    box = some_box(seed)
    local = np.random.default_rng(seed).uniform(-1.5, 1.5, (50, 3))
    inside = (np.abs(local) < 1).all(1)
    assert ((box.signed(local * box.half @ box.axes + box.centre) < 0) == inside).all()


def test_the_nearest_of_all_solids_gives_the_class() -> None:
    table = Heading.of(np.array([0.0, -1.0, 0.0])).box((-1.0, -1.0, 0.7), (1.0, 1.0, 0.75), 5)
    points = np.array([[0.0, 0, 0.76], [0.0, 0, 0.3], [0.0, 0, 0.72], [0.0, 0, -0.1]])
    distance, label, depth = ContactScene((FLOOR, table)).nearest(points)
    assert label.tolist() == [5, 2, 5, 2]
    assert distance == pytest.approx([0.01, 0.3, 0.02, 0.1])
    assert depth == pytest.approx([0.0, 0.0, 0.02, 0.1])


def test_a_box_of_a_heading_spans_what_it_was_told_to() -> None:
    heading = Heading.of(np.array([0.6, -0.8, 0.3]))
    box = heading.box((0.1, -0.2, 0.0), (0.5, 0.3, 0.45), 3)
    corners = np.array([[0.1, -0.2, 0.0], [0.5, 0.3, 0.45]]) @ heading.axes
    assert box.signed(corners) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert heading.local(corners)[1] == pytest.approx([0.5, 0.3, 0.45])


def test_left_is_left_of_ahead() -> None:
    heading = Heading.of(np.array([0.0, -2.0, 0.5]))
    assert heading.left == pytest.approx([1.0, 0.0, 0.0])


def test_a_slab_leans_back_and_fronts_the_person() -> None:
    heading = Heading.of(np.array([0.0, -1.0, 0.0]))
    slab = tilted_slab(heading, 0.3, -0.1, 0.05, (0.5, 1.0), (-0.2, 0.2), 3)
    ahead, _, up = heading.axes
    normal = np.cos(0.3) * ahead + np.sin(0.3) * up
    rising = np.cos(0.3) * up - np.sin(0.3) * ahead
    front = -0.1 * normal + 0.75 * rising
    assert slab.signed(front) == pytest.approx(0.0, abs=1e-12)
    assert slab.signed(front + 0.02 * normal) == pytest.approx(0.02)
    assert slab.signed(front - 0.02 * normal) == pytest.approx(-0.02)
    # Higher up the front is further back.
    assert (rising @ ahead) < 0

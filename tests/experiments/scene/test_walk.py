import numpy as np
import pytest

from experiments.scene.synthetic import box_object
from experiments.scene.walk import BODY_RADIUS, CELL, walk_map

SIZE = (4.0, 3.0, 2.6)


def test_an_empty_room_is_walkable_up_to_the_body_radius_from_its_walls():
    walk = walk_map([], SIZE)
    wanted = (4.0 - 2 * BODY_RADIUS) * (3.0 - 2 * BODY_RADIUS) / 12.0
    assert walk.free_share == 1.0 and walk.largest_share == 1.0
    assert walk.walkable_share == pytest.approx(wanted, abs=2 * 14 * CELL / 12.0)


def test_a_box_takes_its_footprint_from_the_free_floor():
    walk = walk_map([box((1.0, 1.0, 0.0), (2.0, 2.0, 1.0))], SIZE)
    assert walk.free_share == pytest.approx(1 - 1.0 / 12.0, abs=0.01)


def test_a_wall_of_boxes_cuts_the_room_in_two():
    walk = walk_map([box((1.9, 0.0, 0.0), (2.1, 3.0, 1.0))], SIZE)
    assert walk.region.max() == 2
    assert walk.largest_share == pytest.approx(0.5, abs=0.02)


def test_what_hangs_above_the_head_and_what_is_stepped_over_are_no_obstacles():
    lamp, mat = box((1, 1, 1.9), (2, 2, 2.2)), box((1, 1, 0.0), (3, 2, 0.02))
    assert walk_map([lamp, mat], SIZE).free_share == 1.0


def test_a_gap_narrower_than_the_body_is_not_walked_through():
    def gap(width):
        sides = [
            box((1.9, 0.0, 0.0), (2.1, 1.5, 1.0)),
            box((1.9, 1.5 + width, 0.0), (2.1, 3.0, 1.0)),
        ]
        return int(walk_map(sides, SIZE).region.max())

    assert gap(0.45) == 2 and gap(0.60) == 1


def test_the_distance_to_the_walkable_floor_is_measured_from_the_nearest_edge():
    walk = walk_map([box((1.5, 1.0, 0.0), (2.5, 2.0, 1.0))], SIZE)
    distance = walk.distance_to_largest(np.array([1.5, 1.0]), np.array([2.5, 2.0]))
    assert distance == pytest.approx(BODY_RADIUS, abs=CELL)


def box(low, high):
    corners = (tuple(float(value) for value in point) for point in (low, high))
    return box_object("box", *corners, "furniture")

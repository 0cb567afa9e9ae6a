"""The rooms that come with the project pass every check of the issue that asked for them."""

from functools import cache

import numpy as np
import pytest

from experiments.scene.furnish import furnish
from experiments.scene.layout import read_layout
from experiments.scene.layout_checks import SEAT_HEIGHTS, check_layout
from experiments.scene.rooms import ROOMS
from experiments.scene.scene import MPCAT40


@cache
def checked(name):
    layout = read_layout(name)
    objects = furnish(layout)
    return layout, objects, *check_layout(name, layout.size, objects)


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_has_no_faults(name):
    assert checked(name)[2].faults() == []


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_keeps_the_bounds_of_the_study(name):
    report = checked(name)[2]
    assert report.objects >= 25 and report.floor_standing >= 12
    assert 0.35 <= report.free_floor <= 0.65 and report.largest_component >= 0.6
    assert all(o.depth <= (0.06 if o.soft else 0.012) for o in report.overlaps)
    assert report.floating == report.outside == report.wrong_seats == ()
    assert report.triangles < 80_000


@pytest.mark.parametrize("name", ROOMS)
def test_seats_and_beds_are_as_high_as_real_ones(name):
    _, objects, report, _ = checked(name)
    kinds = {placed.id: MPCAT40[placed.label] for placed in objects}
    assert report.seat_heights
    for seat, height in report.seat_heights.items():
        low, high = SEAT_HEIGHTS[kinds[seat]]
        assert low <= height <= high, seat


@pytest.mark.parametrize("name", ROOMS)
def test_every_door_opens_onto_the_walkable_floor(name):
    layout, _, _, walk = checked(name)
    for door in (opening for opening in layout.openings if opening.kind == "door"):
        middle = (door.u0 + door.u1) / 2
        end = layout.size[0] if door.wall == "e" else layout.size[1] if door.wall == "n" else 0.0
        point = np.array([middle, end] if door.wall in "ns" else [end, middle])
        assert walk.distance_to_largest(point, point) < 0.75


def test_a_bedroom_has_a_bed_and_a_library_books_and_a_booth_benches():
    assert "bed" in checked("bedroom")[2].classes
    assert "shelving" in checked("library")[2].classes
    assert "seating" in checked("booth")[2].classes
    assert {"sofa", "tv_monitor"} <= set(checked("living")[2].classes)


@pytest.mark.parametrize("name", ROOMS)
def test_colours_stay_calm(name):
    for placed in checked(name)[1]:
        for part in placed.parts:
            assert min(part.colour) >= 0.0 and max(part.colour) <= 1.0
            assert part.corners.dtype == part.normals.dtype

from dataclasses import replace

import pytest

from experiments.scene.layout_checks import (
    affordances,
    check_layout,
    floating,
    outside,
    overlaps,
    seat_heights,
)
from experiments.scene.synthetic import box_object

SIZE = (4.0, 3.0, 2.6)


def box(name, low, high, kind="furniture", **more):
    corners = (tuple(float(value) for value in point) for point in (low, high))
    return box_object(name, *corners, kind, **more)


CRATE = box("crate", (1, 1, 0), (2, 2, 1))


def test_two_boxes_that_share_a_slab_overlap_by_its_half():
    # The deepest points of one surface lie in the middle of the shared slab of 10 cm.
    other = box("other", (1.9, 1.0, 0), (2.9, 2.0, 1.0))
    found = {(o.a, o.b): o.depth for o in overlaps([CRATE, other])}
    assert set(found) == {("crate", "other"), ("other", "crate")}
    assert found[("other", "crate")] == pytest.approx(0.1, abs=0.01)


def test_boxes_that_touch_do_not_overlap():
    assert overlaps([CRATE, box("other", (2, 1, 0), (3, 2, 1))]) == []


def test_a_rug_overlaps_nothing():
    rug = box("rug", (0.5, 0.5, 0), (3, 2.5, 0.03), "floor")
    assert overlaps([CRATE, rug]) == []


def test_a_soft_thing_may_sink_in_six_centimetres_and_a_hard_one_may_not():
    cushion = replace(
        box("cushion", (1.2, 1.2, 0.96), (1.6, 1.6, 1.3), "cushion", on="crate"), soft=True
    )
    soft = overlaps([CRATE, cushion])
    hard = overlaps([CRATE, replace(cushion, soft=False)])
    assert soft and all(o.depth <= o.allowed for o in soft)
    assert any(o.depth > o.allowed for o in hard)


def test_a_thing_above_its_support_or_above_the_floor_floats():
    things = [
        CRATE,
        box("high", (0.1, 0.1, 0.02), (0.5, 0.5, 0.5)),
        box("lifted", (1.2, 1.2, 1.02), (1.4, 1.4, 1.2), on="crate"),
        box("resting", (1.6, 1.2, 1.0), (1.8, 1.4, 1.2), on="crate"),
        box("toppling", (1.9, 1.5, 1.0), (2.5, 1.7, 1.1), on="crate"),
    ]
    assert list(floating(things, SIZE)) == ["high", "lifted", "toppling"]


def test_a_picture_must_touch_its_wall():
    good = box("good", (3.97, 1, 1.2), (4.0, 2, 1.8), "picture", wall="e")
    bad = box("bad", (3.9, 1, 1.2), (3.93, 2, 1.8), "picture", wall="e")
    assert list(floating([good, bad], SIZE)) == ["bad"]


def test_what_reaches_through_a_wall_is_outside():
    assert list(outside([CRATE, box("through", (3.5, 1, 0), (4.02, 2, 1))], SIZE)) == ["through"]


def test_the_seat_of_a_box_is_its_top():
    assert seat_heights([box("sofa", (1, 1, 0), (2, 2, 0.44), "sofa")]) == {"sofa": 0.44}


def test_affordances_are_counted_by_class_and_height():
    things = [
        box("bed", (0, 0, 0), (1, 2, 0.5), "bed"),
        box("low", (1, 0, 0), (2, 1, 0.4), "table"),
        box("high", (2, 0, 0), (3, 1, 0.9), "table"),
        box("book", (2.2, 0.2, 0.9), (2.4, 0.4, 1.0), "table", on="high"),
    ]
    assert affordances(things) == {"sit": 2, "lie": 1, "touch": 2, "lean": 1}


def test_an_empty_room_is_faulted_for_what_it_lacks():
    report, _ = check_layout("empty", SIZE, [CRATE, box("bad", (3.5, 1, 0.1), (4.2, 2, 1))])
    faults = " / ".join(report.faults())
    for text in ("objects 2, wanted 25", "bad floats", "bad is outside", "places to sit 0"):
        assert text in faults

from dataclasses import replace

import numpy as np
import pytest

from experiments.scene.furnish import furnish
from experiments.scene.layout import Item, Layout
from experiments.scene.pack import default_pack
from renderer.files import InputError

TABLE, CUSHION, CHAIR = 5, 8, 3
ROOM = Layout("cell", (4.0, 3.0, 2.6), "wood", (0.5, 0.4, 0.3), (0.8, 0.8, 0.8), (), ())


def room(*items):
    return replace(ROOM, items=items)


def desk(**changes):
    return replace(Item("desk", TABLE, 2.0, 1.0, shape="table"), **changes)


def box_of(placed):
    triangles = placed.triangles()
    return triangles.min((0, 1)), triangles.max((0, 1))


def test_a_quarter_turn_swaps_width_and_depth_about_the_given_place():
    low, high = box_of(furnish(room(desk(yaw=90.0)))[0])
    assert (high - low)[:2] == pytest.approx([0.8, 1.2])
    assert (high + low)[:2] / 2 == pytest.approx([2.0, 1.0])


def test_the_front_looks_south_at_yaw_nought_and_east_after_a_quarter_turn():
    monitor = Item("m", 22, 0.0, 0.0, shape="monitor", z=0.0)
    glass = furnish(room(monitor))[0].parts[1]
    assert glass.normals.mean((0, 1)) @ [0, -1, 0] >= 0
    front = furnish(room(monitor))[0].parts[1].corners.mean((0, 1))
    turned = furnish(room(replace(monitor, yaw=90.0)))[0].parts[1].corners.mean((0, 1))
    assert front[1] < 0 < turned[0]


def test_things_stand_on_their_support():
    cup = Item("cup", 39, 2.2, 1.1, piece="coffee_cup_9", on="desk")
    placed = furnish(room(desk(), cup))[1]
    assert placed.z == pytest.approx(0.74, abs=1e-4)
    assert box_of(placed)[0][2] == pytest.approx(0.74, abs=1e-4)


def test_a_support_that_is_missed_is_named():
    cup = Item("cup", 39, 3.5, 1.1, piece="coffee_cup_9", on="desk")
    with pytest.raises(InputError, match=r"cell: cup.on: got 'desk', wanted a support under"):
        furnish(room(desk(), cup))


def test_a_wanted_seat_height_is_reached():
    chair = Item("c", CHAIR, 2.0, 1.0, piece="osaka_chair_125", seat=0.40)
    plain = replace(chair, seat=None)
    heights = [box_of(furnish(room(item))[0])[1][2] for item in (chair, plain)]
    assert heights[0] / heights[1] == pytest.approx(0.40 / default_pack().seat("osaka_chair_125"))


def test_a_seat_is_not_asked_of_a_lamp():
    with pytest.raises(InputError, match=r"lamp.seat: got 0.4, wanted a piece that has a seat"):
        furnish(room(Item("lamp", 28, 1.0, 1.0, piece="desk_lamp_15", seat=0.4)))


def test_normals_are_unit_and_agree_with_the_faces():
    for part in furnish(room(Item("c", CHAIR, 2.0, 1.0, piece="chair_79", yaw=33.0)))[0].parts:
        face = np.cross(
            part.corners[:, 1] - part.corners[:, 0], part.corners[:, 2] - part.corners[:, 0]
        )
        assert np.linalg.norm(part.normals, axis=2) == pytest.approx(
            np.ones(part.normals.shape[:2])
        )
        assert ((part.normals * face[:, None]).sum(2) >= -1e-12).all()


def test_mirroring_a_piece_keeps_its_faces_outwards():
    def volume(item):
        corners = furnish(room(item))[0].triangles()
        return np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6

    assert volume(desk(scale=(-1.0, 1.0, 1.0))) == pytest.approx(volume(desk()))


def test_a_tint_colours_the_largest_material_only():
    chair = Item("c", CHAIR, 2.0, 1.0, piece="chair_31")
    before, after = (furnish(room(i))[0] for i in (chair, replace(chair, tint=(0.1, 0.2, 0.3))))
    changed = [b.colour != a.colour for b, a in zip(before.parts, after.parts, strict=True)]
    assert sum(changed) == 1 and (0.1, 0.2, 0.3) in [part.colour for part in after.parts]


def test_a_blanket_follows_what_it_lies_on_and_hangs_over_the_edge():
    bed = Item("bed", 11, 2.0, 1.5, shape="table", params={"size": (1.0, 2.0, 0.5)})
    cloth = Item("cloth", 11, 2.0, 1.5, shape="blanket", on="bed", params={"size": (1.3, 0.5)})
    low, high = box_of(furnish(room(bed, cloth))[1])
    assert low[2] == pytest.approx(0.5 - 0.22, abs=0.01) and 0.51 < high[2] < 0.56


def test_the_same_layout_gives_the_same_triangles():
    items = (desk(), Item("b", 39, 2.0, 1.0, shape="bookstack", on="desk"))
    first, second = furnish(room(*items)), furnish(room(*items))
    assert all(
        np.array_equal(a.triangles(), b.triangles()) for a, b in zip(first, second, strict=True)
    )

import math
from pathlib import Path

import pytest

from experiments.scene.layout import layout_names, parse_layout, read_layout
from experiments.scene.rooms import ROOMS, TEST_ROOMS, TRAINING_ROOMS
from renderer.files import InputError

TABLE = {"id": "t", "class": "table", "shape": "table", "x": 1.0, "y": 1.0}


def document(**changes):
    room = {
        "name": "cell",
        "size": [4.0, 3.0, 2.6],
        "floor": "wood",
        "floor_tint": [0.5, 0.4, 0.3],
        "wall": [0.8, 0.8, 0.8],
    }
    return {"schema_version": 1, "room": room, "opening": [], "object": [TABLE]} | changes


def test_every_room_named_by_the_project_can_be_read_and_no_other_is_there():
    assert set(layout_names()) == set(ROOMS)
    assert all(read_layout(name).name == name for name in ROOMS)


def test_no_training_room_is_a_test_room():
    assert set(TEST_ROOMS).isdisjoint(TRAINING_ROOMS)


def test_a_layout_keeps_what_the_file_says():
    item = parse_layout(document(object=[TABLE | {"yaw": 90, "seat": 0.45}]), "here").items[0]
    assert (item.id, item.asset, item.label, item.yaw, item.seat) == (
        "t",
        "shape:table",
        5,
        90,
        0.45,
    )
    assert item.z is None and item.scale == (1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({"schema_version": 2}, "here: schema_version: got 2, wanted 1"),
        ({"objects": []}, "here: objects: got [], wanted one of the keys"),
        (
            {"object": [TABLE | {"x": 9.0}]},
            "here: object[0].x: got 9.0, wanted a number from 0 to 4",
        ),
        ({"object": [TABLE | {"x": math.nan}]}, "object[0].x: got nan"),
        (
            {"object": [TABLE, TABLE]},
            "object[1].id: got 't', wanted an id that no other object has",
        ),
        ({"object": [TABLE | {"on": "shelf"}]}, "wanted the id of an object further up"),
        ({"object": [TABLE | {"class": "tabel"}]}, "object[0].class: got 'tabel', wanted one of"),
        ({"object": [TABLE | {"piece": "bed_88"}]}, "object[0].piece: got 'bed_88', wanted either"),
        ({"object": [TABLE | {"colour": [1, 1, 1]}]}, "object[0].colour: got [1, 1, 1]"),
        ({"room": {"name": "cell"}}, "room.size: got None, wanted a list of 3 numbers"),
    ],
)
def test_a_faulty_layout_is_refused_in_one_line_that_names_the_field(changes, wanted):
    with pytest.raises(InputError) as caught:
        parse_layout(document(**changes), "here")
    assert wanted in str(caught.value) and "\n" not in str(caught.value)


def test_an_opening_must_lie_in_its_wall():
    window = {"wall": "e", "kind": "window", "u0": 2.5, "u1": 3.5, "z0": 1.0, "z1": 2.0}
    with pytest.raises(InputError, match=r"opening\[0\].u1: got 3.5, wanted a number from 0 to 3"):
        parse_layout(document(opening=[window]), "here")


def test_an_unknown_room_is_answered_with_the_known_ones():
    with pytest.raises(InputError, match="got 'attic', wanted one of bedroom, booth"):
        read_layout("attic")


def test_broken_toml_is_named(tmp_path: Path):
    broken = tmp_path / "broken.toml"
    broken.write_text("room = {", encoding="utf-8")
    with pytest.raises(InputError, match=r"broken.toml: content: .* wanted valid TOML"):
        read_layout(broken)

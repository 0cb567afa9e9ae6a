from dataclasses import replace

import numpy as np
import pytest

from experiments.scene.furnish import furnish
from experiments.scene.layout import read_layout
from experiments.scene.layout_checks import check_layout
from experiments.scene.rooms import TRAINING_ROOMS
from experiments.scene.variations import mirrored, vary
from renderer.files import InputError

VARIED = [f"{room}_v{seed}" for room in TRAINING_ROOMS for seed in (0, 1)]


@pytest.mark.parametrize("name", VARIED)
def test_a_variation_is_sound_and_differs_from_its_room(name):
    layout, room = read_layout(name), read_layout(name.split("_")[0])
    assert layout.name == name and layout.items != room.items
    report, _ = check_layout(name, layout.size, furnish(layout))
    assert report.faults() == []


def test_a_seed_gives_one_variation():
    office = read_layout("office")
    first, again, other = vary(office, 5), vary(office, 5), vary(office, 6)
    assert first == again and first.items != other.items


def test_mirroring_twice_gives_the_room_back():
    room = read_layout("dining")
    twice = mirrored(mirrored(room))
    assert [opening.wall for opening in twice.openings] == [o.wall for o in room.openings]
    for before, after in zip(room.items, twice.items, strict=True):
        assert replace(after, x=before.x) == replace(before, x=before.x)
        assert after.x == pytest.approx(before.x)


def test_a_mirrored_room_is_its_room_with_x_turned_round():
    room = read_layout("office")
    for one, two in zip(furnish(room), furnish(mirrored(room)), strict=True):
        flipped = two.triangles()[:, ::-1] * [-1, 1, 1] + [room.size[0], 0, 0]
        assert np.allclose(one.triangles(), flipped, atol=2e-3), one.id


def test_a_room_that_is_unsound_cannot_be_varied():
    office = read_layout("office")
    crowded = replace(office, items=tuple(i for i in office.items if i.shape != "swivel")[:20])
    with pytest.raises(InputError, match="wanted a room that passes the checks"):
        vary(crowded, 1)

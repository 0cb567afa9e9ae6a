"""Pictures of a room without anybody in it."""

from __future__ import annotations

import numpy as np

from renderer.cutaway import Cutaway
from renderer.room_picture import room_picture


def drawn(synthetic, parts, azimuth: float = -45.0) -> np.ndarray:
    return room_picture(parts, synthetic.room_size, 0.0, azimuth, 40.0, synthetic.tiny)


def test_a_ceiling_is_never_in_the_picture(synthetic):
    lid = synthetic.part(
        synthetic.grid((0, 0, 2.5), (3.4, 0, 0), (0, 3.0, 0), 4), (1, 0, 0), "ceiling"
    )
    assert (drawn(synthetic, (*synthetic.parts, lid)) == drawn(synthetic, synthetic.parts)).all()


def test_the_picture_repeats_and_other_sides_differ(synthetic):
    first = drawn(synthetic, synthetic.parts)
    assert (drawn(synthetic, synthetic.parts) == first).all()
    assert (drawn(synthetic, synthetic.parts, 135.0) != first).any(axis=-1).mean() > 0.2


def test_furniture_stays_unless_the_wall_it_stands_at_goes(synthetic):
    cutaway = Cutaway.of_room(synthetic.parts, synthetic.room_size, 0.0)
    box = np.array([[0.0, 0.0, 0.0], [3.4, 3.0, 1.6]])
    from_south = cutaway.hidden_before_room(np.array([1.7, -5.0, 4.0]), box)
    from_north = cutaway.hidden_before_room(np.array([1.7, 8.0, 4.0]), box)
    assert from_south == {"wall:s"}
    assert from_north == {"wall:n", "object:wardrobe"}

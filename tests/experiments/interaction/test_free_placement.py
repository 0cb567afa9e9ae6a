"""The second test set: clips placed in rooms that were not built for them."""

from __future__ import annotations

import numpy as np

from experiments.interaction.free_placement import place_freely
from experiments.interaction.pose_pool import PoseClip
from experiments.scene.scene import MPCAT40
from experiments.scene.synthetic import synthetic_room


def pool_clip(motion) -> PoseClip:
    return PoseClip("sit/0", "authored", "test", "sit", "male_slim", motion)


def test_a_sitter_placed_by_geometry_is_labelled_by_what_the_room_has_there(
    sit, seat_room, slim
) -> None:
    told: list[tuple[int, int]] = []
    placed = list(place_freely([pool_clip(sit(60))], [seat_room], 0, lambda *a: told.append(a)))
    assert told == [(1, 1)]
    assert {clip.record.name for clip in placed} == {"sit/0@synthetic"}
    last = placed[0]
    near = last.distance < 0.05
    assert set(np.unique(last.nearest[near])) == {MPCAT40.index("floor"), MPCAT40.index("chair")}
    # Feet stay on the floor in every frame that is kept; the seat carries at the end only.
    on_floor = near & (last.nearest == MPCAT40.index("floor"))
    on_seat = near & (last.nearest == MPCAT40.index("chair"))
    assert on_floor.any(1).all()
    assert on_seat[-1].sum() >= on_seat[0].sum() + 10


def test_heights_and_vertices_are_those_of_the_clip_and_not_of_the_room(sit, seat_room) -> None:
    placed = next(place_freely([pool_clip(sit(60))], [seat_room], 0))
    assert np.abs(placed.height.min(1)).max() < 0.01
    assert np.abs(placed.vertices.astype(np.float64).mean((0, 1))).max() < 0.5


def test_a_clip_that_fits_in_no_room_is_left_out(walk) -> None:
    full = {"block": ((0.0, 0.0, 0.0), (3.0, 3.0, 1.2), "cabinet")}
    blocked = synthetic_room(full, scene_id="blocked")
    assert list(place_freely([pool_clip(walk(0.2, 20))], [blocked], 0)) == []

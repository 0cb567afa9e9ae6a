from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.synthesis.spots import RoomSpots, heading, room_spots
from experiments.synthesis.subgoals import STEP_M, NoSubgoals, at_furniture, choose_subgoals


@pytest.fixture(scope="module")
def spots(seat_room, slim) -> RoomSpots:
    return room_spots(seat_room, slim)


def drawn(spots: RoomSpots, count: int, seed: int):
    return choose_subgoals(spots, count, np.random.default_rng(seed))


@given(count=st.integers(2, 9), seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_furniture_and_free_floor_take_turns_within_reach_of_each_other(spots, count, seed) -> None:
    chosen = drawn(spots, count, seed)
    kinds = [spot.kind for spot in chosen]
    assert len(chosen) == count and kinds[0] == "stand"
    assert (kinds[-1] == "stand") == (count > 2)
    assert [kind != "stand" for kind in kinds] == [at_furniture(i, count) for i in range(count)]
    for first, second in itertools.pairwise(chosen):
        step = np.linalg.norm((second.pelvis - first.pelvis)[:2])
        assert STEP_M[0] < step < STEP_M[1]


@given(seed=st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_who_stands_looks_where_he_goes_and_in_the_end_where_he_went(spots, seed) -> None:
    first, second, last = drawn(spots, 3, seed)
    for spot, way in ((first, second.pelvis - first.pelvis), (last, last.pelvis - second.pelvis)):
        ahead = spot.orientation[:, 2]
        flat = way * [1, 1, 0]
        assert ahead @ flat == pytest.approx(np.linalg.norm(flat))
        assert ahead == pytest.approx(heading(np.arctan2(flat[0], -flat[1])))


def test_the_seed_decides(spots) -> None:
    def places(seed):
        return [tuple(spot.pelvis) for spot in drawn(spots, 4, seed)]

    assert places(3) == places(3)
    assert len({tuple(places(seed)) for seed in range(10)}) == 10


def test_pieces_of_furniture_have_equal_chances_whatever_they_measure(spots) -> None:
    (seat,) = spots.furniture.values()
    both = RoomSpots(spots.free, {("a", "sit"): seat, ("b", "sit"): seat[:1]}, spots.standing_z)
    few = sum(drawn(both, 3, seed)[1] is seat[0] for seed in range(200))
    # Half of the draws choose the piece with one spot: binomial(200, 1/2), five deviations.
    assert 100 - 36 < few < 100 + 40


def test_a_room_that_offers_too_little_says_what(spots, slim, empty_room) -> None:
    with pytest.raises(NoSubgoals, match="affords sitting, lying or touching"):
        drawn(room_spots(empty_room, slim), 3, 0)
    nowhere = RoomSpots(spots.free[:0], spots.furniture, spots.standing_z)
    with pytest.raises(NoSubgoals, match="no free floor"):
        drawn(nowhere, 3, 0)
    (seat,) = spots.furniture.values()
    beside = RoomSpots(seat[0].pelvis[None, :2], spots.furniture, spots.standing_z)
    with pytest.raises(NoSubgoals, match=r"no 3 sub-goals 0\.5 to 2\.5 m apart .* 200 draws"):
        drawn(beside, 3, 0)

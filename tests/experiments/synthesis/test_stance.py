from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from torch.autograd import gradcheck

from experiments.synthesis.stance import (
    LEFT,
    RIGHT,
    UNKNOWN,
    find_stances,
    skating,
    standing_sides,
)


def stepping() -> np.ndarray:
    """The right foot swings until frame 3, nobody until 7, then the left foot."""
    ankles = np.zeros((16, 2, 3))
    ankles[:4, RIGHT, 0] = np.linspace(0, 1, 4)
    ankles[4:, RIGHT, 0] = 1.0
    ankles[8:, LEFT, 0] = np.linspace(0.15, 1.2, 8)
    return ankles


def soles(ankles: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    """Two vertices below the left ankle, three below the right."""
    left = torch.tensor(ankles)[:, LEFT, None] + torch.tensor([[0.0, 0, -0.1], [0, 0.1, -0.1]])
    right = torch.tensor(ankles)[:, RIGHT, None] + torch.tensor([[0.0, 0, -0.1]] * 3)
    return left, right


def test_the_slower_foot_stands_and_a_change_falls_into_the_middle_of_doubt() -> None:
    assert standing_sides(stepping()).tolist() == [LEFT] * 4 + [RIGHT] * 12


def test_feet_that_are_about_equally_fast_tell_nothing() -> None:
    ankles = stepping()
    ankles[:, LEFT] = 0.8 * ankles[:, RIGHT]
    assert (standing_sides(ankles) == UNKNOWN).all()
    assert find_stances(torch.tensor(ankles), soles(ankles)) == ()
    assert float(skating(torch.tensor(ankles), soles(ankles), ())) == 0.0


@given(arrays(np.float64, (12, 2, 3), elements=st.floats(-1, 1, allow_subnormal=False)))
@settings(max_examples=80, deadline=None)
def test_stances_cover_all_frames_once_and_change_feet_every_time(ankles) -> None:
    stances = find_stances(torch.tensor(ankles), soles(ankles))
    frames = [frame for stance in stances for frame in range(stance.start, stance.stop)]
    assert frames in ([], list(range(12)))
    sides = [stance.side for stance in stances]
    assert all(first != second for first, second in itertools.pairwise(sides))
    mirrored = standing_sides(ankles[:, ::-1])
    assert [LEFT + RIGHT - side for side in sides] == [
        stance.side for stance in find_stances(torch.tensor(ankles[:, ::-1].copy()), soles(ankles))
    ]
    assert ((mirrored == UNKNOWN) == (standing_sides(ankles) == UNKNOWN)).all()


def test_feet_that_stay_put_and_swing_high_cost_nothing() -> None:
    ankles = stepping()
    stances = find_stances(torch.tensor(ankles), soles(ankles))
    assert float(skating(torch.tensor(ankles), soles(ankles), stances)) == pytest.approx(0.0)
    # A swinging ankle 0.2 m under the highest of its stance, once in each of two stances.
    raised = [type(stance)(**{**vars(stance), "lift": 0.2}) for stance in stances]
    found = float(skating(torch.tensor(ankles), soles(ankles), tuple(raised)))
    assert found == pytest.approx(2 * 0.05 * 0.2**2)


def test_a_sliding_foot_costs_its_squared_distance_from_where_it_stood() -> None:
    ankles = stepping()
    stances = find_stances(torch.tensor(ankles), soles(ankles))
    slid = ankles.copy()
    slid[2, LEFT, 1] += 0.3
    # One frame, one of three coordinates.
    found = float(skating(torch.tensor(slid), soles(slid), stances))
    assert found == pytest.approx(0.3**2 / 3)


def test_a_foot_is_held_from_one_frame_before_it_stands() -> None:
    ankles = stepping()
    stances = find_stances(torch.tensor(ankles), soles(ankles))
    late = ankles.copy()
    late[3, RIGHT, 0] -= 0.3
    assert float(skating(torch.tensor(late), soles(late), stances)) == pytest.approx(0.3**2 / 3)


def test_the_gradient_of_skating_is_right_and_leaves_the_places_alone() -> None:
    rng = np.random.default_rng(3)
    ankles = stepping()
    stances = find_stances(torch.tensor(ankles), soles(ankles))
    left, right = (torch.tensor(rng.normal(size=(16, n, 3)), requires_grad=True) for n in (2, 3))
    free = torch.tensor(rng.normal(size=(16, 2, 3)), requires_grad=True)
    assert gradcheck(lambda a, le, ri: skating(a, (le, ri), stances), (free, left, right))
    assert not any(stance.place.requires_grad for stance in stances)

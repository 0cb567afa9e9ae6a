from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from experiments.interaction.geometric import geometric_features
from experiments.placement.candidates import (
    Starts,
    class_match,
    coarse_scores,
    exact_scores,
    find_starts,
    rank_starts,
    start_grid,
    suppress,
)
from experiments.placement.errors import MotionTooLong, NoAdmissibleStart
from experiments.placement.problem import build_problem
from experiments.placement.settings import PlacementSettings
from experiments.scene.synthetic import synthetic_room


def walking_problem(walk, slim, scene, metres=1.5, **changes):
    motion = walk(metres)
    features = geometric_features(motion, slim, scene.class_names())[0]
    return build_problem(motion, scene, slim, PlacementSettings(**changes), features)


def test_the_grid_puts_the_clip_floor_on_the_scene_floor(make_problem) -> None:
    problem = make_problem()
    lifted = dataclasses.replace(problem, floor=0.3)
    assert np.unique(start_grid(lifted).translation[:, 2]) == pytest.approx([-0.3])


def test_the_grid_has_every_yaw_at_every_position_where_nothing_can_leave(make_problem) -> None:
    grid = start_grid(make_problem())
    assert len(np.unique(grid.yaw)) == 12
    # 3 m less two insets of 0.35 m, every 0.2 m: 12 positions each way.
    assert len(grid) == 12 * 12 * 12


def test_no_start_takes_a_walker_out_of_the_room(walk, slim, seat_room) -> None:
    problem = walking_problem(walk, slim, seat_room, metres=2.2)
    grid = start_grid(problem)
    for index in range(0, len(grid), 7):
        yaw, shift = grid.yaw[index], grid.translation[index]
        offset = problem.pelvis[:, :2] - problem.centre.numpy()
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        path = offset @ turn.T + problem.centre.numpy() + shift[:2]
        assert path.min() >= 0.15 - 1e-6 and path.max() <= 2.85 + 1e-6


def test_a_motion_longer_than_the_room_says_so(walk, slim, seat_room) -> None:
    problem = walking_problem(walk, slim, seat_room, metres=4.5)
    with pytest.raises(MotionTooLong, match=r"motion walk in scene synthetic: .* 4\.5 m and fits"):
        start_grid(problem)


def test_coarse_scoring_keeps_the_true_best_starts(make_problem) -> None:
    problem = make_problem(20, start_filter=None)
    grid = start_grid(problem)
    exact = exact_scores(problem, grid)
    kept = rank_starts(problem, grid)
    assert kept.score[:5] == pytest.approx(np.sort(exact)[:5], rel=1e-4)
    assert np.corrcoef(np.log(exact), np.log(coarse_scores(problem, grid)))[0, 1] > 0.95


def test_the_filter_keeps_only_starts_that_sit_on_the_chair(make_problem) -> None:
    problem = make_problem()
    starts = find_starts(problem)
    match = class_match(problem, starts)
    assert (match >= 0.5).all()


def test_the_match_counts_seat_and_floor_apart(make_problem) -> None:
    problem = make_problem(coarse_frames=1000)
    grid = start_grid(problem)
    few = grid.take(np.arange(0, len(grid), 97))
    bodies = problem.moved(
        torch.as_tensor(few.yaw).float(), torch.as_tensor(few.translation).float()
    )
    right = problem.field.label(bodies, problem.contact) == problem.wanted
    beyond = problem.beyond_floor()
    seat = right[:, beyond].double().mean(-1)
    floor = right[:, problem.contact & ~beyond].double().mean(-1)
    assert class_match(problem, few) == pytest.approx(torch.minimum(seat, floor).numpy(), abs=1e-6)


def test_a_sitter_finds_no_start_in_a_room_without_seats(sit, slim, empty_room) -> None:
    motion = sit()
    features = geometric_features(motion, slim, empty_room.class_names())[0]
    problem = build_problem(motion, empty_room, slim, PlacementSettings(), features)
    with pytest.raises(NoAdmissibleStart, match="expects to touch"):
        find_starts(problem)


def test_a_walker_never_starts_on_a_table(walk, slim) -> None:
    table = {"table": ((0.6, 0.6, 0.0), (2.4, 2.4, 0.75), "table")}
    room = synthetic_room(table, size=(4.0, 4.0, 2.4), scene_id="table")
    starts = find_starts(walking_problem(walk, slim, room, n_starts=10))
    assert starts.translation[:, 2] == pytest.approx(0.0, abs=0.02)


def test_of_neighbouring_starts_the_best_survives() -> None:
    yaw = np.radians([0.0, 30.0, 90.0, 350.0, 0.0])
    place = np.array([[1.0, 1, 0], [1.2, 1, 0], [1.1, 1, 0], [1.3, 1, 0], [1.5, 1, 0]])
    left = suppress(Starts(yaw, place, np.arange(5.0)), 0.4, 46.0)
    # 30 and 350 degrees are neighbours of 0 within 0.4 m; 90 degrees and 0.5 m away are not.
    assert left.score.tolist() == [0.0, 2.0, 4.0]

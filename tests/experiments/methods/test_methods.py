from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from experiments.methods import METHODS
from experiments.methods.outcome import best_fit, fault
from experiments.methods.preparation import prepare
from experiments.methods.rigid import rigid_fits
from experiments.metrics import plausibility
from experiments.placement.engines import engine_of
from experiments.placement.errors import NoAdmissibleStart, OptimisationFailed
from experiments.placement.features import choose_features
from experiments.placement.placement import read_placement, write_placement
from experiments.placement.problem import build_problem
from experiments.placement.settings import PRESETS
from experiments.placement.solver import fit_altered, fit_rigid
from experiments.scene.synthetic import synthetic_room
from experiments.weighting.weights import FrameWeights
from renderer.files import InputError

FAST = dataclasses.replace(PRESETS["fast"], interaction="geometric")


def test_every_method_puts_the_sitter_on_the_seat(placed, slim, seat_room) -> None:
    motion, placements = placed
    for placement in placements.values():
        scores = plausibility(placement.motion, motion, seat_room, slim, FAST)
        assert scores.semantic_match > 0.9
        assert scores.contact_beyond_floor[-5:].mean() == 1.0


def test_a_rigid_placement_is_the_motion_moved_and_nothing_else(placed, slim, seat_room) -> None:
    motion, placements = placed
    placement = placements["posa_t"]
    scores = plausibility(placement.motion, motion, seat_room, slim, FAST).alteration
    assert not placement.altered
    assert scores.angle_max_deg < 1e-4 and scores.root_shift_mean_cm < 1e-4
    assert np.ptp(placement.weights) == 0.0


def test_the_placed_motion_reproduces_the_recorded_energy(placed, slim, seat_room) -> None:
    motion, placements = placed
    placement = placements["pace"]
    features = choose_features(motion, seat_room, slim, FAST)
    problem = build_problem(placement.motion, seat_room, slim, FAST, features)
    weighted = problem.weighted(FrameWeights(placement.weights, "recorded"))
    terms = engine_of(FAST).terms(weighted, weighted.vertices)
    for name, value in terms.items():
        assert float(value) == pytest.approx(placement.terms[name], rel=2e-3, abs=1e-4)
    assert placement.terms["total"] == pytest.approx(
        sum(value for name, value in placement.terms.items() if name != "total")
    )


def test_altering_never_ends_above_the_rigid_optimum_it_began_at(sit, slim, seat_room) -> None:
    problem = prepare(sit(30), seat_room, slim, FAST, 0)
    rigid = rigid_fits(problem)[0]
    assert fit_altered(problem, rigid).energy <= rigid.energy


def test_fitting_never_ends_above_its_start(sit, slim, seat_room) -> None:
    problem = prepare(sit(30), seat_room, slim, FAST, 0)
    best = rigid_fits(problem)[0]
    again = fit_rigid(problem, best.yaw, best.translation)
    assert again.energy <= best.energy + 1e-6


def test_an_ablation_ends_at_or_below_the_full_method_in_its_own_energy(placed) -> None:
    _, placements = placed
    full = placements["pace"].terms
    for name, dropped in (
        ("pace_no_pose", ["pose"]),
        ("pace_no_motion", ["motion", "translation"]),
    ):
        reached = full["total"] - sum(full[term] for term in dropped)
        assert placements[name].terms["total"] <= reached * 1.01
        assert all(placements[name].terms[term] == 0.0 for term in dropped)


def test_the_same_seed_gives_the_same_placement(sit, slim, seat_room) -> None:
    motion = sit(30)
    first, second = (METHODS["pace"].place(motion, seat_room, slim, FAST, 5) for _ in range(2))
    assert np.array_equal(first.motion.pose, second.motion.pose)
    assert first.terms == second.terms and first.config_hash == second.config_hash


def test_a_placement_survives_its_file(placed, tmp_path) -> None:
    placement = placed[1]["pace"]
    write_placement(placement, tmp_path / "one")
    back = read_placement(tmp_path / "one")
    assert back.info == placement.info and back.terms == placement.terms
    assert back.motion.pose == pytest.approx(placement.motion.pose, abs=1e-6)


def test_a_body_that_can_only_stand_inside_things_is_refused(walk, slim) -> None:
    full = {"block": ((0.0, 0.0, 0.0), (3.0, 3.0, 1.2), "cabinet")}
    room = synthetic_room(full, scene_id="blocked")
    with pytest.raises(
        NoAdmissibleStart,
        match=r"motion walk in scene blocked: no start .* expects to touch \(floor\)",
    ):
        METHODS["posa_t"].place(walk(0.2, 20), room, slim, FAST, 0)


def test_a_fit_deep_inside_something_is_refused(sit, slim, seat_room) -> None:
    problem = prepare(sit(20), seat_room, slim, FAST, 0)
    sound = rigid_fits(problem)[0]
    sunk = dataclasses.replace(sound, translation=sound.translation - np.array([0.0, 0.0, 0.5]))
    assert fault(problem, sound) == ""
    assert "m deep inside something" in fault(problem, sunk)
    with pytest.raises(NoAdmissibleStart, match=r"at its best start the body is 0\.\d+ m deep"):
        best_fit(problem, [sunk])


def test_hands_and_seats_that_hang_in_the_air_are_refused(sit, slim, seat_room) -> None:
    problem = prepare(sit(20), seat_room, slim, FAST, 0)
    sound = rigid_fits(problem)[0]
    above = dataclasses.replace(sound, translation=sound.translation + np.array([0.0, 0.0, 0.3]))
    assert re.match(
        r"stays 3\d cm away from what it expects to touch \(chair\)", fault(problem, above)
    )


def test_energies_that_are_not_finite_are_no_placement(sit, slim, seat_room) -> None:
    problem = prepare(sit(20), seat_room, slim, FAST, 0)
    broken = dataclasses.replace(rigid_fits(problem)[0], terms={"contact": float("nan")})
    with pytest.raises(OptimisationFailed, match="motion sit in scene synthetic: no start reached"):
        best_fit(problem, [broken])


def test_an_unknown_interaction_model_is_refused_by_name(sit, slim, seat_room) -> None:
    settings = dataclasses.replace(FAST, interaction="psychic")
    with pytest.raises(InputError, match="interaction: got 'psychic', wanted one of geometric"):
        METHODS["posa_t"].place(sit(30), seat_room, slim, settings, 0)


def test_the_paper_preset_keeps_the_printed_choices() -> None:
    paper = PRESETS["paper"]
    assert paper.huber_widths == (0.0,) and paper.contact_tolerance is None
    assert paper.start_filter is None and paper.feature_choice == "posa"
    assert (paper.n_starts, paper.outer_steps, paper.inset) == (10, 10, 0.75)

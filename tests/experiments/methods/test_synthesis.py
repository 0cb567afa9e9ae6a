from __future__ import annotations

import dataclasses
import importlib
import json

import numpy as np
import pytest
import torch

from experiments.methods import METHODS
from experiments.methods.synthesis import display_name, slot_seed, synthesise
from experiments.metrics import plausibility
from experiments.placement.errors import OptimisationFailed, PlacementError
from experiments.placement.placement import read_placement, write_placement
from experiments.placement.settings import PRESETS
from experiments.scene.synthetic import synthetic_room
from experiments.synthesis.pose_net import PoseNet
from experiments.synthesis.refinement import Refined
from experiments.synthesis.route_net import RouteNet
from experiments.synthesis.subgoal_net import SubgoalNet
from experiments.synthesis.weights import SynthesisNets, TrainingNote, read_note
from renderer.files import InputError

FAST = PRESETS["fast"]
MODULE = importlib.import_module("experiments.methods.synthesis")


@pytest.fixture(scope="module")
def nets() -> SynthesisNets:
    """Networks as they are before training."""
    torch.manual_seed(2)
    parts = SubgoalNet().eval(), RouteNet().eval(), PoseNet().eval()
    for net in parts:
        net.requires_grad_(False)
    return SynthesisNets(*parts, TrainingNote("test", 2, 1.5), {"subgoal": "untrained"})


@pytest.fixture(scope="module")
def made(nets, walk, seat_room, slim):
    """(slot, placement) of a 3 s slot."""
    slot = walk(1.0, 90)
    return slot, synthesise(nets, slot, seat_room, slim, FAST, 7)


def test_the_answer_fills_the_slot_with_a_motion_of_its_own(made) -> None:
    slot, placement = made
    assert placement.motion_id == placement.motion.motion_id == slot.motion_id
    assert np.array_equal(placement.motion.times, slot.times)
    assert placement.motion.duration_s == slot.duration_s
    assert placement.motion.label == "synthesised" and "1.5" not in placement.motion.label
    assert np.abs(placement.motion.pose - slot.pose).mean() > 0.05


def test_the_record_says_seeds_subgoals_counts_and_minutes(made) -> None:
    info = made[1].info
    assert info["capture_minutes"] == 1.5 and info["training_seed"] == 2
    assert info["seed_of_slot"] == slot_seed(7, "synthetic", "walk")
    assert [goal["before_frame"] for goal in info["subgoals"]] == [0, 60, 120]
    assert [goal["kind"] for goal in info["subgoals"]] == ["stand", "sit", "stand"]
    assert info["segments"] == 2 and info["iterations"] == 70 and info["stopped"] == "done"
    assert (
        info["offers"] == {"sit": pytest.approx(info["offers"]["sit"])} and info["free_cells"] > 0
    )


def test_the_terms_are_those_of_the_last_phase_and_add_up(made) -> None:
    terms = made[1].terms
    assert set(terms) == {"contact", "collision", "motion", "skating", "total"}
    assert terms["total"] == pytest.approx(sum(v for k, v in terms.items() if k != "total"))


def test_nothing_of_the_paired_clip_but_its_slot_is_used(nets, made, sit, seat_room, slim) -> None:
    slot, placement = made
    other = dataclasses.replace(sit(90), motion_id=slot.motion_id)
    again = synthesise(nets, other, seat_room, slim, FAST, 7)
    assert np.array_equal(again.motion.pose, placement.motion.pose)
    assert np.array_equal(again.motion.transl, placement.motion.transl)


def test_another_seed_room_or_slot_draws_another_sequence() -> None:
    seeds = {slot_seed(s, r, m) for s in (1, 2) for r in ("a", "b") for m in ("x", "y")}
    assert len(seeds) == 8 and all(0 <= seed < 2**48 for seed in seeds)


@pytest.mark.parametrize(("frames", "fps"), [(10, 30.0), (200, 120.0), (61, 25.0), (62, 30.0)])
def test_any_length_and_frame_rate_is_filled_exactly(
    nets, walk, seat_room, slim, monkeypatch, frames, fps
) -> None:
    monkeypatch.setattr(MODULE, "refine", _unrefined)
    slot = dataclasses.replace(walk(1.0, frames, fps), times=3.5 + np.arange(frames) / fps)
    found = synthesise(nets, slot, seat_room, slim, FAST, 1).motion
    assert found.fps == fps and np.array_equal(found.times, slot.times)


def test_a_placement_survives_its_file(made, tmp_path) -> None:
    write_placement(made[1], tmp_path / "one")
    back = read_placement(tmp_path / "one")
    assert back.info == json.loads(json.dumps(made[1].info)) and back.method == "synthesis"
    assert back.motion.pose == pytest.approx(made[1].motion.pose, abs=1e-6)


def test_scores_that_compare_with_the_paired_clip_are_left_out(made, seat_room, slim) -> None:
    slot, placement = made
    given = (placement.motion, slot, seat_room, slim, FAST)
    own, shared = plausibility(*given, False).as_dict(), plausibility(*given).as_dict()
    assert set(own) < set(shared)
    assert {"cv2", "semantic_match", "angle_mean_deg", "jerk_change_mm"} <= set(shared) - set(own)
    assert {"non_collision", "contact", "contact_1cm", "foot_skate_cm_s"} <= set(own)
    assert all(own[name] == pytest.approx(shared[name]) for name in own)


def test_a_room_that_offers_nothing_is_a_result_with_its_reason(
    nets, walk, empty_room, slim
) -> None:
    with pytest.raises(PlacementError, match="motion walk in scene empty: nothing in the room"):
        synthesise(nets, walk(1.0, 30), empty_room, slim, FAST, 0)
    full = {"block": ((0.0, 0.0, 0.0), (3.0, 3.0, 1.2), "cabinet")}
    room = synthetic_room(full, scene_id="full")
    with pytest.raises(PlacementError, match="scene full: the room has no free floor"):
        synthesise(nets, walk(1.0, 30), room, slim, FAST, 0)


def test_bodies_that_are_not_finite_are_a_result_too(nets, walk, seat_room, slim) -> None:
    broken = SubgoalNet().requires_grad_(False)
    broken.body_out.bias.fill_(float("nan"))
    with pytest.raises(OptimisationFailed, match="the networks gave a body that is not finite"):
        synthesise(
            dataclasses.replace(nets, subgoal=broken), walk(1.0, 30), seat_room, slim, FAST, 0
        )


def test_the_registry_marks_a_method_that_does_not_share_the_motion() -> None:
    alone = [name for name, method in METHODS.items() if not method.shares_motion]
    assert alone == ["synthesis"] and METHODS["synthesis"].study


def test_the_name_says_how_much_capture_it_learned_from(monkeypatch, tmp_path) -> None:
    assert METHODS["synthesis"].display_name == display_name()
    monkeypatch.setattr(MODULE, "weights_file", lambda kind: tmp_path / kind)
    assert display_name() == "Motion synthesis (re-implemented, untrained)"
    with pytest.raises(InputError, match="subgoal: file: got 'missing'"):
        read_note(tmp_path / "subgoal")


def _unrefined(vectors, ends, body, scene):
    terms = dict.fromkeys(("contact", "collision", "motion", "skating"), 0.0)
    return Refined(vectors, terms, 0, (), "done")

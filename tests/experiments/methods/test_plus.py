from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from experiments.alteration import foot_skate, joint_jerk
from experiments.methods import METHODS
from experiments.methods.plus import plus_settings
from experiments.metrics import plausibility
from experiments.placement.settings import PRESETS
from experiments.scene.synthetic import synthetic_room

FAST, PAPER = PRESETS["fast"], PRESETS["paper"]


def test_the_three_blocks_are_told_apart() -> None:
    blocks = {name: method.block for name, method in METHODS.items()}
    assert {name for name, block in blocks.items() if block == "plus"} == {
        "posa_t_plus", "paak_plus", "pace_plus"
    }  # fmt: skip
    assert not any(method.study for method in METHODS.values() if method.block != "paper")


def test_nothing_of_ours_enters_the_printed_energy_of_pace(placed) -> None:
    terms = placed[1]["pace"].terms
    assert set(terms) == {
        "contact", "penetration", "semantics", "pose", "motion", "translation", "total"
    }  # fmt: skip
    for preset in PRESETS.values():
        assert preset.contact_tolerance is None
        assert preset.slide_weight == preset.bend_weight == 0.0


def test_methods_of_the_plus_block_share_their_scene_terms() -> None:
    for preset in (FAST, PAPER):
        plus = plus_settings(preset)
        assert plus.contact_tolerance == 0.003
        assert plus.start_filter == 0.75 and plus.bone_clearance == 0.015
        changed = {
            item.name
            for item in dataclasses.fields(plus)
            if getattr(plus, item.name) != getattr(preset, item.name)
        }
        assert changed <= {
            "contact_tolerance", "slide_weight", "bend_weight", "start_filter", "max_depth",
            "max_gap", "bone_clearance",
        }  # fmt: skip


def test_contacts_of_the_plus_block_sink_in_less(placed, slim, seat_room) -> None:
    motion, placements = placed
    score = {
        name: plausibility(placements[name].motion, motion, seat_room, slim, FAST).as_dict()
        for name in ("posa_t", "posa_t_plus", "pace", "pace_plus")
    }
    for name in ("posa_t", "pace"):
        assert score[f"{name}_plus"]["non_collision"] >= score[name]["non_collision"]
        assert score[f"{name}_plus"]["depth_sum_m"] <= score[name]["depth_sum_m"]


def test_pace_plus_holds_the_feet_and_does_not_tremble(sit, slim) -> None:
    motion = sit(45)
    seat = _seat_height(motion, slim) - 0.06
    room = synthetic_room({"seat": ((1.1, 1.5, 0.0), (1.9, 2.1, seat), "chair")}, scene_id="low")
    pace, plus = (
        METHODS[name].place(motion, room, slim, FAST, 0).motion for name in ("pace", "pace_plus")
    )
    assert foot_skate(pace, slim) > 1.0
    assert foot_skate(plus, slim) < 0.3 * foot_skate(pace, slim)
    before = joint_jerk(motion, slim)
    assert joint_jerk(plus, slim) - before < 0.5 * (joint_jerk(pace, slim) - before)


def _seat_height(motion, body) -> float:
    columns = np.union1d(body.regions["buttocks"], body.regions["thigh_backs"])
    pose, transl = torch.as_tensor(motion.pose[-1:]), torch.as_tensor(motion.transl[-1:])
    return float(body.posed(pose, transl, columns).vertices[..., 2].min())


@pytest.mark.slow
@pytest.mark.parametrize("room", ["bedroom", "booth"])
def test_a_walk_under_pace_plus_slides_and_trembles_no_more_than_before(slim, room: str) -> None:
    from experiments.motion.library import load_motion, trim
    from experiments.scene.baking import load_room

    motion, scene = trim(load_motion("walk_turn_right"), 4.0), load_room(room)
    by_rule = dataclasses.replace(FAST, interaction="geometric")
    placement = METHODS["pace_plus"].place(motion, scene, slim, by_rule, 0)
    scores = plausibility(placement.motion, motion, scene, slim, by_rule).as_dict()
    assert scores["foot_skate_cm_s"] <= scores["foot_skate_before_cm_s"] + 1.0
    assert scores["jerk_change_mm"] <= 0.1
    assert scores["contact"] >= 0.9 and scores["non_collision"] >= 0.99

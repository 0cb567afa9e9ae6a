"""The comparison of methods: means, paired differences, what is kept, and the tables made of it."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import bootstrap

from experiments.comparison import (
    PUBLISHED,
    by_class,
    compare,
    kept_rows,
    means,
    optimiser_states,
    paired,
    pooled,
)
from experiments.comparison_table import (
    collision_sentence,
    comparison_markdown,
    plus_sentence,
)
from experiments.config import PlacementConfig, StimulusSetConfig
from experiments.evaluate import (
    compared,
    full_config,
    plausibility_table,
    read_evaluation,
    write_evaluation,
)
from experiments.records import SetFolder
from renderer.files import InputError, write_json

CONFIG = StimulusSetConfig(
    set_id="small", seed=4, scenes=("living", "booth"), motions=("walk", "sit", "lie"),
    methods=("posa_t", "pace", "pace_no_pose", "pace_plus"), study_methods=("posa_t", "pace"),
)  # fmt: skip


def _row(method: str, failure: str = "", **scores: float) -> dict[str, Any]:
    return {"scene": "living", "motion": "walk", "method": method, "failure": failure,
            "scores": scores}  # fmt: skip


@pytest.fixture
def rows() -> list[dict[str, Any]]:
    """Two rooms, three motions, four methods; sit in booth has no place for PACE."""
    generator = np.random.default_rng(7)
    found = []
    for scene in CONFIG.scenes:
        for motion in CONFIG.motions:
            for index, method in enumerate(CONFIG.methods):
                scores = {
                    "non_collision": float(generator.uniform(0.96, 1.0)),
                    "contact": 0.5 + 0.1 * index + float(generator.uniform(0, 0.1)),
                    "contact_1cm": 0.9,
                    "deeper_1cm": 0.001,
                    "frames_with_prediction": 0.8,
                }
                failed = method == "pace" and (scene, motion) == ("booth", "sit")
                found.append(
                    {
                        "scene": scene, "motion": motion, "method": method,
                        "study_method": method in CONFIG.study_methods, "extra": False,
                        "failure": "no place" if failed else "", "motion_class": motion,
                        "scores": {} if failed else scores,
                        "n_frames": 60 if motion == "walk" else 120, "sdf_cell_m": 0.025,
                        "info": {"optimiser": "reached"} if method == "pace_no_pose" else {},
                    }
                )  # fmt: skip
    return found


@pytest.fixture
def folder(rows: list[dict[str, Any]], tmp_path: Path) -> SetFolder:
    found = SetFolder(tmp_path)
    for row in rows:
        write_json(found.record_path(row["scene"], row["motion"], row["method"]), row)
    return found


def test_means_run_over_clips_and_leave_failures_out() -> None:
    rows = [_row("pace", contact=1.0), _row("pace", contact=0.5), _row("pace", failure="too long")]
    assert means(rows) == {"contact": 0.75}


def test_a_score_that_some_clips_lack_is_the_mean_of_the_others() -> None:
    assert means([_row("pace", cv2=0.4), _row("pace")])["cv2"] == 0.4


def test_the_jerk_ratio_is_that_of_the_means_not_the_mean_of_ratios() -> None:
    still = {"jerk_before_mm": 0.1, "jerk_change_mm": 0.9, "jerk_ratio": 10.0}
    lively = {"jerk_before_mm": 1.9, "jerk_change_mm": 0.1, "jerk_ratio": 2.0 / 1.9}
    assert means([_row("pace", **still), _row("pace", **lively)])["jerk_ratio"] == pytest.approx(
        1.5
    )


def test_a_case_that_one_study_method_missed_counts_for_none(rows) -> None:
    kept = kept_rows(rows)
    assert {(row["scene"], row["motion"]) for row in rows} - {
        (row["scene"], row["motion"]) for row in kept
    } == {("booth", "sit")}
    described = compare(kept, CONFIG.methods, 1)
    assert [described[name]["clips"] for name in CONFIG.methods] == [5, 5, 5, 5]


def test_an_ablation_that_found_no_place_drops_nothing(rows) -> None:
    for row in rows:
        row["failure"] = "no place" if row["method"] == "pace_no_pose" else row["failure"]
    described = compare(kept_rows(rows), CONFIG.methods, 1)
    assert (described["pace_no_pose"]["clips"], described["pace_no_pose"]["failures"]) == (0, 5)
    assert described["posa_t"]["clips"] == 5


def test_paired_differences_have_the_interval_of_scipy(rows) -> None:
    # Every motion in both rooms: clusters of two, so the mean of cluster means is the mean.
    complete = [row for row in rows if row["motion"] != "sit"] + [
        {**row, "motion": "sit", "failure": "", "scores": {"contact": 0.1 * index}}
        for index, row in enumerate(rows[:8])
    ]
    value = {(r["scene"], r["motion"], r["method"]): r["scores"].get("contact") for r in complete}
    differences = [
        np.mean([value[s, m, "posa_t"] - value[s, m, "pace"] for s in ("living", "booth")])
        for m in ("lie", "walk")
    ]
    found = paired([r for r in complete if r["motion"] != "sit"], "posa_t", "pace", 9)["contact"]
    expected = bootstrap(
        (np.array(differences),), np.mean, n_resamples=9999, method="percentile",
        rng=np.random.default_rng(9),
    ).confidence_interval  # fmt: skip
    assert found["mean"] == pytest.approx(np.mean(differences))
    assert (found["low"], found["high"]) == pytest.approx((expected.low, expected.high))
    assert (found["clips"], found["motions"]) == (4, 2)


def test_methods_are_compared_with_the_one_they_share_their_terms_with(rows) -> None:
    described = compare(kept_rows(rows), CONFIG.methods, 1)
    assert {name: item["reference"] for name, item in described.items()} == {
        "posa_t": "pace", "pace": None, "pace_no_pose": "pace", "pace_plus": None,
    }  # fmt: skip
    assert described["posa_t"]["difference"]["contact"]["mean"] == pytest.approx(
        described["posa_t"]["contact"] - described["pace"]["contact"]
    )


def test_pooled_scores_weigh_clips_by_their_frames(rows) -> None:
    own = [row for row in rows if row["method"] == "posa_t"]
    walks, others = ([r for r in own if (r["motion"] == "walk") is w] for w in (True, False))
    total = 60 * sum(r["scores"]["contact"] for r in walks) + 120 * sum(
        r["scores"]["contact"] for r in others
    )
    assert pooled(own)["contact"] == pytest.approx(total / (2 * 60 + 4 * 120))


def test_classes_of_motion_stand_apart(rows) -> None:
    found = by_class([row for row in rows if row["method"] == "pace"])
    assert {name: item["clips"] for name, item in found.items()} == {"lie": 2, "sit": 1, "walk": 2}


def test_optimiser_states_are_counted() -> None:
    rows = [{"info": {"optimiser": state}} for state in ("reached", "failed", "failed")]
    assert optimiser_states([*rows, {"info": {}}, {}]) == {"reached": 1, "failed": 2}


def test_a_method_without_any_clip_prints_dashes_and_no_nan() -> None:
    described = compare([_row("posa_t", failure="no place")], ("posa_t",), 0)
    table = plausibility_table({"methods": described})
    line = next(row for row in table.splitlines() if row.startswith("POSA-T"))
    assert line.split()[:2] == ["POSA-T", "0"]
    assert set(line.split()[2:]) == {"-"}


def test_the_evaluation_file_holds_rows_drops_conditions_and_comparison(folder) -> None:
    write_evaluation(CONFIG, folder)
    found = read_evaluation(folder.path)
    assert found["cases"] == {"all": 6, "kept": 5}
    assert [(d["scene"], d["motion"], d["method"]) for d in found["dropped"]] == [
        ("booth", "sit", "pace")
    ]
    assert found["conditions"]["sdf_cell_m"] == [0.025]
    assert found["methods"]["pace"]["published"] == PUBLISHED["pace"]
    assert len(found["rows"]) == 24


def test_the_page_sets_our_table_beside_the_published_one(folder) -> None:
    page = comparison_markdown(compared(CONFIG, folder))
    heads, pace = (
        next(line for line in page.splitlines() if line.startswith(start))
        for start in ("| method | clips | non-collision | contact | non", "| PACE | 5")
    )
    assert "(published, PROX)" in heads
    assert pace.endswith("| 0.996 | 0.929 |")
    assert re.search(r"\| PACE \| 5 \| 0\.\d{4} \[0\.\d{3}, [01]\.\d{3}\]", pace)
    assert "cells of 2.5 cm" in page and "5 of 6 (scene, motion)" in page
    assert "| booth | sit | pace | no place |" in page


def test_a_room_without_classes_is_named_with_its_reason(folder, rows) -> None:
    assert "No semantic term" not in comparison_markdown(compared(CONFIG, folder))
    row = dict(rows[0], info={"semantics_off": "no object of the scene has a label"})
    write_json(folder.record_path(row["scene"], row["motion"], row["method"]), row)
    page = comparison_markdown(compared(CONFIG, folder))
    assert "No semantic term in living (no object of the scene has a label)." in page


def test_ablations_stand_with_their_predicted_frames_and_their_optimiser(folder, rows) -> None:
    for row in rows[:4]:
        if row["method"] == "pace_no_pose":
            row["info"]["optimiser"] = "failed"
            write_json(folder.record_path(row["scene"], row["motion"], row["method"]), row)
    page = comparison_markdown(compared(CONFIG, folder))
    line = next(row for row in page.splitlines() if row.startswith("| PACE without pose term | 5"))
    assert "| 0.800 | optimiser failed in 1 of 5 | 0.995 | 0.610 |" in line


def test_the_plus_block_stands_apart_from_the_paper(folder) -> None:
    page = comparison_markdown(compared(CONFIG, folder))
    plus = page.index("## With the scene terms of ours (plus)")
    strict = [m.start() for m in re.finditer(r"\| PACE\+ \(ours\) \| 5 \|", page)]
    assert strict and min(strict) > plus


def _methods(posa_t: dict[str, float], pace: dict[str, float]) -> dict[str, Any]:
    named = {
        "posa_t": {"display_name": "POSA-T", **posa_t},
        "pace": {"display_name": "PACE", **pace},
    }
    return {name: {"clips": 3, **scores} for name, scores in named.items()}


def test_the_sentence_tells_vertices_astride_the_surface_from_bodies_inside_things() -> None:
    rigid = {"non_collision": 0.99, "deeper_1cm": 0.001, "contact_1cm": 0.5}
    astride = {"non_collision": 0.98, "deeper_1cm": 0.002, "contact_1cm": 1.0}
    inside = {"non_collision": 0.98, "deeper_1cm": 0.010, "contact_1cm": 1.0}
    above = {"non_collision": 0.995, "deeper_1cm": 0.0, "contact_1cm": 1.0}
    assert "rewards floating" in collision_sentence(_methods(rigid, astride))
    assert "0.0090 are vertices less than 1 cm deep" in collision_sentence(_methods(rigid, astride))
    assert "deeper inside things" in collision_sentence(_methods(rigid, inside))
    assert "is not lower" in collision_sentence(_methods(rigid, above))


def test_a_plus_method_that_misses_is_reported_as_a_miss() -> None:
    methods = _methods(
        {"non_collision": 0.97, "contact": 0.8}, {"non_collision": 0.98, "contact": 1.0}
    )
    methods["pace_plus"] = {"clips": 3, "non_collision": 0.96, "contact": 0.9}
    found = plus_sentence(methods)
    assert "contact 0.900 is above 0.800" in found
    assert "non-collision 0.9600 is BELOW 0.9700" in found


def test_the_fuller_preset_is_for_the_first_motions_and_every_method() -> None:
    assert full_config(CONFIG) is None
    asked = dataclasses.replace(
        CONFIG, placement=PlacementConfig("fast", full_preset="paper", full_motions=2)
    )
    fuller = full_config(asked)
    assert fuller is not None
    assert (fuller.motions, fuller.methods) == (("walk", "sit"), CONFIG.methods)
    assert fuller.placement.preset == "paper" and full_config(fuller) is None


def test_another_schema_version_is_refused(tmp_path: Path) -> None:
    write_json(tmp_path / "evaluation.json", {"schema_version": 99})
    with pytest.raises(InputError, match="schema_version"):
        read_evaluation(tmp_path)

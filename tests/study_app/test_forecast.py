"""A study file's design reaches the planner as it stands."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from analysis.planner import forecast
from renderer.files import InputError
from study_app.config import read_study
from study_app.forecast import study_plan

STUDY = """
study_id = "paper"
title = "t"
question = "q"
target = "pace"
baselines = ["posa_t", "paak", "synthesis"]
pairs = "target"
scenes = ["a", "b", "c", "d"]
trials_per_cell = 5
policy = "balanced"
layout = "auto"
seed = 1
"""


@pytest.fixture()
def paper(tmp_path: Path) -> Path:
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    return path


def test_the_papers_design_is_three_comparisons_of_twenty_answers_each(paper: Path) -> None:
    plan = study_plan(read_study(paper), 100, 42, 0.6, 0.0, paper)
    assert (len(plan.rates), plan.answers, plan.pool, plan.participants) == (3, 20, 400, 42)


def test_more_participants_give_narrower_intervals(paper: Path) -> None:
    plan = study_plan(read_study(paper), 100, 12, 0.6, 0.0, paper)
    few = forecast(plan, 40, seed=1)
    many = forecast(dataclasses.replace(plan, participants=84), 40, seed=1)
    assert max(many.width) < 0.6 * min(few.width)


def test_a_design_with_too_few_motions_is_refused_with_the_number_needed(paper: Path) -> None:
    with pytest.raises(InputError, match="at least 15 a scene"):
        study_plan(read_study(paper), 5, 42, 0.6, 0.0, paper)

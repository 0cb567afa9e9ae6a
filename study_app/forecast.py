"""What a study of this design can show: power and interval width before anybody is asked.

The design of the study file is handed to the planner of the analysis, which simulates answers and
runs the report's own estimator on them.
"""

from __future__ import annotations

from analysis.planner import Plan, check_plan
from study_app import design
from study_app.balance import design_of
from study_app.config import StudyConfig


def study_plan(
    config: StudyConfig,
    motions: int,
    participants: int,
    rate: float,
    dropout: float,
    source: object,
) -> Plan:
    """The plan of a study file: every method pair is a comparison with the same true rate.

    `motions` is the number of motions in every scene. Raises `InputError` for a design that shows
    a person the same stimulus twice: the planner draws every stimulus of a person once.
    """
    layout = design_of(config, motions, source)
    comparisons = len(design.method_pairs(config.target, config.baselines, config.pairs))
    scenes = len(layout.cells) // comparisons
    plan = Plan(
        rates=(rate,) * comparisons,
        participants=participants,
        answers=scenes * layout.trials_per_cell,
        pool=scenes * motions,
        dropout=dropout,
    )
    check_plan(plan, source)
    return plan

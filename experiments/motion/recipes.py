"""Recipes: how each default motion is put together, as a function of the body."""

from __future__ import annotations

from experiments.motion.figure import Figure
from experiments.motion.gait import MIRRORED_WALK, TURN_LEFT, TURN_RIGHT, WALK, gait, walk_within
from experiments.motion.motion import Motion
from experiments.motion.perform import perform
from experiments.motion.phrases_sit import CHAIR, sit_and_look, sit_down, stand_up
from experiments.motion.phrases_stand import lean_on_table, look_about, reach_for, shift_weight
from experiments.motion.score import Score


def walk_straight(figure: Figure) -> Motion:
    """Stand, walk, stop."""
    return _walk_and_stop(figure, WALK * 3, 11)


def walk_turn_right(figure: Figure) -> Motion:
    """Walk, a quarter turn to the right, walk, stop."""
    return _walk_and_stop(figure, (*WALK, TURN_RIGHT, *WALK), 12)


def walk_turn_left(figure: Figure) -> Motion:
    """The same to the left: mirrored steps."""
    return _walk_and_stop(figure, (*MIRRORED_WALK, TURN_LEFT, *MIRRORED_WALK), 13)


def walk_turn_sit(figure: Figure) -> Motion:
    """Walk, turn, sit down and stay."""
    score = Score(figure)
    score.wait(1.2)
    sit_down(score, CHAIR)
    sit_and_look(score, 3.0)
    return walk_within(perform(score, "", 14), gait(figure, (*WALK, TURN_RIGHT)), figure, 0.6)


def sit_stay_stand(figure: Figure) -> Motion:
    """Sit down on a chair, a glance aside, stand up."""
    score = Score(figure)
    score.wait(0.6)
    sit_down(score, CHAIR)
    sit_and_look(score, 3.4)
    stand_up(score)
    score.wait(0.6)
    return perform(score, "", 21)


def reach_forward(figure: Figure) -> Motion:
    """Reach to a shelf in front and come back."""
    score = Score(figure)
    score.wait(0.6)
    reach_for(score, 1.40, 0.66, 1.1)
    score.wait(0.8)
    return perform(score, "", 31)


def lean_table(figure: Figure) -> Motion:
    """Lean on a table top, look about, push off."""
    score = Score(figure)
    score.wait(0.6)
    lean_on_table(score, 0.75, 2.6)
    score.wait(0.5)
    return perform(score, "", 32)


def stand_idle_look(figure: Figure) -> Motion:
    """Stand at ease, shift the weight, look about."""
    score = Score(figure)
    shift_weight(score, 0.4, 1.0)
    look_about(score, 5.2)
    shift_weight(score, 0.0, -1.0)
    score.wait(2.4)
    return perform(score, "", 33)


def _walk_and_stop(figure: Figure, clips: tuple[str, ...], seed: int) -> Motion:
    score = Score(figure)
    score.wait(2.0)
    return walk_within(perform(score, "", seed), gait(figure, clips), figure, 0.7)

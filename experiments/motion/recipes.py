"""Recipes: how each default motion is put together, as a function of the body."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from experiments.motion.amc import read_amc
from experiments.motion.cleanup import clean_recording
from experiments.motion.compose import join
from experiments.motion.deepmimic import pybullet_clip, read_deepmimic
from experiments.motion.figure import Figure
from experiments.motion.gait import (
    MIRRORED_WALK,
    STEP_LEFT,
    TURN_LEFT,
    TURN_RIGHT,
    WALK,
    gait,
    walk_within,
)
from experiments.motion.ground import rest_on_floor
from experiments.motion.importing import adapt
from experiments.motion.motion import Motion
from experiments.motion.perform import perform
from experiments.motion.phrases_lie import get_up, lie_down, rest
from experiments.motion.phrases_sit import (
    BED,
    CHAIR,
    SOFA,
    be_seated,
    gather_hands,
    lean_back,
    sit_and_look,
    sit_down,
    stand_up,
    work_at_table,
)
from experiments.motion.phrases_stand import (
    lean_on_table,
    look_about,
    pick_up,
    reach_for,
    shift_weight,
)
from experiments.motion.phrases_step import step, turn_to
from experiments.motion.resample import low_pass, resample, window
from experiments.motion.retarget import retarget
from experiments.motion.score import Score

FLOOR_GET_UP = "humanoid3d_getup_facedown"
_UNHURRIED = 1.25


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


def sofa_sit(figure: Figure) -> Motion:
    """Sit down on a sofa, lean back, look about, stand up."""
    score = Score(figure)
    score.wait(0.5)
    sit_down(score, SOFA)
    lean_back(score, SOFA, 4.6)
    gather_hands(score)
    stand_up(score)
    score.wait(0.5)
    return perform(score, "", 22)


def sit_work(figure: Figure) -> Motion:
    """Sit at a table, type, look up, sit back."""
    score = Score(figure)
    be_seated(score, CHAIR)
    score.wait(0.4)
    work_at_table(score, 0.73, 8.2, np.random.default_rng(23))
    score.wait(0.6)
    return perform(score, "", 23)


def lie_down_on_bed(figure: Figure) -> Motion:
    """Sit down on the edge of a bed, lie down, rest."""
    score = Score(figure)
    score.wait(0.4)
    sit_down(score, BED)
    lie_down(score, BED)
    rest(score, 3.0)
    return perform(score, "", 24)


def rest_and_get_up(figure: Figure) -> Motion:
    """Rest on a bed, get up to its edge, stand up."""
    score = Score(figure)
    sit_down(score, BED)
    lie_down(score, BED)
    start = score.beat + 0.4
    rest(score, 2.4)
    get_up(score, BED)
    sit_and_look(score, 1.4, -1.0)
    stand_up(score)
    score.wait(0.5)
    whole = perform(score, "", 25)
    return window(whole, round(start * whole.fps), whole.n_frames)


def bend_pick(figure: Figure) -> Motion:
    """Pick something up from low down, look at it."""
    score = Score(figure)
    score.wait(0.5)
    pick_up(score, 0.22)
    score.wait(0.5)
    return perform(score, "", 34)


def reach_high(figure: Figure) -> Motion:
    """Reach for a high shelf on tiptoe."""
    score = Score(figure)
    score.wait(0.6)
    reach_for(score, figure.shoulder_height + 0.43, 0.52, 1.0, "left", tiptoe=16.0)
    score.wait(0.7)
    return perform(score, "", 35)


def step_aside(figure: Figure) -> Motion:
    """Two steps to the left to make way, look at who passes, two steps back."""
    score = Score(figure)
    score.wait(0.4)
    score.put("gaze", (0.4, (6.0, -24.0)), (1.2, (8.0, -20.0)))
    step(score, "left", (0.46, 0.05), 14.0)
    step(score, "right", (0.25, 0.05), -4.0)
    look_about(score, 2.6, -1.0)
    turn_to(score, 0.0, 0.8)
    step(score, "right", (-0.14, 0.0), -8.0)
    step(score, "left", (0.07, 0.01), 9.0)
    score.wait(0.8)
    return perform(score, "", 36)


def walk_around(figure: Figure) -> Motion:
    """Walk up to something, round it to the right, and on."""
    clips = (*WALK, TURN_RIGHT, STEP_LEFT, TURN_LEFT, *MIRRORED_WALK)
    return _walk_and_stop(figure, clips, 15)


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


def floor_get_up(figure: Figure) -> Motion:
    """Push up from lying on the floor, get up, stand and look about."""
    score = Score(figure)
    score.wait(0.4)
    look_about(score, 3.0)
    standing = perform(score, "", 41)
    recorded = low_pass(retarget(read_deepmimic(pybullet_clip(FLOOR_GET_UP)), figure))
    # The performer springs up; at four fifths of the pace it is an everyday movement.
    rising = resample(dataclasses.replace(recorded, times=recorded.times * _UNHURRIED))
    return rest_on_floor(join(rising, standing, figure, 10, 18), figure)


def recorded(path: Path, seconds: tuple[float, float], figure: Figure) -> Motion:
    """A part of a CMU recording, cleaned."""
    motion = adapt(read_amc(path), figure)
    start, stop = (round(time * motion.fps) for time in seconds)
    return clean_recording(window(motion, start, min(stop, motion.n_frames)), figure)

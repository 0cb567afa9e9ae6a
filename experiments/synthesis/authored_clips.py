"""Clips for training that are made, not recorded: seats, beds, shelves and tables of random measures,
and walks strung together from the few recorded steps that every installation has.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from experiments.motion.figure import Figure
from experiments.motion.gait import STEP_LEFT, STEP_RIGHT, TURN_LEFT, TURN_RIGHT, gait, walk_within
from experiments.motion.motion import Motion
from experiments.motion.perform import perform
from experiments.motion.phrases_lie import get_up, lie_down, rest
from experiments.motion.phrases_sit import (
    BED,
    CHAIR,
    SOFA,
    Seat,
    gather_hands,
    lean_back,
    sit_and_look,
    sit_down,
    stand_up,
)
from experiments.motion.phrases_stand import lean_on_table, look_about, pick_up, reach_for
from experiments.motion.score import Score

Build = Callable[[Figure], Motion]


def walk_clip(rng: np.random.Generator) -> Build:
    """A walk of three to seven recorded steps and turns in random order, from standing to standing."""
    steps, seed = _steps(rng, int(rng.integers(3, 8))), int(rng.integers(1 << 30))

    def build(figure: Figure) -> Motion:
        score = Score(figure)
        score.wait(1.6)
        return walk_within(perform(score, "walk", seed), gait(figure, steps), figure, 0.6)

    return build


def seat_clip(rng: np.random.Generator) -> Build:
    """Walk up or stand, sit down on a chair or sofa of random height, look about, stand up."""
    sofa = bool(rng.random() < 0.4)
    seat = _seat(SOFA if sofa else CHAIR, (0.39, 0.47) if sofa else (0.42, 0.51), rng)
    stay, side = float(rng.uniform(2.0, 3.4)), float(rng.choice((-1.0, 1.0)))
    steps = _steps(rng, int(rng.integers(2, 5))) if rng.random() < 0.5 else ()
    seed = int(rng.integers(1 << 30))

    def build(figure: Figure) -> Motion:
        score = Score(figure)
        score.wait(1.2)
        sit_down(score, seat)
        if sofa:
            lean_back(score, seat, stay + 1.5, side)
            gather_hands(score)
        else:
            sit_and_look(score, stay, side)
        stand_up(score)
        score.wait(0.5)
        seated = perform(score, "sit", seed)
        return walk_within(seated, gait(figure, steps), figure, 0.6) if steps else seated

    return build


def bed_clip(rng: np.random.Generator) -> Build:
    """Sit down on a bed of random height, lie down, rest, get up."""
    seat = _seat(BED, (0.44, 0.58), rng)
    stay, seed = float(rng.uniform(1.5, 2.5)), int(rng.integers(1 << 30))

    def build(figure: Figure) -> Motion:
        score = Score(figure)
        score.wait(0.5)
        sit_down(score, seat)
        lie_down(score, seat)
        rest(score, stay)
        get_up(score, seat)
        stand_up(score)
        score.wait(0.4)
        return perform(score, "lie", seed)

    return build


def touch_clip(rng: np.random.Generator) -> Build:
    """Reach to a shelf, lean on a table or pick something up, at random heights; sometimes walk first."""
    kind = int(rng.choice(3, p=(0.45, 0.4, 0.15)))
    height = float(rng.uniform(*((0.9, 1.6), (0.68, 0.82), (0.15, 0.45))[kind]))
    distance, hold = float(rng.uniform(0.5, 0.66)), float(rng.uniform(0.8, 2.0))
    hand = str(rng.choice(("left", "right")))
    steps = _steps(rng, int(rng.integers(2, 5))) if rng.random() < 0.4 else ()
    seed = int(rng.integers(1 << 30))

    def build(figure: Figure) -> Motion:
        score = Score(figure)
        score.wait(1.2)
        if kind == 0:
            reach_for(score, height, distance, hold, hand)
        elif kind == 1:
            lean_on_table(score, height, hold)
        else:
            pick_up(score, height, hand)
        score.wait(0.4)
        still = perform(score, ("reach", "lean", "pick up")[kind], seed)
        return walk_within(still, gait(figure, steps), figure, 0.6) if steps else still

    return build


def idle_clip(rng: np.random.Generator) -> Build:
    """Stand and look about."""
    seconds, side = float(rng.uniform(2.5, 4.0)), float(rng.choice((-1.0, 1.0)))
    seed = int(rng.integers(1 << 30))

    def build(figure: Figure) -> Motion:
        score = Score(figure)
        look_about(score, seconds, side)
        return perform(score, "stand", seed)

    return build


def _seat(seat: Seat, heights: tuple[float, float], rng: np.random.Generator) -> Seat:
    return dataclasses.replace(
        seat,
        height=float(rng.uniform(*heights)),
        feet_forward=seat.feet_forward + float(rng.uniform(-0.02, 0.06)),
        recline=seat.recline + float(rng.uniform(-4.0, 4.0)),
        slump=seat.slump + float(rng.uniform(-4.0, 4.0)),
    )


def _steps(rng: np.random.Generator, count: int) -> tuple[str, ...]:
    """Clip names whose feet alternate: a turn takes two steps and ends on the foot it began with."""
    steps: list[str] = []
    left = bool(rng.random() < 0.5)
    while len(steps) < count or len(steps) < 2:
        if rng.random() < 0.3:
            steps.append(TURN_RIGHT if left else TURN_LEFT)
        else:
            steps.append(STEP_LEFT if left else STEP_RIGHT)
            left = not left
    return tuple(steps)

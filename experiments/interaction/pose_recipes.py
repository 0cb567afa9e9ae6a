"""Authored clips with random parameters: the postures that few recordings show.

Every family is a function of a body and a generator; the generator decides heights, distances, sides
and timing, so that one family gives as many clips as wanted.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from experiments.motion.capture import INDEX
from experiments.motion.figure import SIDES, Figure
from experiments.motion.gait import MIRRORED_WALK, TURN_LEFT, TURN_RIGHT, WALK, gait, walk_within
from experiments.motion.ground import rest_on_floor
from experiments.motion.motion import Motion
from experiments.motion.perform import perform
from experiments.motion.phrases_lie import get_up, lie_down, rest
from experiments.motion.phrases_sit import (
    Seat,
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
from experiments.motion.phrases_step import step
from experiments.motion.resample import window
from experiments.motion.rotations import about, to_axis_angle, to_matrix
from experiments.motion.score import Score

Recipe = Callable[[Figure, np.random.Generator], Motion]


def sit_thighs(figure: Figure, rng: np.random.Generator) -> Motion:
    """Sit down, hands on the thighs, look about, mostly stand up again."""
    score, seat = Score(figure), chair(rng)
    score.wait(rng.uniform(0.3, 0.8))
    sit_down(score, seat)
    sit_and_look(score, rng.uniform(2.4, 4.5), _side(rng))
    if rng.random() < 0.6:
        stand_up(score)
        score.wait(0.5)
    return _performed(score, rng)


def sit_hanging(figure: Figure, rng: np.random.Generator) -> Motion:
    """Sit with the arms hanging beside the seat or folded in the air before the belly."""
    score, seat = Score(figure), chair(rng)
    be_seated(score, seat)
    out, forward, elbow = rng.uniform(10, 24), rng.uniform(-8, 45), rng.uniform(15, 95)
    for side in SIDES:
        score.start(f"{side}_ride", 0.0)
        score.start(f"{side}_reach", 0.0)
        score.start(f"{side}_hang", out, forward, elbow, rng.uniform(5, 40))
    sit_and_look(score, rng.uniform(2.5, 4.0), _side(rng))
    return _performed(score, rng)


def sit_perched(figure: Figure, rng: np.random.Generator) -> Motion:
    """Half sit on something high, legs nearly straight."""
    height = figure.hip_height - figure.seat_offset - rng.uniform(0.10, 0.26)
    seat = Seat(height, rng.uniform(0.12, 0.26), rng.uniform(2, 8), rng.uniform(8, 14))
    score = Score(figure)
    be_seated(score, seat)
    sit_and_look(score, rng.uniform(2.5, 4.0), _side(rng))
    return _performed(score, rng)


def sit_sofa(figure: Figure, rng: np.random.Generator) -> Motion:
    """Sink into something soft, lean back, a hand beside the thigh."""
    seat = Seat(rng.uniform(0.36, 0.48), rng.uniform(0.06, 0.16), rng.uniform(16, 28), 14.0)
    score = Score(figure)
    score.wait(0.4)
    sit_down(score, seat)
    lean_back(score, seat, rng.uniform(3.2, 5.0), _side(rng))
    if rng.random() < 0.5:
        gather_hands(score)
        stand_up(score)
        score.wait(0.4)
    return _performed(score, rng)


def sit_table(figure: Figure, rng: np.random.Generator) -> Motion:
    """Work at a table, seated."""
    seat = Seat(rng.uniform(0.42, 0.50), rng.uniform(0.0, 0.08), rng.uniform(4, 12), 14.0)
    score = Score(figure)
    be_seated(score, seat)
    score.wait(0.4)
    work_at_table(score, seat.height + rng.uniform(0.25, 0.31), rng.uniform(5, 8), rng)
    return _performed(score, rng)


def walk_and_sit(figure: Figure, rng: np.random.Generator) -> Motion:
    """Walk up, turn, sit down, stay."""
    score = Score(figure)
    score.wait(1.2)
    sit_down(score, chair(rng))
    sit_and_look(score, rng.uniform(2.0, 3.0), _side(rng))
    turning = (*WALK, TURN_RIGHT) if rng.random() < 0.5 else (*MIRRORED_WALK, TURN_LEFT)
    return walk_within(_performed(score, rng), gait(figure, turning), figure, 0.6)


def rise(figure: Figure, rng: np.random.Generator) -> Motion:
    """Seated at first, then stand up and look about."""
    score = Score(figure)
    be_seated(score, chair(rng))
    score.wait(rng.uniform(0.6, 1.4))
    stand_up(score)
    look_about(score, rng.uniform(1.5, 3.0), _side(rng))
    return _performed(score, rng)


def reach(figure: Figure, rng: np.random.Generator) -> Motion:
    """Reach for a shelf or a top and hold."""
    high = rng.random() < 0.35
    height = figure.shoulder_height + (rng.uniform(0.2, 0.45) if high else rng.uniform(-0.5, 0.15))
    distance = rng.uniform(0.48, 0.56) if high else rng.uniform(0.54, 0.70)
    tiptoe = rng.uniform(8, 18) if high and rng.random() < 0.6 else 0.0
    score = Score(figure)
    score.wait(0.5)
    hand = SIDES[int(rng.integers(2))]
    reach_for(score, height, distance, rng.uniform(0.9, 2.0), hand, tiptoe)
    score.wait(0.4)
    return _performed(score, rng)


def lean_top(figure: Figure, rng: np.random.Generator) -> Motion:
    """Both hands on a table or counter."""
    score = Score(figure)
    score.wait(0.5)
    lean_on_table(score, rng.uniform(0.68, 0.96), rng.uniform(1.8, 3.5))
    score.wait(0.4)
    return _performed(score, rng)


def palm_on_wall(figure: Figure, rng: np.random.Generator) -> Motion:
    """One palm, or both, flat against a wall ahead."""
    score = Score(figure)
    score.wait(0.4)
    hold, lean = rng.uniform(1.4, 3.0), rng.uniform(4, 16)
    height = figure.shoulder_height + rng.uniform(-0.22, 0.22)
    distance = sum(figure.arm) * rng.uniform(0.80, 0.98)
    hands = SIDES if rng.random() < 0.5 else (SIDES[int(rng.integers(2))],)
    for hand in hands:
        _press_forward(score, hand, height, distance, hold)
    x, y, z = score.last("hip")
    back = 1.3 + hold
    score.put("hip", (0.3, (x, y, z)), (1.2, (x, y - 0.03, z - 0.006)), (back, (x, y - 0.03, z - 0.006)),
              (back + 1.1, (x, y, z)))  # fmt: skip
    score.put("pitch", (0.3, 2.0), (1.2, lean), (back, lean), (back + 1.1, 2.0))
    turn = 12.0 * _side(rng)
    score.put("gaze", (0.4, (4.0, 0.0)), (1.4, (10.0, turn)), (back, (6.0, -turn)),
              (back + 1.0, (5.0, 0.0)))  # fmt: skip
    score.wait(back + 1.5)
    return _performed(score, rng)


def stand(figure: Figure, rng: np.random.Generator) -> Motion:
    """Stand, shift the weight, look about, perhaps step aside."""
    score, side = Score(figure), _side(rng)
    if rng.random() < 0.35:
        name = "left" if side > 0 else "right"
        step(score, name, (side * rng.uniform(0.3, 0.5), rng.uniform(-0.1, 0.1)), side * 12.0)
        score.wait(0.4)
    else:
        shift_weight(score, 0.3, side, rng.uniform(0.5, 1.1))
    look_about(score, rng.uniform(2.5, 5.0), -side)
    score.wait(0.5)
    return _performed(score, rng)


def pick(figure: Figure, rng: np.random.Generator) -> Motion:
    """Bend for something low."""
    score = Score(figure)
    score.wait(0.4)
    pick_up(score, rng.uniform(0.15, 0.50), SIDES[int(rng.integers(2))])
    return _performed(score, rng)


def lie_on_back(figure: Figure, rng: np.random.Generator) -> Motion:
    """Sit down on the edge of a bed, lie down, rest; or rest and get up."""
    score, seat = Score(figure), bed(rng)
    score.wait(0.4)
    sit_down(score, seat)
    lie_down(score, seat)
    resting = score.beat
    rest(score, rng.uniform(2.0, 3.5))
    if rng.random() < 0.5:
        return _performed(score, rng)
    get_up(score, seat)
    sit_and_look(score, 1.2, -1.0)
    whole = _performed(score, rng)
    return window(whole, round((resting + 0.4) * whole.fps), whole.n_frames)


def lie_rolled(figure: Figure, rng: np.random.Generator) -> Motion:
    """Lie still on a side or the belly, or between, with bent knees; roll a little."""
    score, seat = Score(figure), bed(rng)
    sit_down(score, seat)
    lie_down(score, seat)
    start = score.beat
    rest(score, rng.uniform(2.5, 3.5))
    whole = _performed(score, rng)
    resting = window(whole, round(start * whole.fps), whole.n_frames)
    goal = _side(rng) * (rng.uniform(55, 95) if rng.random() < 0.7 else rng.uniform(168, 180))
    return _rolled(resting, seat.height, goal, rng, figure)


FAMILIES: dict[str, tuple[Recipe, int]] = {
    "sit_thighs": (sit_thighs, 22), "sit_hanging": (sit_hanging, 10), "sit_perched": (sit_perched, 8),
    "sit_sofa": (sit_sofa, 12), "sit_table": (sit_table, 18), "walk_and_sit": (walk_and_sit, 6),
    "rise": (rise, 6), "reach": (reach, 16), "lean_top": (lean_top, 16),
    "palm_on_wall": (palm_on_wall, 14), "stand": (stand, 8), "pick": (pick, 6),
    "lie_on_back": (lie_on_back, 12), "lie_rolled": (lie_rolled, 12),
}  # fmt: skip
"""Recipe and number of clips of every authored family."""


def chair(rng: np.random.Generator) -> Seat:
    """A seat of everyday height."""
    return Seat(
        height=rng.uniform(0.38, 0.54),
        feet_forward=rng.uniform(-0.04, 0.14),
        recline=rng.uniform(3, 16),
        slump=rng.uniform(9, 18),
    )


def bed(rng: np.random.Generator) -> Seat:
    """The edge of a bed."""
    return Seat(rng.uniform(0.42, 0.58), rng.uniform(0.0, 0.05), rng.uniform(4, 9), 15.0)


def _press_forward(score: Score, hand: str, height: float, distance: float, hold: float) -> None:
    """Bring a palm, fingers up, onto an upright surface ahead and back."""
    sign = 1.0 if hand == "left" else -1.0
    _, y, _ = score.last("hip")
    goal = (0.19 * sign, y - distance, height - 0.06)
    near = (0.20 * sign, y - 0.75 * distance, height - 0.14)
    back = 1.3 + hold
    score.start(f"{hand}_hand", *near)
    score.start(f"{hand}_palm_frame", -8.0 * sign, 82.0, 0.0)
    score.put(f"{hand}_hand", (0.8, near), (1.25, goal), (back, goal), (back + 0.45, near))
    score.put(f"{hand}_reach", (0.25, 0.0), (1.0, 1.0), (back + 0.15, 1.0), (back + 1.1, 0.0))
    score.put(f"{hand}_palm", (0.5, 0.0), (1.1, 1.0), (back, 1.0), (back + 0.6, 0.0))
    score.put(f"{hand}_swivel", (0.4, 24.0), (1.1, 44.0), (back, 44.0), (back + 1.0, 24.0))


def _rolled(
    motion: Motion, bed_height: float, degrees: float, rng: np.random.Generator, figure: Figure
) -> Motion:
    """A resting clip turned about the line from feet to head, knees drawn up, lying at `bed_height`."""
    progress = np.linspace(0.9, 1.0, motion.n_frames)
    root = to_matrix(motion.pose[:, 0])
    turned = to_axis_angle(root @ about("y", degrees * progress))
    pose = motion.pose.copy()
    pose[:, 0] = turned
    prone = abs(degrees) > 140
    bend = rng.uniform(0, 8) if prone else rng.uniform(20, 80)
    for side in SIDES:
        share = rng.uniform(0.7, 1.2)
        pose[:, INDEX[f"{side}_hip"], 0] -= np.radians(bend * share)
        pose[:, INDEX[f"{side}_knee"], 0] += np.radians(min(1.3 * bend * share, 110.0))
        pose[:, INDEX[f"{side}_ankle"], 0] += np.radians(25.0)
        _fold_arm(pose, side, prone, rng)
    moved = dataclasses.replace(motion, pose=pose)
    return settled(moved, figure, bed_height)


def _fold_arm(pose: np.ndarray, side: str, prone: bool, rng: np.random.Generator) -> None:
    """Out from under the body: before the chest, or alongside when prone."""
    sign = -1.0 if side == "left" else 1.0
    across, down = ((-8, 4), (60, 80)) if prone else ((60, 90), (0, 25))
    turn = np.radians([0.0, sign * rng.uniform(*across), sign * rng.uniform(*down)])
    pose[:, INDEX[f"{side}_shoulder"]] = turn
    pose[:, INDEX[f"{side}_elbow"]] = np.radians(
        [0.0, sign * rng.uniform(0, 10 if prone else 80), 0.0]
    )
    pose[:, INDEX[f"{side}_wrist"]] = 0.0
    pose[:, INDEX[f"{side}_collar"]] = 0.0


def settled(motion: Motion, figure: Figure, height: float) -> Motion:
    """The motion raised or lowered, by a smooth curve, so that its lowest skin is at `height`."""
    grounded = rest_on_floor(motion, figure)
    return dataclasses.replace(grounded, transl=grounded.transl + np.array([0.0, 0.0, height]))


def _performed(score: Score, rng: np.random.Generator) -> Motion:
    return perform(score, "", int(rng.integers(1 << 31)), rng.uniform(0.5, 1.5))


def _side(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0

"""Phrases of sitting: down onto a seat, looking about, typing, up again. All for any body and seat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.body.measures import SEAT_PRESS_M
from experiments.motion.figure import SIDES, Figure, surface
from experiments.motion.perform import perform
from experiments.motion.score import Score


@dataclass(frozen=True)
class Seat:
    """A seat behind the person. Metres and degrees."""

    height: float
    feet_forward: float = 0.03
    """How far the ankles stand in front of the knees: more on a low sofa."""
    recline: float = 10.0
    """Backward tilt of the pelvis; a sofa lets one lean."""
    slump: float = 14.0
    """Forward curve of the spine that brings the chest back over it."""


CHAIR = Seat(0.45)
SOFA = Seat(0.43, feet_forward=0.10, recline=22.0, slump=14.0)
BED = Seat(0.50, feet_forward=0.02, recline=6.0, slump=15.0)


def seated_hip(figure: Figure, seat: Seat) -> tuple[float, float]:
    """How far behind the ankles (m) and how high the hip centre is on this seat.

    Measured on the skin of the seated body, which presses a little into the seat."""
    height = seat.height + figure.seat_offset
    for _ in range(2):
        height += seat.height - SEAT_PRESS_M - _lowest_seated(figure, seat, height)
    return _behind_ankles(figure, seat, height), height


def _lowest_seated(figure: Figure, seat: Seat, height: float) -> float:
    """Height of the lowest point of the buttocks with the hip centre at this height."""
    score = Score(figure, beat=0.1)
    _start_seated(score, seat, _behind_ankles(figure, seat, height), height)
    still = perform(score, "", seed=0, life=0.0)
    return float(surface(figure, still, figure.body.regions["buttocks"])[0, :, 2].min())


def _behind_ankles(figure: Figure, seat: Seat, height: float) -> float:
    thigh, shank = figure.leg
    lean = np.arcsin(np.clip(seat.feet_forward / shank, -0.9, 0.9))
    knee_height = figure.ankle_height + shank * np.cos(lean)
    rise = float(np.clip(knee_height - height, -0.9 * thigh, 0.9 * thigh))
    return float(seat.feet_forward + np.sqrt(thigh**2 - rise**2))


def sit_down(score: Score, seat: Seat) -> None:
    """Two seconds from standing to seated, hands on the thighs: the gaze first, the hips last."""
    depth, height = seated_hip(score.figure, seat)
    x, y, standing = score.last("hip")
    feet = (score.last("left_foot")[1] + score.last("right_foot")[1]) / 2
    back = feet + depth
    score.put(
        "gaze", (0.35, (30.0, -14.0)), (1.0, (34.0, 6.0)), (1.7, (16.0, 0.0)), (2.4, (6.0, 2.0))
    )
    score.put(
        "hip",
        (0.40, (x + 0.005, y + 0.22 * (back - y), standing - 0.035)),
        (0.95, (x + 0.012, y + 0.74 * (back - y), 0.52 * standing + 0.48 * height)),
        (1.50, (x + 0.004, back - 0.025, height + 0.004)),
        (2.15, (x, back, height)),
    )
    score.put("pitch", (0.5, 14.0), (1.05, 26.0), (1.6, 8.0), (2.3, -seat.recline))
    score.put("flex", (0.55, 14.0), (1.2, 25.0), (1.75, 20.0), (2.45, seat.slump))
    score.put("roll", (0.9, 1.6), (1.6, -0.8), (2.2, 0.3))
    score.put("twist", (0.7, -3.0), (1.5, 2.0), (2.3, 0.5))
    score.both("splay", (1.1, 9.0), (1.9, 11.0), lag=0.1)
    score.both("hang", (0.7, (12.0, 16.0, 24.0, 20.0)), (1.2, (13.0, 20.0, 34.0, 25.0)), lag=0.06)
    score.both("ride", (0.9, 1.0))
    score.both("reach", (0.95, 0.0), (1.75, 1.0), lag=0.12)
    score.both("swivel", (1.7, 30.0))
    score.wait(2.4)


def stand_up(score: Score, forward: float = 0.0) -> None:
    """Two seconds from seated to standing. Not sitting down reversed: the trunk tips on the seat first."""
    standing = score.figure.hip_height
    x, y, height = score.last("hip")
    feet = (score.last("left_foot")[1] + score.last("right_foot")[1]) / 2
    over = feet - 0.02 - forward
    score.put(
        "gaze", (0.3, (20.0, 0.0)), (0.8, (26.0, -3.0)), (1.5, (10.0, 4.0)), (2.2, (5.0, 0.0))
    )
    score.put(
        "hip",
        (0.30, (x, y - 0.02, height + 0.001)),
        (0.68, (x - 0.004, y - 0.10, height + 0.022)),
        (1.10, (x - 0.010, over + 0.36 * (y - over), height + 0.48 * (standing - height))),
        (1.65, (x - 0.006, over + 0.02, standing - 0.012)),
        (2.15, (x, over, standing)),
    )
    score.put("pitch", (0.32, 12.0), (0.72, 29.0), (1.15, 24.0), (1.75, 6.0), (2.25, 2.0))
    score.put("flex", (0.36, 16.0), (0.80, 17.0), (1.25, 13.0), (1.85, 5.0), (2.35, 4.0))
    score.put("roll", (0.8, -1.5), (1.4, 1.0), (2.2, 0.0))
    score.put("twist", (0.9, 2.5), (1.7, -1.5), (2.3, 0.0))
    score.both("splay", (0.8, 8.0), (1.9, 3.0), lag=0.08)
    score.both("reach", (0.22, 1.0), (1.15, 0.0), lag=0.1)
    score.both("hang", (1.0, (12.0, 10.0, 30.0, 22.0)), (1.75, (8.5, -2.0, 13.0, 16.0)),
               (2.45, (9.0, 3.0, 17.0, 18.0)), lag=0.07)  # fmt: skip
    score.both("swivel", (1.8, 24.0))
    score.wait(2.3)
    score.both("ride", (0.2, 0.0))


def sit_and_look(score: Score, seconds: float, side: float = 1.0) -> None:
    """Seated at ease: a glance aside with the trunk following a little, a small shift of weight."""
    x, y, z = score.last("hip")
    t = seconds
    score.put("gaze", (0.20 * t, (4.0, 4.0 * side)), (0.32 * t, (7.0, 34.0 * side)),
              (0.52 * t, (8.0, 37.0 * side)), (0.66 * t, (14.0, 4.0 * side)),
              (0.85 * t, (9.0, -9.0 * side)), (t, (7.0, -6.0 * side)))  # fmt: skip
    score.put(
        "twist",
        (0.25 * t, 1.0 * side),
        (0.42 * t, 7.0 * side),
        (0.6 * t, 5.5 * side),
        (0.8 * t, 0.0),
    )
    score.put("flex", (0.5 * t, score.last("flex")[0] + 3.0), (0.9 * t, score.last("flex")[0]))
    score.put("hip", (0.55 * t, (x, y, z)), (0.70 * t, (x - 0.010 * side, y + 0.004, z)))
    score.put("roll", (0.55 * t, 0.0), (0.70 * t, -1.6 * side), (t, -1.0 * side))
    score.put("left_wrist", (0.6 * t, 4.0), (0.75 * t, 10.0), (0.95 * t, 4.0))
    score.wait(seconds)


def be_seated(score: Score, seat: Seat) -> None:
    """Begin the score seated, hands on the thighs."""
    depth, height = seated_hip(score.figure, seat)
    _start_seated(score, seat, depth, height)


def _start_seated(score: Score, seat: Seat, depth: float, height: float) -> None:
    score.start("hip", 0.0, depth + 0.02, height)
    score.start("pitch", -seat.recline)
    score.start("flex", seat.slump)
    score.start("gaze", 8.0, 0.0)
    for side in SIDES:
        score.start(f"{side}_splay", 11.0)
        score.start(f"{side}_ride", 1.0)
        score.start(f"{side}_reach", 1.0)
        score.start(f"{side}_swivel", 30.0)


def lean_back(score: Score, seat: Seat, seconds: float, side: float = 1.0) -> None:
    """On a sofa: sink into the back, one hand beside the thigh, look about at leisure."""
    x, y, z = score.last("hip")
    t = seconds
    hand, sign = ("left", 1.0) if side > 0 else ("right", -1.0)
    score.put("hip", (0.5, (x, y, z + 0.004)), (1.1, (x - 0.006 * sign, y + 0.02, z)))
    score.put("pitch", (0.9, -seat.recline - 5.0), (0.6 * t, -seat.recline - 6.0))
    score.put("flex", (1.0, seat.slump + 6.0), (0.6 * t, seat.slump + 8.0))
    score.put("roll", (1.0, 1.5 * sign), (t, 1.0 * sign))
    score.put("gaze", (0.7, (2.0, 12.0 * sign)), (0.30 * t, (5.0, 30.0 * sign)),
              (0.52 * t, (6.0, 32.0 * sign)), (0.66 * t, (12.0, -4.0 * sign)),
              (0.84 * t, (6.0, -22.0 * sign)), (t, (7.0, -16.0 * sign)))  # fmt: skip
    score.put("gaze_roll", (0.35 * t, 4.0 * sign), (0.7 * t, -2.0 * sign))
    score.put("twist", (0.34 * t, 6.0 * sign), (0.66 * t, -1.0 * sign), (0.9 * t, -4.0 * sign))
    rest = (
        x + (score.figure.hip_half_width + 0.25) * sign,
        y - 0.06,
        z - score.figure.seat_offset + 0.05,
    )
    score.start(f"{hand}_hand", *rest)
    score.start(f"{hand}_palm_frame", 18.0 * sign, 0.0, 0.0)
    score.put(f"{hand}_ride", (0.25, 1.0), (1.15, 0.0))
    score.put(f"{hand}_palm", (0.4, 0.0), (1.1, 1.0))
    score.put(f"{hand}_shrug", (0.7, 4.0), (1.3, 1.0))
    score.both("splay", (0.6 * t, 13.0), (0.8 * t, 12.0), lag=0.2)
    score.wait(seconds)


def gather_hands(score: Score) -> None:
    """Bring the hands back onto the thighs before standing up."""
    for side in SIDES:
        score.put(f"{side}_ride", (0.7, 1.0))
        score.put(f"{side}_palm", (0.5, 0.0))
    score.put("pitch", (0.7, -4.0))
    score.put("flex", (0.7, 16.0))
    score.put("gaze", (0.5, (12.0, 2.0)))
    score.put("gaze_roll", (0.5, 0.0))
    score.put("twist", (0.6, 0.0))
    score.wait(0.7)


def work_at_table(score: Score, height: float, seconds: float, rng: np.random.Generator) -> None:
    """Seated, hands on a table top: type, look up to one side, type, sit back a little."""
    y = score.last("hip")[1]
    front, t = y - 0.46, seconds
    score.put("gaze", (0.4, (30.0, 3.0)), (0.30 * t, (33.0, -4.0)), (0.36 * t, (8.0, 20.0)),
              (0.48 * t, (6.0, 24.0)), (0.54 * t, (32.0, 2.0)), (0.76 * t, (34.0, -2.0)),
              (0.84 * t, (4.0, -9.0)), (t, (8.0, -3.0)))  # fmt: skip
    score.put("pitch", (0.8, 2.0), (0.76 * t, 3.0), (0.9 * t, -3.0))
    score.put(
        "flex", (0.8, 20.0), (0.4 * t, 17.0), (0.6 * t, 21.0), (0.76 * t, 22.0), (0.92 * t, 14.0)
    )
    score.put("twist", (0.34 * t, 0.0), (0.46 * t, 5.0), (0.58 * t, 0.0))
    for sign, side in ((1.0, "left"), (-1.0, "right")):
        lag = 0.12 if side == "left" else 0.0
        place = np.array([0.11 * sign, front, height + 0.045])
        # From the lap the hands would have to come up through the table: they are on it throughout.
        score.start(f"{side}_hand", *place)
        score.start(f"{side}_ride", 0.0)
        score.start(f"{side}_palm", 0.9)
        score.start(f"{side}_palm_frame", 16.0 * -sign, 0.0, 0.0)
        score.put(f"{side}_hand", (0.5 + lag, tuple(place)), *_typing(0.8 + lag, 0.34 * t, place, rng),
                  (0.38 * t + lag, tuple(place)), (0.5 * t + lag, tuple(place)),
                  *_typing(0.55 * t + lag, 0.76 * t, place, rng), (0.8 * t + lag, tuple(place)),
                  (0.92 * t + lag, tuple(place + np.array([0.03 * sign, 0.03, 0.0]))))  # fmt: skip
    score.wait(seconds)


def _typing(
    start: float, stop: float, place: np.ndarray, rng: np.random.Generator
) -> list[tuple[float, tuple[float, ...]]]:
    """Small hops of a hand over a keyboard, a key every fifth of a second or so."""
    times = start + np.cumsum(rng.uniform(0.16, 0.30, 40))
    hops = rng.normal(0.0, 1.0, (40, 3)) * np.array([0.010, 0.006, 0.0])
    hops[:, 2] = np.where(np.arange(40) % 2 == 0, 0.010, 0.0)
    return [(float(t), tuple(place + h)) for t, h in zip(times, hops, strict=True) if t < stop]

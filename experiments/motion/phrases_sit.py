"""Phrases of sitting: down onto a seat, looking about, typing, up again. All for any body and seat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.motion.figure import Figure
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
    """How far behind the ankles (m) and how high the hip centre is on this seat."""
    thigh, shank = figure.leg
    height = seat.height + figure.seat_offset
    lean = np.arcsin(np.clip(seat.feet_forward / shank, -0.9, 0.9))
    knee_height = figure.ankle_height + shank * np.cos(lean)
    rise = float(np.clip(knee_height - height, -0.9 * thigh, 0.9 * thigh))
    return float(seat.feet_forward + np.sqrt(thigh**2 - rise**2)), height


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
    score.put("pitch", (0.32, 12.0), (0.72, 31.0), (1.15, 25.0), (1.75, 6.0), (2.25, 2.0))
    score.put("flex", (0.36, 22.0), (0.80, 27.0), (1.25, 18.0), (1.85, 5.0), (2.35, 4.0))
    score.put("roll", (0.8, -1.5), (1.4, 1.0), (2.2, 0.0))
    score.put("twist", (0.9, 2.5), (1.7, -1.5), (2.3, 0.0))
    score.both("splay", (0.8, 8.0), (1.9, 3.0), lag=0.08)
    score.both("reach", (0.72, 1.0), (1.45, 0.0), lag=0.1)
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

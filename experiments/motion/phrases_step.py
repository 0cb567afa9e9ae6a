"""Phrases of single steps: aside, back, round on the spot; feet are lifted, swung and set down."""

from __future__ import annotations

import numpy as np

from experiments.motion.score import Score

_LIFT_M = 0.05


def step(
    score: Score, side: str, to: tuple[float, float], toe_out: float, seconds: float = 0.62
) -> None:
    """Move one foot to a place on the floor; weight goes onto the other foot first.

    `to` is where the ankle comes to stand (m), `toe_out` the foot's heading then (degrees).
    """
    other = "right" if side == "left" else "left"
    x0, y0, _ = score.last(f"{side}_foot")
    stand = np.array(score.last(f"{other}_foot")[:2])
    goal = np.array(to)
    t = seconds
    arch = [(0.34, 0.22, 0.75), (0.58, 0.68, 1.0), (0.82, 0.98, 0.35)]
    swing = [(at * t, (*_between((x0, y0), to, share), up * _LIFT_M)) for at, share, up in arch]
    score.put(f"{side}_foot", (0.16 * t, (x0, y0, 0.0)), *swing, (t, (*to, 0.0)))
    score.put(f"{side}_heel", (0.14 * t, 8.0), (0.38 * t, 20.0), (0.8 * t, 3.0), (t, 0.0))
    score.put(f"{side}_toe_out", (0.3 * t, score.last(f"{side}_toe_out")[0]), (0.9 * t, toe_out))
    height = score.last("hip")[2]
    # The forward lean of the hips over the ankles is kept while they pass from foot to foot.
    ahead = _ahead(score.last("yaw")[0])
    over = 0.66 * stand + 0.34 * (np.array([x0, y0]) + goal) / 2 + ahead
    middle = (stand + goal) / 2 + ahead
    score.put("hip", (0.42 * t, (*over, height - 0.012)), (1.12 * t, (*middle, height)))
    lean = 1.0 if side == "left" else -1.0
    score.put(
        f"{other}_hang", (0.5 * t, (11.0, 7.0, 21.0, 18.0)), (1.12 * t, (9.0, 3.0, 17.0, 18.0))
    )
    score.put(
        f"{side}_hang", (0.55 * t, (12.0, -2.0, 17.0, 18.0)), (1.12 * t, (9.0, 3.0, 17.0, 18.0))
    )
    score.put("roll", (0.45 * t, -2.2 * lean), (1.1 * t, 0.0))
    score.wait(1.12 * t)


def turn_to(score: Score, yaw: float, seconds: float) -> None:
    """Turn pelvis, shoulders and gaze to a heading (degrees) while feet step: gaze first, pelvis last."""
    start = score.last("yaw")[0]
    score.put("gaze", (0.45 * seconds, (10.0, yaw)), (seconds, (6.0, yaw)))
    score.put("twist", (0.35 * seconds, 0.22 * (yaw - start)), (1.05 * seconds, 0.0))
    score.put("yaw", (0.15 * seconds, start), (1.05 * seconds, yaw))


def _between(
    start: tuple[float, float], end: tuple[float, float], share: float
) -> tuple[float, float]:
    return (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))


def _ahead(yaw_deg: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    yaw = np.radians(yaw_deg)
    return np.array([np.sin(yaw), -np.cos(yaw)]) * 0.02

"""Phrases of lying: from the edge of a bed onto the back, resting, and up to the edge again."""

from __future__ import annotations

from experiments.motion.phrases_sit import Seat
from experiments.motion.score import Score, Value

_MATTRESS_M = 0.035
"""How deep a mattress gives way under a lying body."""
_DOWN_S = 3.2
_UP_PACE = 1.06


def lie_down(score: Score, bed: Seat) -> None:
    """From sitting on the edge onto the back, head to the person's left, feet swung up after it."""
    _put(score, _keys(score, bed))
    score.wait(_DOWN_S)


def get_up(score: Score, bed: Seat) -> None:
    """From the back to sitting on the edge: the same way back, the head first."""
    keys = {
        name: [(max(0.0, (_DOWN_S - time) * _UP_PACE), value) for time, value in reversed(track)]
        for name, track in _keys(score, bed, *_edge(score)).items()
    }
    _put(score, keys)
    score.wait(_DOWN_S * _UP_PACE)


def rest(score: Score, seconds: float) -> None:
    """Lie and breathe; the head rolls a little, a hand stirs."""
    t = seconds
    score.put("head_flex", (0.5 * t, 13.0), (0.8 * t, 11.0))
    score.put("gaze_roll", (0.4 * t, 0.0))
    x, y, z = score.last("right_hand")
    score.put("right_hand", (0.45 * t, (x, y, z)), (0.6 * t, (x + 0.012, y - 0.01, z + 0.004)))
    score.wait(seconds)


def _edge(score: Score) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """Hip and feet as they were on the edge of the bed, before lying down."""
    floor = [
        next(value for _, value in reversed(score.keys[f"{side}_foot"]) if value[2] == 0.0)
        for side in ("left", "right")
    ]
    seated = next(
        value for time, value in reversed(score.keys["hip"]) if time <= _lying_since(score)
    )
    return seated, floor[0], floor[1]


def _lying_since(score: Score) -> float:
    """When the feet were last both on the floor."""
    return max(time for time, value in score.keys["right_foot"] if value[2] == 0.0)


def _put(score: Score, keys: dict[str, list[tuple[float, Value]]]) -> None:
    for name, track in keys.items():
        score.put(name, *[key for key in track if key[0] > 1e-6])


def _keys(
    score: Score,
    bed: Seat,
    seated: tuple[float, ...] | None = None,
    left: tuple[float, ...] | None = None,
    right: tuple[float, ...] | None = None,
) -> dict[str, list[tuple[float, Value]]]:
    """Keys of lying down, seconds from its start; the first of each is the state on the edge."""
    figure = score.figure
    x, y, z = seated or score.last("hip")
    left, right = left or score.last("left_foot"), right or score.last("right_foot")
    down = (x + 0.06, y + 0.34, bed.height + figure.back_offset - _MATTRESS_M)
    legs = 0.985 * sum(figure.leg)
    side_hand = (x + 0.40, y + 0.10, bed.height + 0.035)
    lifted = (side_hand[0] + 0.05, y - 0.10, bed.height + 0.12)
    beside = (down[0] - 0.03, down[1] - 0.33, bed.height + 0.05)
    belly = (down[0] + 0.14, down[1] + 0.07, down[2] + figure.belly_front + 0.035)
    over_belly = (down[0] + 0.02, down[1] + 0.16, belly[2] + 0.12)
    keys: dict[str, list[tuple[float, Value]]] = {
        "hip": [(0.0, (x, y, z)), (0.55, (x + 0.015, y, z + 0.004)),
                (1.25, (x + 0.05, y + 0.10, z + 0.03)),
                (1.9, (x + 0.065, y + 0.25, z + 0.03)),
                (2.6, (down[0], down[1], down[2] + 0.006)), (3.1, down)],
        "yaw": [(0.0, 0.0), (0.45, -5.0), (1.15, -42.0), (1.75, -78.0), (2.3, -90.0)],
        "pitch": [(0.0, -bed.recline), (0.45, -3.0), (1.1, -24.0), (1.75, -58.0), (2.4, -86.0), (2.9, -91.0)],
        "roll": [(0.0, 0.3), (0.75, 13.0), (1.35, 12.0), (2.1, 1.0), (2.6, 0.0)],
        "bend": [(0.0, 0.0), (0.8, 6.0), (1.5, 4.0), (2.3, 0.0)],
        "flex": [(0.0, bed.slump), (0.7, 24.0), (1.4, 27.0), (2.1, 22.0), (2.8, 5.0), (3.1, 3.0)],
        "twist": [(0.0, 0.0), (0.7, 10.0), (1.4, 4.0), (2.2, 0.0)],
        "gaze": [(0.0, (10.0, 2.0)), (0.4, (26.0, 22.0)), (0.9, (26.0, 10.0))],
        "head_free": [(0.0, 0.0), (0.55, 0.0), (1.5, 1.0)],
        "head_flex": [(0.0, 0.0), (1.2, 14.0), (2.0, 22.0), (2.9, 12.0)],
        "left_reach": [(0.0, 1.0), (3.0, 1.0)],
        "left_ride": [(0.0, 1.0), (0.05, 1.0), (0.60, 0.0)],
        "left_palm": [(0.0, 0.0), (0.4, 0.0), (1.0, 1.0), (1.45, 1.0), (1.95, 0.2),
                      (2.3, 0.2), (3.0, 0.6)],
        "left_wrist": [(0.0, 4.0), (0.7, 70.0), (1.5, 72.0), (2.4, 0.0)],
        "left_pronation": [(0.0, 24.0), (0.7, 44.0), (1.4, -34.0), (1.8, -40.0), (2.5, 36.0)],
        "left_palm_frame": [(0.0, (-18.0, 0.0, 0.0)), (1.5, (-18.0, 0.0, 0.0)), (2.3, (-80.0, 0.0, 10.0))],
        "left_hand": [(0.0, side_hand), (1.45, side_hand), (1.85, lifted), (2.5, beside)],
        "left_swivel": [(0.0, 30.0), (1.0, 50.0), (2.2, 60.0)],
        "right_ride": [(0.0, 1.0), (0.6, 1.0), (1.6, 0.0)],
        "right_palm": [(0.0, 0.0), (1.9, 0.3), (2.6, 1.0)],
        "right_palm_frame": [(0.0, (-20.0, 0.0, 0.0)), (2.6, (8.0, -6.0, 0.0))],
        "right_hand": [(0.0, over_belly), (2.1, over_belly), (2.75, belly)],
        "right_swivel": [(0.0, 30.0), (2.2, 62.0)],
    }  # fmt: skip
    for side, foot, sign, lag in (("right", right, -1.0, 0.0), ("left", left, 1.0, 0.17)):
        keys |= _foot_keys(side, foot, sign, lag, down, legs, bed.height)
    return keys


def _foot_keys(
    side: str,
    foot: tuple[float, ...],
    sign: float,
    lag: float,
    down: tuple[float, float, float],
    legs: float,
    height: float,
) -> dict[str, list[tuple[float, Value]]]:
    """One foot from the floor over a raised way-point onto the bed, heel down, toes up and out."""
    goal = (down[0] - legs, down[1] - 0.11 * sign, height + 0.005)
    lift = (foot[0] - 0.22, foot[1] + 0.06, height + 0.06)
    over = (foot[0] - 0.52, (foot[1] + down[1]) / 2, height + 0.20)
    return {
        f"{side}_foot": [(0.0, foot), (0.62 + lag, foot), (1.25 + lag, lift), (1.75 + lag, over),
                         (2.35 + lag, (goal[0] + 0.04, goal[1], goal[2] + 0.05)), (2.8 + lag, goal)],
        f"{side}_toe_out": [(0.0, sign * 8.0), (0.7 + lag, sign * 8.0),
                            (2.2 + lag, -90.0 + sign * 14.0)],
        f"{side}_heel": [(0.0, 0.0), (0.62 + lag, 0.0), (0.9 + lag, 14.0), (1.3 + lag, 0.0),
                         (2.0 + lag, -38.0), (2.8 + lag, -62.0)],
        f"{side}_splay": [(0.0, 11.0), (1.6, 4.0), (2.8, 6.0)],
    }  # fmt: skip

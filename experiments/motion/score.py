"""Score: an authored motion as keyed channels over time, and its smooth curves.

Like a musical score it says what happens when; `perform` turns it into body parameters. Keys are
joined by a monotone cubic (no overshoot: Fritsch and Carlson 1980) and then smoothed by a gaussian,
which comes close to the minimum-jerk profile of human movement and leaves no stop at a key.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from experiments.motion.figure import SIDES, Figure

Value = float | tuple[float, ...]
SMOOTH_S = 0.07
_FOOT_SMOOTH_S = 0.03
_STANCE_HALF_WIDTH_M = 0.10
_TOE_OUT_DEG = 8.0

_BODY_CHANNELS: dict[str, tuple[float, ...]] = {
    "yaw": (0.0,),  # pelvis, degrees, counter-clockwise from above
    "pitch": (2.0,),  # pelvis, forward positive
    "roll": (0.0,),  # pelvis, positive leans to the left
    "flex": (4.0,),  # spine, forward positive
    "twist": (0.0,),  # spine, positive turns the shoulders to the left
    "bend": (0.0,),  # spine, positive bends to the left
    "gaze": (6.0, 0.0),  # pitch (down positive) and yaw of the head in the world
    "gaze_roll": (0.0,),  # head tilt, positive to the left
    "head_free": (0.0,),  # 1: the head no longer seeks its gaze but follows the chest
    "head_flex": (0.0,),  # nod relative to the chest where the head is free
}
_SIDE_CHANNELS: dict[str, tuple[float, ...]] = {
    "heel": (0.0,),  # foot pitch, degrees: positive lifts the heel, negative the toes
    "splay": (3.0,),  # knee outwards, degrees
    "hang": (9.0, 3.0, 17.0, 18.0),  # arm out, forward, elbow flexion, inward turn of the forearm
    "pronation": (24.0,),
    "wrist": (4.0,),  # bent back positive
    "shrug": (0.0,),
    "protract": (0.0,),
    "hand": (0.0, 0.0, 0.0),  # wrist target, m
    "reach": (0.0,),  # 0: the arm hangs, 1: the wrist is at its target
    "swivel": (24.0,),  # elbow outwards from straight below
    "palm": (0.0,),  # 1: the palm lies on a surface as `palm_frame` says
    "palm_frame": (0.0, 0.0, 0.0),  # finger direction yaw, tilt up, roll outwards (degrees)
    "ride": (0.0,),  # 1: the hand rests on the own thigh
}


@dataclass
class Score:
    """Channels keyed over time for one body. World: z up, metres; the person starts facing -y at 0.

    Feet are keyed by the ground point under the ankle; `hip` is the hip centre. `beat` is the time up
    to which the score is written; phrases append at it and move it on.
    """

    figure: Figure
    beat: float = 0.0
    keys: dict[str, list[tuple[float, tuple[float, ...]]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, value in _BODY_CHANNELS.items():
            self.keys[name] = [(0.0, value)]
        for sign, side in zip((1.0, -1.0), SIDES, strict=True):
            for name, value in _SIDE_CHANNELS.items():
                self.keys[f"{side}_{name}"] = [(0.0, value)]
            self.keys[f"{side}_foot"] = [(0.0, (sign * _STANCE_HALF_WIDTH_M, 0.02, 0.0))]
            self.keys[f"{side}_toe_out"] = [(0.0, (sign * _TOE_OUT_DEG,))]
        self.keys["hip"] = [(0.0, (0.0, 0.0, self.figure.hip_height))]

    def last(self, channel: str) -> tuple[float, ...]:
        """The value a channel was last set to."""
        return self.keys[channel][-1][1]

    def start(self, channel: str, *value: float) -> None:
        """Replace the value a channel begins with."""
        self._check(channel, value)
        self.keys[channel] = [(0.0, value)]

    def put(self, channel: str, *moves: tuple[float, Value], at: float | None = None) -> None:
        """Append keys (seconds after `at`, value); `at` is the beat if not given.

        The channel holds its last value until `at`, so that nothing drifts towards a later key.
        """
        base = self.beat if at is None else at
        track = self.keys[channel]
        if base > track[-1][0] + 1e-6:
            track.append((base, track[-1][1]))
        for delay, value in moves:
            values = value if isinstance(value, tuple) else (value,)
            self._check(channel, values)
            if base + delay <= track[-1][0] + 1e-6:
                raise ValueError(f"{channel}: key at {base + delay:.3f} s is not after the last")
            track.append((base + delay, values))

    def both(self, channel: str, *moves: tuple[float, Value], lag: float = 0.0) -> None:
        """`put` on the right side and, `lag` seconds later, on the left: never quite together."""
        self.put(f"right_{channel}", *moves)
        self.put(f"left_{channel}", *[(delay + lag, value) for delay, value in moves])

    def wait(self, seconds: float) -> None:
        """Move the beat on."""
        self.beat += seconds

    def sample(self, times: Float[np.ndarray, " T"]) -> dict[str, Float[np.ndarray, "T K"]]:
        """Every channel as a smooth curve at uniform times."""
        return {name: curve(track, times, _smoothing(name)) for name, track in self.keys.items()}

    def _check(self, channel: str, value: Iterable[float]) -> None:
        if channel not in self.keys:
            raise KeyError(f"no channel {channel}")
        if len(tuple(value)) != len(self.keys[channel][0][1]):
            raise ValueError(f"{channel}: {len(self.keys[channel][0][1])} values are needed")


def curve(
    track: list[tuple[float, tuple[float, ...]]], times: Float[np.ndarray, " T"], smooth_s: float
) -> Float[np.ndarray, "T K"]:
    """Monotone cubic through the keys, constant outside them, smoothed along time."""
    stamps = np.array([stamp for stamp, _ in track])
    values = np.array([value for _, value in track], dtype=np.float64)
    if len(stamps) == 1:
        return np.repeat(values, len(times), axis=0)
    inside = np.clip(times, stamps[0], stamps[-1])
    raw = PchipInterpolator(stamps, values, axis=0)(inside)
    sigma = smooth_s / float(times[1] - times[0])
    return np.asarray(gaussian_filter1d(raw, sigma, axis=0, mode="nearest"))


def _smoothing(channel: str) -> float:
    planted = channel.endswith(("_foot", "_toe_out", "_heel"))
    return _FOOT_SMOOTH_S if planted else SMOOTH_S

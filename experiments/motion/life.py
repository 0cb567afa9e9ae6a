"""Signs of life: the small irregular sway, breathing and looking about of a person at rest."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from experiments.motion.figure import SIDES

BREATHS_HZ = 0.25
# Standard deviation by channel (m or degrees) and correlation time (s).
_SWAY: dict[str, tuple[tuple[float, ...], float]] = {
    "hip": ((0.0035, 0.0035, 0.0), 0.8),
    "pitch": ((0.4,), 0.7),
    "roll": ((0.3,), 0.9),
    "yaw": ((0.4,), 0.9),
    "flex": ((0.6,), 0.7),
    "twist": ((0.5,), 0.8),
    "bend": ((0.5,), 0.8),
    "gaze": ((1.3, 2.0), 0.6),
    "gaze_roll": ((0.8,), 0.9),
}
_SIDE_SWAY: dict[str, tuple[tuple[float, ...], float]] = {
    "hang": ((0.5, 0.9, 1.4, 1.0), 0.6),
    "swivel": ((0.8,), 0.9),
    "wrist": ((1.2,), 0.5),
    "pronation": ((1.0,), 0.7),
}


def add_life(
    channels: dict[str, Float[np.ndarray, "T K"]],
    times: Float[np.ndarray, " T"],
    rng: np.random.Generator,
    amount: float = 1.0,
) -> dict[str, Float[np.ndarray, "T K"]]:
    """The channels with sway and breathing added, scaled by `amount`."""
    alive = dict(channels)
    step = float(times[1] - times[0])
    sway = dict(_SWAY) | {f"{s}_{n}": v for s in SIDES for n, v in _SIDE_SWAY.items()}
    for name, (deviation, seconds) in sway.items():
        scale = amount * np.array(deviation)
        alive[name] = alive[name] + scale * smooth_noise(
            rng, len(times), len(scale), seconds / step
        )
    breath = amount * breathing(times, rng)[:, None]
    alive["flex"] = alive["flex"] - 0.5 * breath
    for side in SIDES:
        alive[f"{side}_shrug"] = alive[f"{side}_shrug"] + 0.5 * breath
    return alive


def smooth_noise(
    rng: np.random.Generator, n_frames: int, width: int, sigma_frames: float
) -> Float[np.ndarray, "T K"]:
    """Gaussian noise smoothed to a correlation time, of unit standard deviation on average."""
    margin = int(np.ceil(4 * sigma_frames))
    white = rng.standard_normal((n_frames + 2 * margin, width))
    smooth = gaussian_filter1d(white, sigma_frames, axis=0)[margin : margin + n_frames]
    # Smoothing white noise by a gaussian divides its variance by 2 sqrt(pi) sigma.
    return np.asarray(smooth * np.sqrt(2 * np.sqrt(np.pi) * sigma_frames))


def breathing(times: Float[np.ndarray, " T"], rng: np.random.Generator) -> Float[np.ndarray, " T"]:
    """Quiet breathing between -1 and 1: about 15 a minute, breathing out longer than in."""
    phase = 2 * np.pi * BREATHS_HZ * times + rng.uniform(0, 2 * np.pi)
    return np.asarray(np.sin(phase + 0.3 * np.sin(phase)))

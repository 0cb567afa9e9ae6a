"""How well the network g estimates K_g on clips it has never seen, beside two simple guesses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from scipy.stats import spearmanr

from experiments.weighting.geometric import relative_rank
from experiments.weighting.network import FrameWeightNetwork
from experiments.weighting.training_clips import TrainingClip

Guess = Callable[[TrainingClip], Float[np.ndarray, " T"]]


def held_out_report(
    network: FrameWeightNetwork, clips: Sequence[TrainingClip]
) -> list[dict[str, Any]]:
    """MAE and Spearman's rho against K_g, means over held-out clips, for g and guesses beside it.

    One row a predictor; captured and authored clips apart and together. The rank of a frame's own
    speed is scaled by a line fitted to the training clips.
    """
    line = speed_line([clip for clip in clips if not clip.held_out])
    clips = [clip for clip in clips if clip.held_out]
    guesses: dict[str, Guess] = {
        "network g": lambda clip: estimate(network, clip),
        "own speed rank": lambda clip: line[0] + line[1] * relative_rank(clip.cues.speed),
        "constant": lambda clip: np.ones(clip.n_frames),
    }
    rows = []
    for name, guess in guesses.items():
        row: dict[str, Any] = {"predictor": name}
        for group, kept in _groups(clips).items():
            scores = [agreement(guess(clip), clip.cues.weights()) for clip in kept]
            row[f"mae_{group}"] = float(np.mean([score[0] for score in scores]))
            row[f"spearman_{group}"] = float(np.mean([score[1] for score in scores]))
        rows.append(row)
    return rows


def estimate(network: FrameWeightNetwork, clip: TrainingClip) -> Float[np.ndarray, " T"]:
    """K_g^ of a whole clip."""
    with torch.no_grad():
        scores = network(clip.inputs)
        return np.asarray(network.expectation(scores).double().numpy())


def speed_line(clips: Sequence[TrainingClip]) -> tuple[float, float]:
    """Intercept and slope of K_g over the rank of a frame's own speed within its clip."""
    rank = np.concatenate([relative_rank(clip.cues.speed) for clip in clips])
    weights = np.concatenate([clip.cues.weights() for clip in clips])
    slope, intercept = np.polyfit(rank, weights, 1)
    return float(intercept), float(slope)


def agreement(
    guess: Float[np.ndarray, " T"], target: Float[np.ndarray, " T"]
) -> tuple[float, float]:
    """Mean absolute error and Spearman's rho; rho is 0 for a guess that ranks nothing."""
    error = float(np.abs(guess - target).mean())
    if np.ptp(guess) == 0.0 or np.ptp(target) == 0.0:
        return error, 0.0
    return error, float(spearmanr(guess, target).statistic)


def report_markdown(rows: Sequence[dict[str, Any]]) -> str:
    """The report as a Markdown table."""
    columns = [name for name in rows[0] if name != "predictor"]
    heads = ["predictor", *(name.replace("_", " ") for name in columns)]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for row in rows:
        cells = [row["predictor"], *(f"{row[name]:.3f}" for name in columns)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _groups(clips: Sequence[TrainingClip]) -> dict[str, list[TrainingClip]]:
    captured = [clip for clip in clips if clip.captured]
    authored = [clip for clip in clips if not clip.captured]
    groups = {"all": list(clips), "captured": captured, "authored": authored}
    return {name: kept for name, kept in groups.items() if kept}

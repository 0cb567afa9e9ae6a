"""How the held-out error falls with the amount of motion capture."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.synthesis.held_out_scores import (
    SEGMENTS,
    pose_score,
    predicted_segments,
    route_score,
    spread,
)
from experiments.synthesis.placed_windows import PlacedWindows
from experiments.synthesis.training import Plan, train_synthesis
from experiments.synthesis.training_set import TrainingSet
from experiments.synthesis.weights import SynthesisNets

SHARES = (0.25, 0.5, 1.0)


@dataclass(frozen=True)
class AmountRow:
    """Held-out errors on captured clips after equally many steps on some of the capture."""

    capture_minutes: float
    route_cm: float
    pose_deg: float


def learning_curve(
    data: PlacedWindows,
    plan: Plan,
    steps: int,
    folder: Path,
    resume: bool,
    on_step: Callable[[float], None],
) -> list[AmountRow]:
    """Short runs of RouteNet and PoseNet on `SHARES` of the recordings; made clips stay as they are."""
    rows = []
    for index, share in enumerate(SHARES):
        part = restricted(data, share, plan.seed)
        per_epoch = -(-len(part.moving(part.placed("train"))) // plan.batch)
        epochs = max(1, round(steps / per_epoch))
        short = dataclasses.replace(plan, epochs=(epochs, epochs, 0))

        def on_share(done: float, before: int = index) -> None:
            on_step((before + done) / len(SHARES))

        nets = train_synthesis(part, short, folder / f"capture_{share:g}", resume, on_share)[1]
        rows.append(_scored(nets, data, part))
    return rows


def restricted(data: PlacedWindows, share: float, seed: int) -> PlacedWindows:
    """The data with only so large a share of the recorded seconds for training, by whole clips.

    Clips are taken in random order, the same for every share, so the smaller is part of the larger.
    """
    captured = [k for k, n in enumerate(data.clips) if n.kind == "captured" and n.split == "train"]
    total, taken, kept = sum(data.clips[k].seconds for k in captured), 0.0, set[int]()
    for clip in np.random.default_rng([seed, 4]).permutation(captured).tolist():
        if taken < share * total:
            kept.add(clip)
            taken += data.clips[clip].seconds
    left = [k for k in captured if k not in kept]
    keep = ~np.isin(data.clip[data.window], left)
    notes = [
        dataclasses.replace(note, seconds=0.0, windows=0) if index in left else note
        for index, note in enumerate(data.clips)
    ]
    return dataclasses.replace(
        data,
        window=data.window[keep],
        room=data.room[keep],
        yaw=data.yaw[keep],
        shift=data.shift[keep],
        clips=tuple(notes),
    )


def _scored(nets: SynthesisNets, data: PlacedWindows, part: PlacedWindows) -> AmountRow:
    held = TrainingSet(data, "held_out")
    clips = data.clip[data.window[held.moving]]
    captured = np.array([data.clips[clip].kind == "captured" for clip in clips.tolist()])
    chosen = held.moving[captured] if captured.any() else held.moving
    segments = predicted_segments(nets, held, spread(chosen, SEGMENTS))
    return AmountRow(
        part.capture_minutes(),
        route_score(held, segments.placements, segments.true, segments.route).position_cm,
        pose_score(segments.true, segments.pose).angle_deg,
    )

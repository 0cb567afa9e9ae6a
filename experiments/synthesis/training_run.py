"""A training run as the command line starts it: data, training, curves, and the report."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from experiments.synthesis.held_out_scores import held_out_scores
from experiments.synthesis.learning_curve import AmountRow, learning_curve
from experiments.synthesis.placed_windows import DataSettings, PlacedWindows, training_windows
from experiments.synthesis.training import CurveRow, Plan, train_synthesis
from experiments.synthesis.training_pictures import (
    draw_bodies,
    draw_curves,
    draw_poses,
    draw_routes,
)
from experiments.synthesis.training_set import TrainingSet
from experiments.synthesis.weights import KINDS, Kind, weights_file
from renderer.files import atomic_path, write_json

Show = Callable[[str, int, int], None]
"""(stage, done, of how many): a progress bar a stage."""
CURVE_STEPS = 400
"""Steps of each short run of the learning curve."""


def run_training(
    settings: DataSettings, plan: Plan, folder: Path, resume: bool, report: bool, show: Show
) -> dict[str, Any]:
    """Train into `folder`: weights, `curves.png`, `run.json`; with `report` also scores and pictures."""
    data = training_windows(settings, _shares(show, "clips and rooms"))
    curves, nets = train_synthesis(data, plan, folder, resume, _shares(show, "networks"))
    draw_curves(curves, folder / "curves.png")
    record: dict[str, Any] = {
        "weights": _weights(folder),
        "data": data_record(data),
        "curves": _last(curves),
    }
    if report:
        train, held = TrainingSet(data, "train"), TrainingSet(data, "held_out")
        record["held_out"] = held_out_scores(nets, train, held)
        amounts = learning_curve(
            data, plan, CURVE_STEPS, folder / "amounts", True, _shares(show, "amounts of capture")
        )
        record["amounts"] = [dataclasses.asdict(row) for row in amounts]
        draw_routes(nets, held, folder / "routes.png")
        draw_poses(nets, held, folder / "poses.png")
        draw_bodies(nets, held, folder / "bodies.png")
        with atomic_path(folder / "report.md") as temporary:
            temporary.write_text(report_text(record), encoding="utf-8")
    write_json(folder / "run.json", record)
    return record


def data_record(data: PlacedWindows) -> dict[str, Any]:
    """What the networks learned from, in numbers."""
    used = [note for note in data.clips if note.windows]
    splits = ("train", "held_out")
    return {
        "capture_minutes": round(data.capture_minutes(), 2),
        "held_out_capture_minutes": round(data.capture_minutes("held_out"), 2),
        "shares_of_windows": {kind: round(share, 3) for kind, share in data.shares().items()},
        "windows": len(data.pose),
        "placements": {split: len(data.placed(split)) for split in splits},  # type: ignore[arg-type]
        "clips": {split: sum(note.split == split for note in used) for split in splits},
        "rooms": {split: sum(r.split == split for r in data.rooms) for split in splits},
        "unread": list(data.unread),
    }


def summary(record: dict[str, Any]) -> str:
    """The run in a few lines of text."""
    data = record["data"]
    lines = [
        f"{data['capture_minutes']} minutes of motion capture, {data['windows']} windows, "
        f"{data['placements']['train']} placements for training"
    ]
    lines += [f"not read: {line}" for line in data["unread"]]
    for kind, row in record["curves"].items():
        if row:
            lines.append(
                f"{kind:<8} step {row['step']}: train {row['train']:.4f}, held out {row['held_out']:.4f}"
            )
    lines.append("weights: " + ", ".join(record["weights"].values()))
    return "\n".join(lines)


def report_text(record: dict[str, Any]) -> str:
    """The held-out scores as Markdown tables."""
    parts = []
    for network, groups in record["held_out"].items():
        columns = list(next(iter(next(iter(groups.values())).values())))
        parts.append(f"\n## {network}\n\n| held-out | method | {' | '.join(columns)} |")
        parts.append("|" + "---|" * (len(columns) + 2))
        for group, methods in groups.items():
            for method, scores in methods.items():
                numbers = " | ".join(f"{scores[name]:.2f}" for name in columns)
                parts.append(f"| {group} | {method} | {numbers} |")
    columns = [field.name for field in dataclasses.fields(AmountRow)]
    parts.append(f"\n## amounts of capture\n\n| {' | '.join(columns)} |\n|---|---|---|")
    for row in record["amounts"]:
        parts.append("| " + " | ".join(f"{row[name]:.2f}" for name in columns) + " |")
    return "\n".join(parts).strip() + "\n"


def _shares(show: Show, stage: str) -> Callable[[float], None]:
    return lambda share: show(stage, round(1000 * share), 1000)


def _weights(folder: Path) -> dict[str, str]:
    return {kind: str(weights_file(kind, folder)) for kind in KINDS}


def _last(curves: dict[Kind, list[CurveRow]]) -> dict[str, Any]:
    return {kind: dataclasses.asdict(rows[-1]) if rows else None for kind, rows in curves.items()}

"""One training run of the network g as a folder: weights, learning curve, report."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from experiments.interaction.registry import INTERACTIONS
from experiments.weighting.report import held_out_report, report_markdown
from experiments.weighting.training import TrainingSettings, train_network
from experiments.weighting.training_clips import build_clips
from renderer.files import InputError, atomic_path, write_json

Progress = Callable[[str, int, int], None]


def run_training(
    settings: TrainingSettings, folder: Path, progress: Progress = lambda *_: None
) -> dict[str, Any]:
    """Build the clips, train or go on, and report; returns the report.

    Leaves `paak.safetensors`, `curve.csv`, `curve.png` and `report.json` in the folder.
    """
    if settings.interaction not in INTERACTIONS:
        wanted = "one of " + ", ".join(INTERACTIONS)
        raise InputError("training settings", "interaction", settings.interaction, wanted)
    folder.mkdir(parents=True, exist_ok=True)
    clips = build_clips(
        settings.interaction,
        settings.seed,
        folder / "clips",
        lambda done, n: progress("clips", done, n),
    )
    run = train_network(clips, settings, folder, lambda done, n: progress("epochs", done, n))
    write_curve(run.curve, folder)
    test = [clip for clip in clips if clip.held_out]
    report = {
        "weights": str(folder / "paak.safetensors"),
        "interaction": settings.interaction,
        "clips": {"train": len(clips) - len(test), "held_out": len(test)},
        "frames": {
            "train": sum(clip.n_frames for clip in clips if not clip.held_out),
            "held_out": sum(clip.n_frames for clip in test),
        },
        "parameters": sum(value.numel() for value in run.network.parameters()),
        "held_out": held_out_report(run.network, clips),
    }
    write_json(folder / "report.json", report)
    return report


def run_summary(report: dict[str, Any]) -> str:
    """The report as text: sizes, then the table of predictors."""
    clips, frames = report["clips"], report["frames"]
    return (
        f"{report['weights']}: {report['parameters']} parameters, features {report['interaction']}; "
        f"{clips['train']} clips ({frames['train']} frames) to train on, "
        f"{clips['held_out']} ({frames['held_out']}) held out\n\n"
        + report_markdown(report["held_out"])
    )


def write_curve(curve: Sequence[dict[str, float]], folder: Path) -> None:
    """The learning curve as `curve.csv` and `curve.png`."""
    from matplotlib.figure import Figure

    with atomic_path(folder / "curve.csv") as temporary, temporary.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, ["epoch", *curve[0]])
        writer.writeheader()
        writer.writerows({"epoch": index + 1, **row} for index, row in enumerate(curve))
    figure = Figure(figsize=(9, 3), layout="constrained")
    epochs = range(1, len(curve) + 1)
    for axes, name in zip(figure.subplots(1, 3), curve[0], strict=True):
        axes.plot(epochs, [row[name] for row in curve])
        axes.set_xlabel("epoch")
        axes.set_title(name.replace("_", " "))
        axes.grid(alpha=0.3)
    with atomic_path(folder / "curve.png") as temporary:
        figure.savefig(temporary, format="png", dpi=120)

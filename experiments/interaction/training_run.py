"""Training runs as the command line starts them: one model or a sweep of the weight of the KL term."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Integer

from experiments.interaction.class_calibration import fit_class_temperature
from experiments.interaction.contact_build import build_dataset
from experiments.interaction.contact_dataset import RECIPE_VERSION, ContactDataset
from experiments.interaction.contact_selection import SampleScore, score_samples
from experiments.interaction.contact_training import (
    TrainingSettings,
    split_validation,
    train_network,
)
from experiments.interaction.network import ContactNetwork
from experiments.interaction.training_state import CurveRow, write_curve
from experiments.interaction.weights_file import WeightsNote, save_weights, vertex_hash
from renderer.files import InputError, write_json

KL_WEIGHTS: tuple[float, ...] = (1e-3, 3e-3, 1e-2, 0.1)
"""Values that a sweep tries; the last is POSA's."""
SCORED_BODIES = 1000
"""At most this many bodies, evenly spread, judge a network during a run."""

Show = Callable[[str, int, int], None]
"""(stage, done, of how many): a progress bar a stage."""


def training_data(seed: int, show: Show) -> ContactDataset:
    """The generated data set of that seed, built on first use."""
    return build_dataset(seed, partial(show, "bodies and scenes"))


def train_one(
    dataset: ContactDataset,
    settings: TrainingSettings,
    folder: Path,
    device: str,
    resume: bool,
    show: Show,
) -> dict[str, Any]:
    """Train one network into `folder`: `model.safetensors`, `curve.csv`, `curve.png`, `run.json`."""
    check_device(device)
    title = f"{settings.preset}, {100 * settings.thickness_m:g} cm, KL {settings.w_kl:g}"
    network, curve = train_network(dataset, settings, folder, device, resume, partial(show, title))
    network = network.cpu()
    network.class_temperature = fit_class_temperature(
        network, dataset, settings.thickness_m, judging_rows(split_validation(dataset)[1])
    )
    note = note_of(network, curve, settings, dataset)
    save_weights(network, note, folder / "model.safetensors")
    write_curve(curve, folder)
    scores = {
        name: {**asdict(score), "gap": score.gap}
        for name, score in judged(network, dataset, settings).items()
    }
    record = {"settings": asdict(settings), "note": asdict(note), "scores": scores}
    write_json(folder / "run.json", record)
    return record


def sweep_kl(
    dataset: ContactDataset,
    settings: TrainingSettings,
    folder: Path,
    device: str,
    resume: bool,
    show: Show,
) -> dict[str, Any]:
    """Train one network for each of `KL_WEIGHTS` into sub-folders and name the best.

    Best is the highest F1 of prior samples on the validation clips, which are of the training part,
    among networks whose latent code is in use there (two active units or more), so that a
    deterministic map does not win by default.
    """
    runs = []
    for w_kl in KL_WEIGHTS:
        target = folder / f"kl_{w_kl:g}"
        chosen = dataclasses.replace(settings, w_kl=w_kl)
        again = resume and target.is_dir()
        runs.append(train_one(dataset, chosen, target, device, again, show))
    alive = [run for run in runs if run["scores"]["validation"]["active_units"] >= 2] or runs
    best = max(alive, key=lambda run: run["scores"]["validation"]["prior"])
    record = {"best_w_kl": best["settings"]["w_kl"], "runs": runs}
    write_json(folder / "sweep.json", record)
    return record


def check_device(device: str) -> None:
    """Raise `InputError` for a device that torch does not know or this machine does not have."""
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        first = str(error).splitlines()[0]
        raise InputError(
            "--device", "device", device, f"a device of this machine ({first})"
        ) from None


def summary(record: dict[str, Any]) -> str:
    """The scores of one run or of a sweep as lines of text."""
    runs = record.get("runs", [record])
    lines = ["F1 of contact     KL weight   posterior  z = 0  prior  best  KL nats  active units"]
    for run in runs:
        for name, score in run["scores"].items():
            numbers = "  ".join(
                f"{score[key]:.3f}" for key in ("posterior", "zero", "prior", "best")
            )
            weight = run["settings"]["w_kl"]
            tail = f"{score['kl']:.2f}  {score['active_units']}"
            lines.append(f"{name:<18}{weight:<12g}{numbers}  {tail}")
    if "best_w_kl" in record:
        lines.append(f"best KL weight: {record['best_w_kl']:g}")
    return "\n".join(lines)


def judged(
    network: ContactNetwork, dataset: ContactDataset, settings: TrainingSettings
) -> dict[str, SampleScore]:
    """Scores on validation clips and on captured and authored test clips."""
    masks = {
        "validation": split_validation(dataset)[1],
        "captured": dataset.bodies_of(split="test", kind="captured"),
        "authored": dataset.bodies_of(split="test", kind="authored"),
    }
    scores = {}
    for name, mask in masks.items():
        rows = judging_rows(mask)
        if len(rows):
            scores[name] = score_samples(network, dataset, settings.thickness_m, rows)
    return scores


def judging_rows(mask: Bool[np.ndarray, " N"]) -> Integer[np.ndarray, " R"]:
    """About `SCORED_BODIES` bodies of a mask, evenly spread."""
    rows = np.flatnonzero(mask)
    return rows[:: max(1, len(rows) // SCORED_BODIES)]


def note_of(
    network: ContactNetwork,
    curve: list[CurveRow],
    settings: TrainingSettings,
    dataset: ContactDataset,
) -> WeightsNote:
    """What the weights file will say about itself."""
    best = min(curve, key=lambda row: row.validation, default=CurveRow())
    return WeightsNote(
        preset=settings.preset,
        thickness_m=settings.thickness_m,
        w_kl=settings.w_kl,
        seed=settings.seed,
        recipe_version=RECIPE_VERSION,
        data_seed=settings.data_seed,
        steps=best.steps,
        vertex_sha256=vertex_hash(dataset.vertex_ids),
        shape=network.shape,
        class_temperature=network.class_temperature,
    )

"""The state of a training run and its checkpoint: weights, Adam's moments, curve, best weights so far."""

from __future__ import annotations

import copy
import csv
import json
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import save_file
from torch import Tensor

from experiments.interaction.contact_dataset import RECIPE_VERSION, ContactDataset
from experiments.interaction.network import ContactNetwork
from experiments.interaction.weights_file import read_tensors, vertex_hash
from renderer.files import InputError, atomic_path, value_sha256

CHECKPOINT = "checkpoint.safetensors"
GRADIENT_NORM = 1.0
MIN_GAIN = 1e-4
"""A validation loss that is lower by less than this share is not better."""


@dataclass(frozen=True)
class CurveRow:
    """One epoch: mean training loss, validation loss and its three terms."""

    epoch: int = 0
    steps: int = 0
    training: float = float("nan")
    validation: float = float("nan")
    contact: float = float("nan")
    classes: float = float("nan")
    kl: float = float("nan")


@dataclass
class TrainingState:
    """A network in training. `step` counts finished optimiser steps."""

    network: ContactNetwork
    settings: Any
    """The run's settings, a dataclass."""
    dataset: ContactDataset
    step: int = 0
    curve: list[CurveRow] = field(default_factory=list)
    losses: list[float] = field(default_factory=list)
    """Of the epoch under way."""

    def __post_init__(self) -> None:
        self.optimiser = torch.optim.Adam(self.network.parameters())
        self.best = copy.deepcopy(self.network.state_dict())
        self.best_step = 0

    def apply(self, loss: Tensor, rate: float) -> None:
        """One step of Adam with the gradient's norm capped."""
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), GRADIENT_NORM)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.optimiser.step()
        self.step += 1

    def note_loss(self, loss: float) -> None:
        """Remember one step's loss. Raises `FloatingPointError` when training has diverged."""
        if not np.isfinite(loss):
            raise FloatingPointError(f"the loss is {loss} at step {self.step}")
        self.losses.append(loss)

    def end_epoch(self, epoch: int, row: CurveRow) -> None:
        """Add a row to the curve; keep the weights if they are the best so far."""
        training = float(np.mean(self.losses)) if self.losses else float("nan")
        so_far = [entry.validation for entry in self.curve]
        self.curve.append(replace(row, epoch=epoch, steps=self.step, training=training))
        self.losses = []
        if not so_far or row.validation < min(so_far) * (1 - MIN_GAIN):
            self.best = copy.deepcopy(self.network.state_dict())
            self.best_step = self.step

    def is_stale(self, patience: int) -> bool:
        """Whether the last `patience` epochs brought nothing better."""
        since = [row for row in self.curve if row.steps > self.best_step]
        return len(since) >= patience

    def best_network(self) -> ContactNetwork:
        """The network with the weights of the best epoch."""
        network = copy.deepcopy(self.network)
        network.load_state_dict(self.best if self.curve else self.network.state_dict())
        return network.eval()

    def save(self, folder: Path) -> None:
        """Write the checkpoint, whole or not at all."""
        moments = self.optimiser.state_dict()["state"]
        tensors = {f"now.{name}": value for name, value in self.network.state_dict().items()}
        tensors |= {f"best.{name}": value for name, value in self.best.items()}
        for index, entry in moments.items():
            tensors |= {f"adam.{index}.{name}": value for name, value in entry.items()}
        note = {
            "run": self._run(),
            "step": self.step,
            "best_step": self.best_step,
            "losses": self.losses,
            "curve": [asdict(row) for row in self.curve],
        }
        stored = {name: value.contiguous().cpu() for name, value in tensors.items()}
        with atomic_path(folder / CHECKPOINT) as temporary:
            save_file(stored, temporary, {"note": json.dumps(note, sort_keys=True)})

    def load(self, folder: Path) -> None:
        """Go on from a checkpoint. Raises `InputError` if there is none or it is of another run."""
        source = folder / CHECKPOINT
        metadata, tensors = read_tensors(source)
        try:
            note = json.loads(metadata.get("note", ""))
        except ValueError as error:
            raise InputError(source, "note", str(error), "the note of a checkpoint") from None
        if note.get("run") != self._run():
            wanted = "the settings and data of this run (start anew in another folder)"
            raise InputError(source, "run", "another run's", wanted)
        self._restore(tensors)
        self.step, self.best_step = int(note["step"]), int(note["best_step"])
        self.losses = list(note["losses"])
        self.curve = [CurveRow(**row) for row in note["curve"]]

    def _restore(self, tensors: dict[str, Tensor]) -> None:
        self.network.load_state_dict(_under(tensors, "now."))
        self.best = _under(tensors, "best.")
        moments: dict[int, dict[str, Tensor]] = {}
        for name, value in _under(tensors, "adam.").items():
            index, key = name.split(".", 1)
            moments.setdefault(int(index), {})[key] = value
        record = self.optimiser.state_dict()
        self.optimiser.load_state_dict({**record, "state": moments})

    def _run(self) -> dict[str, Any]:
        settings = asdict(self.settings)
        data = {
            "recipe_version": RECIPE_VERSION,
            "bodies": len(self.dataset.clip),
            "clips": value_sha256([asdict(clip) for clip in self.dataset.clips]),
            "vertices": vertex_hash(self.dataset.vertex_ids),
        }
        return {"settings": settings, "data": data}


def write_curve(curve: list[CurveRow], folder: Path) -> None:
    """Write the learning curve as `curve.csv` and `curve.png`."""
    with atomic_path(folder / "curve.csv") as temporary, temporary.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow([entry.name for entry in fields(CurveRow)])
        writer.writerows([list(asdict(row).values()) for row in curve])
    _draw(curve, folder / "curve.png")


def _draw(curve: list[CurveRow], target: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 3.2), layout="constrained")
    loss, terms = figure.subplots(1, 2)
    epochs = [row.epoch for row in curve]
    loss.plot(epochs, [row.training for row in curve], "o-", label="training")
    loss.plot(epochs, [row.validation for row in curve], "s-", label="validation, z at its mean")
    loss.set(xlabel="epoch", ylabel="loss, nats per vertex", ylim=(0, None))
    terms.plot(epochs, [row.contact for row in curve], "o-", label="contact")
    terms.plot(epochs, [row.classes for row in curve], "s-", label="class")
    terms.set(xlabel="epoch", ylabel="validation, nats per vertex", ylim=(0, None))
    beside = terms.twinx()
    beside.plot(epochs, [row.kl for row in curve], "^--", color="tab:green", label="KL")
    beside.set(ylabel="KL, nats per body", ylim=(0, None))
    loss.legend(fontsize=8)
    handles = [*terms.get_lines(), *beside.get_lines()]
    terms.legend(handles=handles, fontsize=8, loc="upper right")
    with atomic_path(target) as temporary:
        figure.savefig(temporary, dpi=130)


def _under(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {
        name.removeprefix(prefix): value
        for name, value in tensors.items()
        if name.startswith(prefix)
    }

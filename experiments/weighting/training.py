"""Training the network g: crops of the training clips, K_g of each crop as the target."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from safetensors.torch import load_file, save_file
from torch import Tensor

from experiments.weighting.network import N_BINS, FrameWeightNetwork, weight_loss
from experiments.weighting.report import agreement, estimate
from experiments.weighting.training_clips import TrainingClip
from experiments.weighting.weights_file import save_network
from renderer.files import InputError, atomic_path, read_json, write_json

RECIPE_VERSION = 1
CROP_S = (2.0, 6.0)
"""Shortest and longest part of a clip that a training step sees."""
FPS = 30.0


@dataclass(frozen=True)
class TrainingSettings:
    """What a training run depends on, beside its clips."""

    interaction: str
    """Which interaction model makes the features: a name in `INTERACTIONS`."""
    seed: int = 0
    epochs: int = 60
    learning_rate: float = 1e-3
    batch: int = 4
    """Clips whose gradients are averaged in one step."""


@dataclass
class TrainingRun:
    """Where a run stands: everything that a checkpoint keeps."""

    network: FrameWeightNetwork
    optimiser: torch.optim.Adam
    curve: list[dict[str, float]]

    @property
    def epoch(self) -> int:
        """Epochs done."""
        return len(self.curve)


def train_network(
    clips: Sequence[TrainingClip],
    settings: TrainingSettings,
    folder: Path,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> TrainingRun:
    """Train in `folder`, going on from its checkpoint if there is one of the same settings.

    Leaves `checkpoint.safetensors` and `run.json` after every epoch, and at the end
    `paak.safetensors`. The same settings and clips give the same weights.
    """
    train = [clip for clip in clips if not clip.held_out]
    test = [clip for clip in clips if clip.held_out]
    edges, centres = weight_bins([clip.cues.weights() for clip in train])
    run = begin_run(centres, settings)
    _resume(run, settings, folder)
    while run.epoch < settings.epochs:
        progress(run.epoch, settings.epochs)
        generator = np.random.default_rng([settings.seed, run.epoch])
        loss = _train_epoch(run, train, edges, settings, generator)
        run.curve.append({"loss": loss, **_judge(run.network, test)})
        _checkpoint(run, settings, folder)
    progress(run.epoch, settings.epochs)
    save_network(run.network, folder / "paak.safetensors", _about(settings, clips))
    return run


def begin_run(centres: Float[np.ndarray, " B"], settings: TrainingSettings) -> TrainingRun:
    """A network with seeded random weights; torch's global generator is left as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(settings.seed)
        network = FrameWeightNetwork(torch.as_tensor(centres).float())
    optimiser = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    return TrainingRun(network, optimiser, [])


def weight_bins(
    weights: Sequence[Float[np.ndarray, " _"]],
) -> tuple[Float[np.ndarray, " E"], Float[np.ndarray, " B"]]:
    """Inner edges and centres of bins with equal numbers of training frames; centres are means."""
    every = np.concatenate(weights)
    edges = np.quantile(every, np.arange(1, N_BINS) / N_BINS)
    index = np.searchsorted(edges, every, side="right")
    counts = np.bincount(index, minlength=N_BINS)
    return edges, np.bincount(index, every, N_BINS) / np.maximum(counts, 1)


def crop(clip: TrainingClip, generator: np.random.Generator) -> slice:
    """A part of a clip of two to six seconds, or the whole of a shorter one."""
    shortest, longest = (min(clip.n_frames, round(s * FPS)) for s in CROP_S)
    length = int(generator.integers(shortest, longest + 1))
    start = int(generator.integers(clip.n_frames - length + 1))
    return slice(start, start + length)


def clip_loss(
    network: FrameWeightNetwork, clip: TrainingClip, part: slice, edges: Float[np.ndarray, " E"]
) -> Float[Tensor, ""]:
    """The loss on a part of a clip, whose K_g is that of the part taken as a clip of its own."""
    target = clip.cues.weights(part)
    bins = torch.as_tensor(np.searchsorted(edges, target, side="right"))
    scores = network(clip.inputs.part(part))
    return weight_loss(scores, network.centres, torch.as_tensor(target).float(), bins)


def _train_epoch(
    run: TrainingRun,
    clips: Sequence[TrainingClip],
    edges: Float[np.ndarray, " E"],
    settings: TrainingSettings,
    generator: np.random.Generator,
) -> float:
    for group in run.optimiser.param_groups:
        share = run.epoch / settings.epochs
        group["lr"] = settings.learning_rate * 0.5 * (1.0 + float(np.cos(np.pi * share)))
    losses = []
    order = generator.permutation(len(clips))
    for begin in range(0, len(order), settings.batch):
        batch = [clips[index] for index in order[begin : begin + settings.batch]]
        run.optimiser.zero_grad()
        for clip in batch:
            loss = clip_loss(run.network, clip, crop(clip, generator), edges)
            (loss / len(batch)).backward()  # type: ignore[no-untyped-call]
            losses.append(float(loss.detach()))
        run.optimiser.step()
    return float(np.mean(losses))


def _judge(network: FrameWeightNetwork, clips: Sequence[TrainingClip]) -> dict[str, float]:
    scores = [agreement(estimate(network, clip), clip.cues.weights()) for clip in clips]
    error, rho = np.mean(scores, axis=0) if scores else (float("nan"), float("nan"))
    return {"held_out_mae": float(error), "held_out_spearman": float(rho)}


def _checkpoint(run: TrainingRun, settings: TrainingSettings, folder: Path) -> None:
    tensors = {f"network.{name}": value for name, value in run.network.state_dict().items()}
    for index, state in run.optimiser.state_dict()["state"].items():
        tensors |= {f"adam.{index}.{name}": value for name, value in state.items()}
    with atomic_path(folder / "checkpoint.safetensors") as temporary:
        save_file(tensors, temporary)
    record = {"recipe": RECIPE_VERSION, "settings": dataclasses.asdict(settings)}
    write_json(folder / "run.json", {**record, "curve": run.curve})


def _resume(run: TrainingRun, settings: TrainingSettings, folder: Path) -> None:
    path = folder / "run.json"
    if not path.exists():
        return
    record = read_json(path)
    own = {"recipe": RECIPE_VERSION, "settings": dataclasses.asdict(settings)}
    for name, value in own.items():
        if record.get(name) != value:
            wanted = f"{json.dumps(value)}, or another folder"
            raise InputError(path, name, json.dumps(record.get(name)), wanted)
    tensors = load_file(folder / "checkpoint.safetensors")
    network = {name: tensors[f"network.{name}"] for name in run.network.state_dict()}
    run.network.load_state_dict(network)
    state: dict[int, dict[str, Any]] = {}
    for name, value in tensors.items():
        kind, _, rest = name.partition(".")
        if kind == "adam":
            index, _, field = rest.partition(".")
            state.setdefault(int(index), {})[field] = value
    groups = run.optimiser.state_dict()["param_groups"]
    run.optimiser.load_state_dict({"state": state, "param_groups": groups})
    run.curve.extend(record["curve"])


def _about(settings: TrainingSettings, clips: Sequence[TrainingClip]) -> dict[str, str]:
    return {
        "recipe": str(RECIPE_VERSION),
        "seed": str(settings.seed),
        "epochs": str(settings.epochs),
        "interaction": settings.interaction,
        "training_clips": str(sum(not clip.held_out for clip in clips)),
    }

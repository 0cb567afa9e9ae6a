"""Training of the interaction model: one function from a data set and settings to weights.

The run is a function of (data, settings): the order of the bodies and the noise of every step come
from the seed and the step's number, so that a run that was stopped and resumed ends with the same
weights as one that was not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, Integer
from torch import Tensor

from experiments.interaction.contact_dataset import ContactDataset
from experiments.interaction.contact_loss import (
    class_loss,
    class_loss_posa,
    contact_loss,
    kl_divergence,
)
from experiments.interaction.contact_network import build_network
from experiments.interaction.network import ContactNetwork, NetworkShape, sample_posterior
from experiments.interaction.training_state import CurveRow, TrainingState
from experiments.scene.scene import N_CLASSES

SAVE_EVERY = 100
"""Optimiser steps between checkpoints: about half a minute of work is at risk."""
VALIDATION_SHARE = 0.08


@dataclass(frozen=True)
class TrainingSettings:
    """What a training run depends on, beside its data."""

    preset: str = "default"
    architecture: str = "point"
    thickness_m: float = 0.02
    """A vertex nearer to something than this is in contact (POSA: 0.05)."""
    w_kl: float = 3e-3
    """Weight of the Kullback-Leibler term (POSA: 0.1, which leaves no latent unit in use)."""
    posa_loss: bool = False
    """POSA's class term over all vertices with void among the classes, instead of ours."""
    all_classes: bool = False
    """All 42 classes instead of those that the data have."""
    latent: int = 16
    width: int = 64
    epochs: int = 5
    batch: int = 64
    peak_rate: float = 2e-3
    """Highest learning rate of the one cycle (Adam)."""
    patience: int = 3
    """Epochs without a better validation loss before the run ends."""
    seed: int = 0
    data_seed: int = 0
    mixed: bool = False
    """Forward pass in bfloat16: half the time on processors that have it, noise otherwise."""


PRESETS: dict[str, TrainingSettings] = {
    "default": TrainingSettings(),
    "official": TrainingSettings(preset="official", thickness_m=0.05, w_kl=0.1, posa_loss=True),
    "spiral": TrainingSettings(
        preset="spiral",
        architecture="spiral",
        thickness_m=0.05,
        w_kl=0.1,
        posa_loss=True,
        all_classes=True,
        latent=256,
    ),
}
"""`default` is ours; `official` has POSA's loss, weight and label thickness; `spiral` its network too."""

Progress = Callable[[int, int], None]
"""(step, steps in all) after every optimiser step."""


@dataclass(frozen=True)
class Bodies:
    """What one thickness makes of a data set, as tensors on the device. Axes: N bodies, V vertices."""

    vertices: Tensor
    height: Tensor
    label: Tensor
    """Class among the network's C classes, 0 (void) without contact, uint8."""

    def batch(
        self, rows: Integer[Tensor, " B"]
    ) -> tuple[
        Float[Tensor, "B V 3"], Float[Tensor, "B V"], Float[Tensor, "B V"], Integer[Tensor, "B V"]
    ]:
        """Vertices, height, contact and label of some bodies, in single precision."""
        label = self.label[rows].long()
        return self.vertices[rows].float(), self.height[rows].float(), (label > 0).float(), label


def train_network(
    dataset: ContactDataset,
    settings: TrainingSettings,
    folder: Path,
    device: str = "cpu",
    resume: bool = False,
    progress: Progress | None = None,
) -> tuple[ContactNetwork, list[CurveRow]]:
    """Train on the clips of the split `train`; the best network by validation loss, and its curve.

    `folder` receives the checkpoint (every `SAVE_EVERY` steps and after every epoch). With `resume` a
    checkpoint there is gone on from; one of other settings or data is refused (`InputError`).
    """
    learn, check = split_validation(dataset)
    shape = network_shape(dataset, settings)
    bodies = labelled(dataset, shape, settings.thickness_m, device)
    state = TrainingState(build_network(shape, settings.seed).to(device), settings, dataset)
    if resume:
        state.load(folder)
    rows = torch.as_tensor(np.flatnonzero(learn), device=device)
    held_out = torch.as_tensor(np.flatnonzero(check), device=device)
    per_epoch = max(1, len(rows) // settings.batch)
    total = per_epoch * settings.epochs
    while state.step < total and not state.is_stale(settings.patience):
        order = _order(len(rows), settings.seed, state.step // per_epoch).to(device)
        first = state.step % per_epoch * settings.batch
        loss = _step(state, bodies, rows[order[first : first + settings.batch]], settings, total)
        state.note_loss(loss)
        if state.step % per_epoch == 0:
            state.end_epoch(
                state.step // per_epoch, validation_loss(state, bodies, held_out, settings)
            )
        if state.step % SAVE_EVERY == 0 or state.step % per_epoch == 0:
            state.save(folder)
        if progress is not None:
            progress(state.step, total)
    state.save(folder)
    return state.best_network(), state.curve


def split_validation(
    dataset: ContactDataset,
) -> tuple[Bool[np.ndarray, " N"], Bool[np.ndarray, " N"]]:
    """Bodies to learn from and bodies to stop by: whole performances, captured and authored alike.

    Versions of one performance (mirrored, noisy) go together; none is of the split `test`.
    """
    train = [clip for clip in dataset.clips if clip.split == "train"]
    held_out: set[str] = set()
    for kind in ("captured", "authored"):
        names = sorted({performance(clip.name) for clip in train if clip.kind == kind})
        every = max(2, round(1 / VALIDATION_SHARE))
        held_out |= set(names[every // 2 :: every])
    is_train = dataset.bodies_of(split="train")
    stop = np.array([performance(clip.name) in held_out for clip in dataset.clips], dtype=bool)
    check = is_train & stop[dataset.clip]
    return is_train & ~check, check


def performance(clip_name: str) -> str:
    """The performance that a clip is a version of: clips are named `performance/version`."""
    return clip_name.rsplit("/", 1)[0]


def network_shape(dataset: ContactDataset, settings: TrainingSettings) -> NetworkShape:
    """Sizes of the network for these data: the classes are those of the thickest labels (5 cm)."""
    _, label = dataset.select(dataset.bodies_of(split="train")).labels(0.05)
    found = {0, *np.unique(label).tolist()}
    classes = range(N_CLASSES) if settings.all_classes else sorted(found)
    n_vertices = len(dataset.vertex_ids)
    sizes = (settings.latent, settings.width, settings.thickness_m)
    return NetworkShape(settings.architecture, tuple(classes), n_vertices, *sizes)


def labelled(
    dataset: ContactDataset, shape: NetworkShape, thickness_m: float, device: str = "cpu"
) -> Bodies:
    """Tensors of a data set with mpcat40 classes turned into the network's; unknown ones become void."""
    among = np.zeros(256, dtype=np.uint8)
    among[list(shape.classes)] = np.arange(shape.n_classes)
    _, label = dataset.labels(thickness_m)
    arrays = (dataset.vertices, dataset.height, among[label])
    return Bodies(*(torch.as_tensor(array, device=device) for array in arrays))


def batches(rows: Tensor, size: int = 256) -> list[Tensor]:
    """The rows in pieces of at most `size`."""
    return [rows[start : start + size] for start in range(0, len(rows), size)]


def one_cycle(step: int, total: int, peak: float, warm: float = 0.1) -> float:
    """Learning rate: cosine from peak/25 up to `peak` at `warm`, then cosine down to almost nothing."""
    rising = max(1.0, warm * total)
    if step < rising:
        low, share = peak / 25, step / rising
        return low + (peak - low) * 0.5 * (1 - math.cos(math.pi * share))
    share = (step - rising) / max(1.0, total - rising)
    return peak * (1e-4 + (1 - 1e-4) * 0.5 * (1 + math.cos(math.pi * share)))


def training_loss(
    network: ContactNetwork,
    batch: tuple[Tensor, Tensor, Tensor, Tensor],
    noise: Float[Tensor, "B Z"],
    settings: TrainingSettings,
) -> tuple[Tensor, Tensor, Tensor]:
    """Contact, class and (unweighted) Kullback-Leibler term of one batch."""
    vertices, height, contact, label = batch
    with torch.autocast(vertices.device.type, dtype=torch.bfloat16, enabled=settings.mixed):
        mean, log_var = (part.float() for part in network.encode(*batch))
        z = sample_posterior(mean, log_var, noise)
        logit, classes = (part.float() for part in network.decode(vertices, height, z))
    of_class = (
        class_loss_posa(classes, label)
        if settings.posa_loss
        else class_loss(classes, label, contact)
    )
    return contact_loss(logit, contact), of_class, kl_divergence(mean, log_var)


def validation_loss(
    state: TrainingState,
    bodies: Bodies,
    rows: Integer[Tensor, " N"],
    settings: TrainingSettings,
) -> CurveRow:
    """The three terms over held-out bodies, with z at the posterior's mean."""
    sums = np.zeros(3)
    state.network.eval()
    with torch.no_grad():
        for part in batches(rows):
            batch = bodies.batch(part)
            noise = torch.zeros((len(part), settings.latent), device=part.device)
            terms = training_loss(state.network, batch, noise, settings)
            sums += np.array([float(term) for term in terms]) * len(part)
    state.network.train()
    contact, of_class, kl = (sums / max(1, len(rows))).tolist()
    total = contact + of_class + settings.w_kl * kl
    return CurveRow(contact=contact, classes=of_class, kl=kl, validation=total)


def _step(
    state: TrainingState,
    bodies: Bodies,
    rows: Integer[Tensor, " B"],
    settings: TrainingSettings,
    total: int,
) -> float:
    noise = _noise(len(rows), settings, state.step).to(rows.device)
    contact, of_class, kl = training_loss(state.network, bodies.batch(rows), noise, settings)
    loss = contact + of_class + settings.w_kl * kl
    state.apply(loss, one_cycle(state.step, total, settings.peak_rate))
    return float(loss.detach())


def _order(count: int, seed: int, epoch: int) -> Integer[Tensor, " N"]:
    shuffled = np.random.default_rng((seed, 1, epoch)).permutation(count)
    return torch.as_tensor(shuffled)


def _noise(count: int, settings: TrainingSettings, step: int) -> Float[Tensor, "B Z"]:
    drawn = np.random.default_rng((settings.seed, 2, step)).standard_normal(
        (count, settings.latent)
    )
    return torch.as_tensor(drawn, dtype=torch.float32)


def named(preset: str, **changes: object) -> TrainingSettings:
    """A preset with some values changed; `None` leaves a value as the preset has it."""
    given = {name: value for name, value in changes.items() if value is not None}
    return replace(PRESETS[preset], **given)  # type: ignore[arg-type]

"""What a trained network is chosen by: how good its prior samples are, and how far below its posterior.

Reconstruction flatters a network whose latent code smuggles the answer; placement only ever has prior
samples, so these decide (and the gap between the two says how much is smuggled).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Integer
from torch import Tensor

from experiments.interaction.contact_dataset import ContactDataset
from experiments.interaction.contact_training import Bodies, batches, labelled
from experiments.interaction.network import ContactNetwork


@dataclass(frozen=True)
class SampleScore:
    """F1 of contact over all vertices of all bodies (micro), and what the latent code does."""

    posterior: float
    """z at the posterior's mean: reconstruction."""
    zero: float
    """z = 0."""
    prior: float
    """Mean over prior samples, one z a clip."""
    best: float
    """The best of those samples."""
    kl: float
    """KL of the posterior from the prior, nats."""
    active_units: int
    """Latent dimensions whose posterior mean varies by more than 0.01 (Burda et al. 2016)."""

    @property
    def gap(self) -> float:
        """Posterior less prior."""
        return self.posterior - self.prior


def score_samples(
    network: ContactNetwork,
    dataset: ContactDataset,
    thickness_m: float,
    rows: Integer[np.ndarray, " N"],
    samples: int = 10,
    seed: int = 0,
    temperature: float = 1.0,
) -> SampleScore:
    """Score a network on some bodies of a data set."""
    bodies = labelled(dataset, network.shape, thickness_m)
    chosen = torch.as_tensor(rows)
    truth = (bodies.label[chosen] > 0).numpy()
    mean, log_var = encode_rows(network, bodies, chosen)
    clips = np.unique(dataset.clip[rows], return_inverse=True)[1]
    drawn = np.random.default_rng(seed).standard_normal(
        (samples, int(clips.max()) + 1, network.shape.latent)
    )
    sampled = []
    for codes in temperature * drawn:
        z = torch.as_tensor(codes[clips], dtype=torch.float32)
        sampled.append(micro_f1(contact_of(network, bodies, chosen, z), truth))
    variance = 0.5 * (mean.square() + log_var.exp() - 1 - log_var).sum(-1)
    return SampleScore(
        posterior=micro_f1(contact_of(network, bodies, chosen, mean), truth),
        zero=micro_f1(contact_of(network, bodies, chosen, torch.zeros_like(mean)), truth),
        prior=float(np.mean(sampled)),
        best=float(np.max(sampled)),
        kl=float(variance.mean()),
        active_units=int((mean.var(0) > 0.01).sum()),
    )


def encode_rows(
    network: ContactNetwork, bodies: Bodies, rows: Integer[Tensor, " N"]
) -> tuple[Float[Tensor, "N Z"], Float[Tensor, "N Z"]]:
    """Posterior mean and log variance of some bodies."""
    with torch.no_grad():
        parts = [network.encode(*bodies.batch(part)) for part in batches(rows)]
    return torch.cat([part[0] for part in parts]), torch.cat([part[1] for part in parts])


def contact_of(
    network: ContactNetwork,
    bodies: Bodies,
    rows: Integer[Tensor, " N"],
    z: Float[Tensor, "N Z"],
) -> Bool[np.ndarray, "N V"]:
    """Contact above one half, decoded with one z a body."""
    found = []
    with torch.no_grad():
        for part, codes in zip(batches(rows), batches(z), strict=True):
            vertices, height, _, _ = bodies.batch(part)
            found.append(network.decode(vertices, height, codes)[0] > 0)
    return np.asarray(torch.cat(found).numpy())


def micro_f1(found: Bool[np.ndarray, "N V"], truth: Bool[np.ndarray, "N V"]) -> float:
    """F1 of a set of yes-or-no answers: 2 TP / (2 TP + FP + FN); 1 where there is nothing to find."""
    both = int((found & truth).sum())
    total = int(found.sum()) + int(truth.sum())
    return 2 * both / total if total else 1.0

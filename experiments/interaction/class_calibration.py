"""The temperature that makes a network's classes as sure of themselves as they are right."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Integer
from scipy.optimize import minimize_scalar
from scipy.special import log_softmax

from experiments.interaction.contact_dataset import ContactDataset
from experiments.interaction.contact_training import Bodies, batches, labelled
from experiments.interaction.network import ContactNetwork
from experiments.scene.scene import MPCAT40

SAMPLES = 4
"""Prior samples that it is fitted to, one z for all bodies each."""
HIGHEST = 8.0


def fit_class_temperature(
    network: ContactNetwork,
    dataset: ContactDataset,
    thickness_m: float,
    rows: Integer[np.ndarray, " N"],
    seed: int = 0,
) -> float:
    """Temperature scaling (Guo et al. 2017) of the classes of vertices in contact, on some bodies.

    It divides the class logits, so the likeliest class stays and its rivals come nearer. It is the
    value from 1 to `HIGHEST` with the least negative log-likelihood under prior samples; floor and
    everything else weigh the same, or the floor, which is always told apart, would decide alone. 1
    where nothing but the floor is touched.
    """
    bodies = labelled(dataset, network.shape, thickness_m)
    chosen = torch.as_tensor(rows)
    label = bodies.label[chosen].numpy()
    logits = _sampled_logits(network, bodies, chosen, label > 0, seed)
    true = label[label > 0].astype(np.int64) - 1
    on_floor = np.array(network.shape.classes[1:])[true] == MPCAT40.index("floor")
    if on_floor.all():
        return 1.0
    weight = np.where(on_floor, 1 / max(1, on_floor.sum()), 1 / (~on_floor).sum())

    def loss(log_temperature: float) -> float:
        scores = log_softmax(logits / np.exp(log_temperature), axis=-1)
        return float(-(scores[:, np.arange(len(true)), true] * weight).sum())

    found = minimize_scalar(loss, bounds=(0.0, np.log(HIGHEST)), method="bounded")
    return round(float(np.exp(found.x)), 3)


def _sampled_logits(
    network: ContactNetwork,
    bodies: Bodies,
    rows: Integer[torch.Tensor, " N"],
    touching: np.ndarray,
    seed: int,
) -> Float[np.ndarray, "S M C"]:
    """Class logits without void of the vertices in contact, for each of the samples."""
    drawn = np.random.default_rng(seed).standard_normal((SAMPLES, network.shape.latent))
    found = []
    for z in torch.as_tensor(drawn, dtype=torch.float32):
        parts = []
        with torch.no_grad():
            for part in batches(rows):
                vertices, height, _, _ = bodies.batch(part)
                parts.append(network.decode(vertices, height, z.expand(len(part), -1))[1])
        found.append(torch.cat(parts).numpy()[touching][:, 1:])
    return np.stack(found)

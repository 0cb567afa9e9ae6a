"""A trained network as the report asks it: maps of a data set at z = 0, from the prior, as used."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Integer
from scipy.ndimage import gaussian_filter1d
from scipy.special import expit
from torch import Tensor

from experiments.interaction.contact_baselines import Prediction
from experiments.interaction.contact_dataset import FPS, ContactDataset
from experiments.interaction.contact_selection import encode_rows
from experiments.interaction.contact_training import batches, labelled
from experiments.interaction.learned import SMOOTHING_S, BodyFrames, prior_samples, touching_codes
from experiments.interaction.network import ContactNetwork


@dataclass
class TrainedModel:
    """A network under the name that tables give it; implements `contact_report.ContactModel`."""

    name: str
    network: ContactNetwork

    def at_zero(self, data: ContactDataset) -> Prediction:
        """The map of z = 0."""
        z = torch.zeros((len(data.clip), self.network.shape.latent))
        return self._decoded(data, z, f"{self.name}, z = 0")

    def sample(self, data: ContactDataset, seed: int) -> Prediction:
        """A map of the prior, one z a clip."""
        drawn = np.random.default_rng(seed).standard_normal(
            (len(data.clips), self.network.shape.latent)
        )
        z = torch.as_tensor(drawn[data.clip], dtype=torch.float32)
        return self._decoded(data, z, f"{self.name}, prior sample")

    def posterior(
        self, data: ContactDataset, thickness_m: float
    ) -> tuple[Prediction, Float[np.ndarray, "N Z"]]:
        """The map of the posterior's mean given the true labels, and those means."""
        bodies = labelled(data, self.network.shape, thickness_m)
        mean, _ = encode_rows(self.network, bodies, torch.arange(len(data.clip)))
        return self._decoded(data, mean, f"{self.name}, posterior"), mean.numpy()

    def as_used(self, data: ContactDataset) -> Prediction:
        """The first map that placement is offered: a touching sample if there is one, smoothed."""
        z = torch.zeros((len(data.clip), self.network.shape.latent))
        for number in np.unique(data.clip):
            rows = data.clip == number
            samples = prior_samples(self.network, _frames(data, rows))
            codes = touching_codes(self.network, samples)
            if codes:
                z[torch.as_tensor(rows)] = codes[0]
        return self._decoded(data, z, f"{self.name}, as used", smooth=True)

    def _decoded(
        self, data: ContactDataset, z: Float[Tensor, "N Z"], name: str, smooth: bool = False
    ) -> Prediction:
        rows = torch.arange(len(data.clip))
        logits, classes = [], []
        with torch.no_grad():
            for part in batches(rows):
                vertices, height = (
                    torch.as_tensor(array[part.numpy()]).float()
                    for array in (data.vertices, data.height)
                )
                logit, scores = self.network.decode(vertices, height, z[part])
                logits.append(logit.numpy())
                classes.append(scores[..., 1:].argmax(-1).numpy())
        among = np.array(self.network.shape.classes[1:], dtype=np.uint8)
        contact = np.concatenate(logits)
        if smooth:
            contact = smoothed(contact, data.clip, data.frame)
        return Prediction(name, expit(contact), among[np.concatenate(classes)])


def smoothed(
    logits: Float[np.ndarray, "N V"],
    clip: Integer[np.ndarray, " N"],
    frame: Integer[np.ndarray, " N"],
) -> Float[np.ndarray, "N V"]:
    """Logits smoothed over time within every run of consecutive frames of a clip."""
    breaks = np.flatnonzero((np.diff(clip) != 0) | (np.diff(frame) != 1)) + 1
    runs = np.split(logits, breaks)
    sigma = SMOOTHING_S * FPS
    done = [gaussian_filter1d(run, sigma, axis=0, mode="nearest") for run in runs if len(run)]
    return np.asarray(np.concatenate(done))


def _frames(data: ContactDataset, rows: np.ndarray) -> BodyFrames:
    vertices, height = (
        torch.as_tensor(array[rows]).float() for array in (data.vertices, data.height)
    )
    return BodyFrames(data.vertex_ids, vertices, height)

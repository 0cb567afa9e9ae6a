"""The temperature of the classes on networks whose overconfidence is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from experiments.interaction.class_calibration import fit_class_temperature
from experiments.interaction.network import ContactNetwork, NetworkShape
from tests.experiments.interaction.conftest import small_dataset

SHAPE = NetworkShape("point", (0, 2, 3, 5), 6, latent=2)
SHARES = np.array([0.5, 0.35, 0.15])


class Known(ContactNetwork):
    """Says the same shares of floor, chair and table everywhere, `factor` times too sure of them."""

    def __init__(self, factor: float) -> None:
        super().__init__()
        self.shape = SHAPE
        self.logits = torch.as_tensor(factor * np.log(SHARES), dtype=torch.float32)

    def decode(self, vertices, height, z):
        scores = torch.zeros((*height.shape, 4))
        scores[..., 1:] = self.logits / self.class_temperature
        return torch.zeros(height.shape), scores


@pytest.fixture(scope="module")
def drawn():
    """Bodies all in contact, whose classes are drawn from the shares, floor as often as the rest."""
    data = small_dataset(0)
    classes = np.random.default_rng(5).choice(
        np.array([2, 3, 5], dtype=np.uint8), data.nearest.shape, p=SHARES
    )
    return dataclasses.replace(data, nearest=classes, distance=0 * data.distance)


@pytest.mark.parametrize("factor", [2.0, 4.0])
def test_a_network_that_is_too_sure_by_a_factor_gets_that_factor(drawn, factor: float) -> None:
    rows = np.arange(len(drawn.clip))
    one, many = (fit_class_temperature(Known(f), drawn, 0.02, rows) for f in (1.5, 1.5 * factor))
    assert many / one == pytest.approx(factor, rel=0.02)
    assert 1.5 / one == pytest.approx(1.0, rel=0.25)  # 144 draws


def test_where_only_the_floor_is_touched_nothing_is_changed(drawn) -> None:
    floor_only = dataclasses.replace(drawn, nearest=np.full_like(drawn.nearest, 2))
    assert fit_class_temperature(Known(3.0), floor_only, 0.02, np.arange(24)) == 1.0

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.autograd import gradcheck

from experiments.synthesis.losses import (
    contact,
    kl_divergence,
    kl_weight,
    l1,
    penetration,
    subgoal_reconstruction,
)


def draws(*shape: int, seed: int = 0) -> torch.Tensor:
    values = torch.tensor(np.random.default_rng(seed).normal(size=shape))
    return values.requires_grad_(True)


def test_every_loss_has_the_gradient_of_its_value() -> None:
    assert gradcheck(kl_divergence, (draws(3, 4), draws(3, 4, seed=1)))
    assert gradcheck(subgoal_reconstruction, (draws(2, 135), draws(2, 135, seed=1)))
    assert gradcheck(l1, (draws(2, 5), draws(2, 5, seed=1)))
    assert gradcheck(penetration, (draws(3, 7),))
    assert gradcheck(contact, (draws(3, 7),))


def test_the_divergence_is_that_of_two_normals() -> None:
    mean, log_variance = draws(5, 3).detach(), draws(5, 3, seed=1).detach()
    ours = torch.distributions.Normal(mean, torch.exp(0.5 * log_variance))
    wanted = torch.distributions.kl_divergence(ours, torch.distributions.Normal(0.0, 1.0)).mean()
    assert float(kl_divergence(mean, log_variance)) == pytest.approx(float(wanted), rel=1e-6)


def test_the_weight_of_the_divergence_rises_quadratically_and_stays() -> None:
    assert kl_weight(0.0) == 0.0
    assert kl_weight(3.75) == pytest.approx(0.025)
    assert kl_weight(7.5) == kl_weight(50.0) == pytest.approx(0.1)


def test_reconstruction_counts_translation_half() -> None:
    true = torch.zeros(1, 135)
    parts = {"translation": (slice(0, 3), 0.5), "orientation": (slice(3, 9), 1.0)}
    parts["pose"] = (slice(9, 135), 1.0)
    for where, weight in parts.values():
        off = true.clone()
        off[:, where] = 2.0
        assert float(subgoal_reconstruction(off, true)) == pytest.approx(2.0 * weight)


def test_penetration_is_the_mean_depth_of_what_is_inside() -> None:
    distance = torch.tensor([[-0.1, 0.5], [-0.3, 2.0]])
    assert float(penetration(distance)) == pytest.approx(0.2)
    assert float(penetration(distance.abs())) == 0.0


def test_contact_is_robust_far_away_and_smooth_at_the_surface() -> None:
    assert float(contact(torch.tensor([0.0]))) == pytest.approx(0.01 / 1.01)
    assert float(contact(torch.tensor([1e6]))) == pytest.approx(1.0, abs=1e-5)
    assert float(contact(torch.tensor([0.3]))) == float(contact(torch.tensor([-0.3])))

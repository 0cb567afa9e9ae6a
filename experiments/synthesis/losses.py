"""Loss terms of training, two of which refinement uses too: each a function of what it measures.

After Wang et al. (CVPR 2021) and their published code. Distances are signed, metres, negative inside
solids; axes B batch, T frames, V vertices.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from experiments.synthesis.body_vector import POSE

CONTACT_REGIONS = ("back", "buttocks", "left_hand", "right_hand", "calves", "thigh_backs")
"""Parts of the body that the contact term of training draws to the scene."""
KL_WEIGHT, RECONSTRUCTION_WEIGHT, SUBGOAL_SCENE_WEIGHT = 0.1, 0.1, 0.01
"""Weights of the sub-goal network's loss; the last one for penetration and for contact each."""
KL_RAMP_EPOCHS = 7.5


def kl_weight(epoch: float) -> float:
    """Weight of the divergence after `epoch` epochs: a quadratic ramp to `KL_WEIGHT`."""
    return KL_WEIGHT * min(1.0, epoch / KL_RAMP_EPOCHS) ** 2


def kl_divergence(
    mean: Float[Tensor, "B L"], log_variance: Float[Tensor, "B L"]
) -> Float[Tensor, ""]:
    """Divergence of the latent from the standard normal, mean over batch and dimensions."""
    return 0.5 * (log_variance.exp() + mean**2 - 1.0 - log_variance).mean()


def subgoal_reconstruction(
    predicted: Float[Tensor, "B 135"], true: Float[Tensor, "B 135"]
) -> Float[Tensor, ""]:
    """Mean absolute errors: pose (weight 1), orientation (1) and translation (0.5)."""
    error = (predicted - true).abs()
    return error[:, POSE].mean() + error[:, 3:9].mean() + 0.5 * error[:, :3].mean()


def l1(predicted: Float[Tensor, "*N"], true: Float[Tensor, "*N"]) -> Float[Tensor, ""]:
    """Mean absolute error: the loss of RouteNet and of PoseNet."""
    return (predicted - true).abs().mean()


def penetration(distance: Float[Tensor, "*N"]) -> Float[Tensor, ""]:
    """Mean depth of the vertices that are inside something, metres; 0 if none is."""
    inside = distance < 0
    depth = torch.where(inside, -distance, torch.zeros_like(distance))
    return depth.sum() / inside.sum().clamp(min=1)


def contact(distance: Float[Tensor, "*N"]) -> Float[Tensor, ""]:
    """Mean of d / (d + 1) over the vertices of `CONTACT_REGIONS`, d = sqrt(distance² + 1e-4).

    The robust form lets parts that are far from everything stay there.
    """
    d = torch.sqrt(distance**2 + 1e-4)
    return (d / (d + 1.0)).mean()

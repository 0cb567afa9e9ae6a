"""The loss of the interaction model: contact, class and Kullback-Leibler terms, each by itself."""

from __future__ import annotations

import torch
from jaxtyping import Float, Integer
from torch import Tensor
from torch.nn import functional


def contact_loss(logit: Float[Tensor, "B V"], contact: Float[Tensor, "B V"]) -> Float[Tensor, ""]:
    """Binary cross-entropy of contact, mean over bodies and vertices (POSA, equation 3)."""
    return functional.binary_cross_entropy_with_logits(logit, contact)


def class_loss(
    logits: Float[Tensor, "B V C"], label: Integer[Tensor, "B V"], contact: Float[Tensor, "B V"]
) -> Float[Tensor, ""]:
    """Cross-entropy of the class of vertices in contact, summed over them, divided by B * V (ours).

    Void (class 0) is no candidate: it is the absence of contact, which `contact_loss` pays for. The
    two together are the log-likelihood of p(contact) p(class | contact), mean over vertices.
    """
    touching = contact > 0.5
    given_contact = logits[..., 1:][touching]
    lost = functional.cross_entropy(given_contact, label[touching].long() - 1, reduction="sum")
    return lost / contact.numel()


def class_loss_posa(
    logits: Float[Tensor, "B V C"], label: Integer[Tensor, "B V"]
) -> Float[Tensor, ""]:
    """Cross-entropy over all classes, void among them, mean over bodies and vertices (POSA)."""
    return functional.cross_entropy(logits.flatten(0, 1), label.flatten().long())


def kl_divergence(mean: Float[Tensor, "B Z"], log_var: Float[Tensor, "B Z"]) -> Float[Tensor, ""]:
    """KL(q || standard normal) in nats, summed over dimensions, mean over bodies."""
    return 0.5 * (mean.square() + torch.exp(log_var) - 1 - log_var).sum(-1).mean()

"""W_d: how often a frame is picked when frames are picked to be unlike one another.

The mechanism is that of BADGE (Ash et al. 2020, "Deep batch active learning by diverse, uncertain
gradient lower bounds"), which PAAK is said to use; PACE: "the diversity score obtained from the
model's gradients". Sizes and number of repeats are ours.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

REPEATS = 64
PICKED_SHARE = 0.25
"""Share of the frames that one repeat picks."""


def diversity(
    residual: Float[np.ndarray, "T B"], hidden: Float[np.ndarray, "T H"], seed: int
) -> Float[np.ndarray, " T"]:
    """W_d, mean 1: selection frequency over seeded repeats of k-means++ seeding.

    `residual` and `hidden` are the factors of the gradient embedding; see `gradient_factors`.
    """
    distance = embedding_distances(residual, hidden)
    count = int(np.ceil(PICKED_SHARE * len(distance)))
    picked = np.zeros(len(distance))
    for generator in np.random.default_rng(seed).spawn(REPEATS):
        picked[spread_seeds(distance, count, generator)] += 1.0
    return picked / picked.mean()


def gradient_factors(
    scores: Float[Tensor, "T B"], hidden: Float[Tensor, "T H"]
) -> tuple[Float[np.ndarray, "T B"], Float[np.ndarray, "T H"]]:
    """The gradient of -log p(most likely bin) by the last layer's weights, as two factors.

    With p the softmax of the scores and y the one-hot of their maximum it is (p - y) h^T.
    """
    likely = functional.one_hot(scores.argmax(-1), scores.shape[-1])
    residual = scores.double().softmax(-1) - likely
    return residual.detach().numpy(), hidden.double().detach().numpy()


def gradient_embedding_reference(
    head: nn.Linear, hidden: Float[Tensor, "T H"]
) -> Float[np.ndarray, "T E"]:
    """The same gradients, frame by frame by automatic differentiation: slow and obvious."""
    weight = head.weight.detach().requires_grad_()
    rows = []
    for state in hidden:
        scores = functional.linear(state, weight, head.bias)
        loss = functional.cross_entropy(scores, scores.argmax())
        (gradient,) = torch.autograd.grad(loss, weight)
        rows.append(gradient.flatten())
    return np.asarray(torch.stack(rows).double().numpy())


def embedding_distances(
    residual: Float[np.ndarray, "T B"], hidden: Float[np.ndarray, "T H"]
) -> Float[np.ndarray, "T T"]:
    """Squared distances between the embeddings, which are never written out:
    <r_i h_i^T, r_j h_j^T> = <r_i, r_j> <h_i, h_j>."""
    product = (residual @ residual.T) * (hidden @ hidden.T)
    length = np.diag(product)
    distance = np.maximum(length[:, None] + length[None] - 2.0 * product, 0.0)
    np.fill_diagonal(distance, 0.0)
    return distance


def spread_seeds(
    distance: Float[np.ndarray, "T T"], count: int, generator: np.random.Generator
) -> np.ndarray:
    """Indices picked by k-means++ (Arthur & Vassilvitskii 2007), each at most once.

    The first is uniform, each next one has probability proportional to its squared distance from
    the nearest picked. Where all that is left coincides with what was picked, it is uniform.
    """
    first = int(generator.integers(len(distance)))
    picked = [first]
    left = np.ones(len(distance))
    left[first] = 0.0
    gap = distance[first].copy()
    # Rounding leaves frames that are the same a tiny distance apart.
    tiny = 1e-12 * float(distance.max())
    while len(picked) < count:
        odds = np.where(gap > tiny, gap, 0.0) * left
        odds = odds if odds.sum() > 0.0 else left
        chosen = int(generator.choice(len(odds), p=odds / odds.sum()))
        picked.append(chosen)
        left[chosen] = 0.0
        gap = np.minimum(gap, distance[chosen])
    return np.array(picked, dtype=np.int64)

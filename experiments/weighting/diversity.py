"""W_d: how often a frame is picked when frames are picked to be unlike one another.

The mechanism is that of BADGE (Ash et al. 2020, "Deep batch active learning by diverse, uncertain
gradient lower bounds"), which PAAK is said to use; PACE: "the diversity score obtained from the
model's gradients". Sizes and number of repeats are ours.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn
from torch.nn import functional

REPEATS = 256
"""Repeats of the seeding: a frequency of a quarter is then known to 0.03."""
SAME = 1e-12
"""Frames closer than this share of the largest squared distance are the same: rounding leaves them
a tiny distance apart."""
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
    chance = np.random.default_rng(seed).random((REPEATS, count))
    picks = np.bincount(spread_seeds(distance, chance).ravel(), minlength=len(distance))
    return np.asarray(picks / picks.mean())


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
    return np.asarray(distance)


def spread_seeds(
    distance: Float[np.ndarray, "T T"], chance: Float[np.ndarray, "R K"]
) -> Int64[np.ndarray, "R K"]:
    """Frames picked by k-means++ (Arthur & Vassilvitskii 2007), each at most once in a repeat.

    `chance` holds a number in [0, 1) for every pick of every repeat. The first pick is uniform, each
    next one has probability proportional to its squared distance from the nearest picked. Where
    all that is left coincides with what was picked, it is uniform.
    """
    repeats, count = chance.shape
    rows = np.arange(repeats)
    tiny = SAME * float(distance.max())
    left = np.ones((repeats, len(distance)))
    gap = np.zeros((repeats, len(distance)))
    picked = np.zeros((repeats, count), dtype=np.int64)
    for step in range(count):
        odds = np.where(gap > tiny, gap, 0.0) * left
        odds = np.where(odds.any(1, keepdims=True), odds, left)
        reach = np.cumsum(odds, axis=1)
        chosen = (reach <= chance[:, step, None] * reach[:, -1:]).sum(1)
        picked[:, step] = chosen
        left[rows, chosen] = 0.0
        gap = np.minimum(gap, distance[chosen]) if step else distance[chosen]
    return picked


def spread_seeds_reference(
    distance: Float[np.ndarray, "T T"], chance: Float[np.ndarray, " K"]
) -> list[int]:
    """The same for one repeat, pick by pick: slow and obvious."""
    tiny = SAME * float(distance.max())
    picked: list[int] = []
    for number in chance:
        rest = [frame for frame in range(len(distance)) if frame not in picked]
        gaps = [min((distance[frame, p] for p in picked), default=0.0) for frame in rest]
        odds = [gap if gap > tiny else 0.0 for gap in gaps]
        odds = odds if any(odds) else [1.0] * len(rest)
        mark, reached = number * sum(odds), 0.0
        for frame, odd in zip(rest, odds, strict=True):
            reached += odd
            if reached > mark:
                picked.append(frame)
                break
    return picked

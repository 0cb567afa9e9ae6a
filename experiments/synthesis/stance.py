"""Which foot stands when, and how far it slides: the skating term of the refinement."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

SPEED_RATIO = 1.6
"""A foot stands while the other ankle is this many times faster (published value)."""
SWING_HEIGHT_WEIGHT = 0.05


@dataclass(frozen=True)
class Stances:
    """The stances of a sequence. Axis 2: left, right."""

    standing: Bool[Tensor, "T 2"]
    average: Float[Tensor, "2 T T"]
    """Row t averages over the frames of the stance that frame t belongs to; zero without one."""


def find_stances(ankles: Float[Tensor, "T 2 3"]) -> Stances:
    """Compare the ankles' speeds frame by frame; a run of frames with one standing foot is a stance."""
    steps = (ankles[1:] - ankles[:-1]).norm(dim=-1)
    speed = torch.cat([steps, steps[-1:]])
    standing = speed * SPEED_RATIO < speed.flip(-1)
    return Stances(standing, torch.stack([_averages(foot, ankles.dtype) for foot in standing.T]))


def skating(
    ankles: Float[Tensor, "T 2 3"],
    toes: Float[Tensor, "T 2 3"],
    stances: Stances,
    floor_z: float,
) -> Float[Tensor, ""]:
    """Mean squared distance (m²) of the standing ankles from the means of their stances, plus 0.05
    times the mean height (m) of the swinging feet's toe joints over the floor.
    """
    means = torch.einsum("fts,sfc->tfc", stances.average, ankles)
    held = (ankles - means).square().sum(-1)[stances.standing]
    swinging = stances.standing.flip(-1)
    height = (toes[..., 2] - floor_z).clamp(min=0.0)[swinging]
    count = stances.standing.sum().clamp(min=1)
    return (held.sum() + SWING_HEIGHT_WEIGHT * height.sum()) / count


def _averages(standing: Bool[Tensor, " T"], dtype: torch.dtype) -> Float[Tensor, "T T"]:
    stance = torch.cumsum(
        (standing & ~torch.roll(standing, 1).index_fill(0, _ZERO, False)).int(), 0
    )
    same = (stance[:, None] == stance[None]) & standing[:, None] & standing[None]
    weight = same.to(dtype)
    return weight / weight.sum(1, keepdim=True).clamp(min=1.0)


_ZERO = torch.tensor([0])

"""Which foot stands when, and what sliding costs: the skating term of the refinement.

After the published code of Wang et al. (CVPR 2021), which fixes stances once and holds each standing
foot to where it stood on average.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Integer
from torch import Tensor

SPEED_RATIO = 1.6
"""A foot stands while the other ankle's squared step is this many times longer (published value)."""
HEIGHT_WEIGHT = 0.05
LEFT, RIGHT, UNKNOWN = 0, 1, -1

Soles = tuple[Float[Tensor, "T L 3"], Float[Tensor, "T R 3"]]
"""Vertices of both soles over time, metres."""


@dataclass(frozen=True)
class Stance:
    """Frames in which one foot stands."""

    start: int
    stop: int
    """Exclusive."""
    side: int
    place: Float[Tensor, "F 3"]
    """Where the vertices of its sole were on average, metres; no gradient."""
    lift: float
    """Height of the higher ankle at its highest in the stance, metres: what the swinging one keeps."""


def find_stances(ankles: Float[Tensor, "T 2 3"], soles: Soles) -> tuple[Stance, ...]:
    """The stances of a sequence, one after the other; none where the feet never differ in speed."""
    sides = standing_sides(ankles.detach().numpy())
    if sides[0] == UNKNOWN:
        return ()
    borders = [0, *(np.flatnonzero(np.diff(sides)) + 1).tolist(), len(sides)]
    found = []
    for start, stop in itertools.pairwise(borders):
        side = int(sides[start])
        place = soles[side][start:stop].detach().mean(dim=0)
        found.append(Stance(start, stop, side, place, float(ankles[start:stop, :, 2].max())))
    return tuple(found)


def standing_sides(ankles: Float[np.ndarray, "T 2 3"]) -> Integer[np.ndarray, " T"]:
    """Which foot stands in every frame: `LEFT`, `RIGHT`, or `UNKNOWN` for all if no frame tells.

    A foot stands where the other ankle's squared displacement to the next frame, and that over two
    frames, are both more than `SPEED_RATIO` times its own. Frames that do not tell take the side of
    their neighbours; between two sides the change falls into the middle.
    """
    step = ((ankles[2:] - ankles[1:-1]) ** 2).mean(axis=-1)
    stride = ((ankles[2:] - ankles[:-2]) ** 2).mean(axis=-1)
    sides = np.full(len(ankles), UNKNOWN)
    for side in (LEFT, RIGHT):
        slower = (SPEED_RATIO * step[:, side] < step[:, 1 - side]) & (
            SPEED_RATIO * stride[:, side] < stride[:, 1 - side]
        )
        sides[1:-1][slower] = side
    known = np.flatnonzero(sides != UNKNOWN)
    if not len(known):
        return sides
    for before, after in itertools.pairwise(known):
        middle = (before + after) // 2 if sides[before] != sides[after] else after
        sides[before:middle], sides[middle:after] = sides[before], sides[after]
    sides[: known[0]], sides[known[-1] :] = sides[known[0]], sides[known[-1]]
    return sides


def skating(
    ankles: Float[Tensor, "T 2 3"], soles: Soles, stances: tuple[Stance, ...]
) -> Float[Tensor, ""]:
    """Squared distance of standing soles from their places, summed over frames, m².

    A foot is held to the place of its stance from one frame before the stance on, and in the middle
    of each stance 0.05 times the squared lag of the swinging ankle behind the stance's lift is added.
    """
    total = ankles.new_zeros(())
    for index, stance in enumerate(stances):
        start = stance.start - 1 if index else stance.start
        sole = soles[stance.side][start : stance.stop]
        total = total + (sole - stance.place).square().mean(dim=(1, 2)).sum()
        middle = (stance.start + stance.stop) // 2
        lag = ankles[middle, 1 - stance.side, 2] - stance.lift
        total = total + HEIGHT_WEIGHT * lag.square()
    return total

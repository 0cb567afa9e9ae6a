"""Sub-goals: the root states that a synthesised sequence passes, drawn at random from a room's spots."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from experiments.synthesis.spots import Kind, RoomSpots, Spot, upright

STEP_M = (0.5, 2.5)
"""Horizontal distance of neighbouring sub-goals, metres: what two seconds of training data cover."""
ATTEMPTS = 200


class NoSubgoals(ValueError):
    """A room does not offer what a sequence of sub-goals needs; the text says what."""


def choose_subgoals(spots: RoomSpots, count: int, rng: np.random.Generator) -> tuple[Spot, ...]:
    """Draw `count` (two or more) sub-goals, 2 s apart.

    The first and the last stand in free space; in between, furniture and free space take turns,
    furniture first. With two, the last is the one at furniture. Pieces of furniture and kinds of
    contact are drawn with equal chances, whatever the paired clip shows. Raises `NoSubgoals`.
    """
    if not len(spots.free):
        raise NoSubgoals("the room has no free floor to stand on")
    if not spots.furniture:
        raise NoSubgoals("nothing in the room affords sitting, lying or touching")
    for _ in range(ATTEMPTS):
        chosen = _draw(spots, count, rng)
        if chosen is not None:
            return chosen
    wanted = f"{STEP_M[0]} to {STEP_M[1]} m apart"
    raise NoSubgoals(f"no {count} sub-goals {wanted} were found in {ATTEMPTS} draws")


def at_furniture(index: int, count: int) -> bool:
    """Whether sub-goal `index` of `count` is one at furniture."""
    return index % 2 == 1 and (index < count - 1 or count == 2)


def _draw(spots: RoomSpots, count: int, rng: np.random.Generator) -> tuple[Spot, ...] | None:
    """One try: furniture first, then standing places within reach of their neighbours."""
    chosen: list[Spot | None] = [
        _furniture(spots, rng) if at_furniture(index, count) else None for index in range(count)
    ]
    for index, spot in enumerate(chosen):
        if spot is None:
            near = [
                chosen[i]
                for i in (index - 1, index + 1)
                if 0 <= i < count and chosen[i] is not None
            ]
            places = _within_reach(spots.free, [item.pelvis[:2] for item in near if item])
            if not len(places):
                return None
            position = places[rng.integers(len(places))]
            chosen[index] = _standing(position, 0.0, spots.standing_z)
    return _facing([spot for spot in chosen if spot is not None], spots.standing_z)


def _furniture(spots: RoomSpots, rng: np.random.Generator) -> Spot:
    keys: list[tuple[str, Kind]] = list(spots.furniture)
    group = spots.furniture[keys[rng.integers(len(keys))]]
    return group[rng.integers(len(group))]


def _within_reach(
    free: Float[np.ndarray, "N 2"], neighbours: list[Float[np.ndarray, "2"]]
) -> Float[np.ndarray, "M 2"]:
    good = np.ones(len(free), dtype=bool)
    for position in neighbours:
        distance = np.linalg.norm(free - position, axis=1)
        good &= (distance > STEP_M[0]) & (distance < STEP_M[1])
    return free[good]


def _facing(chosen: list[Spot], standing_z: float) -> tuple[Spot, ...]:
    """Who stands in free space looks where he goes, and at the end where he went."""
    turned = []
    for index, spot in enumerate(chosen):
        if spot.kind == "stand":
            first = min(index, len(chosen) - 2)
            way = chosen[first + 1].pelvis - chosen[first].pelvis
            yaw = float(np.arctan2(way[0], -way[1]))
            spot = _standing(spot.pelvis[:2], yaw, standing_z)
        turned.append(spot)
    return tuple(turned)


def _standing(position: Float[np.ndarray, "2"], yaw: float, standing_z: float) -> Spot:
    return Spot("stand", "floor", np.array([*position, standing_z]), upright(yaw))

"""Rooms that motion synthesis learns in: variations of the training rooms, and rooms drawn at random.

The two training rooms have no bed and no sofa; the random ones do, and floor to walk on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from experiments.scene.baking import bake_layout
from experiments.scene.furnish import furnish
from experiments.scene.layout import Item, Layout, read_layout
from experiments.scene.pack import default_pack
from experiments.scene.rooms import TRAINING_ROOMS
from experiments.scene.scene import MPCAT40, Scene

Split = Literal["train", "held_out"]

CELL = 0.04
"""Metres between the nodes of the distance volumes: a training room need not be finer."""
RANDOM_PREFIX = "random"


@dataclass(frozen=True)
class RoomRecord:
    """One room of the training data, by the name it can be made again from."""

    name: str
    split: Split


@dataclass(frozen=True)
class _Furniture:
    """Something the random rooms may hold: where it stands and how much room it wants in front."""

    asset: str
    label: str
    size: tuple[float, float]
    """Width and depth, metres; the front looks along -y."""
    at_wall: bool
    front: float
    seat: tuple[float, float] | None = None


_KINDS: tuple[tuple[_Furniture, ...], ...] = (
    (
        _Furniture("bed_88", "bed", (2.01, 2.28), True, 0.5, (0.46, 0.56)),
        _Furniture("sofa_132", "sofa", (1.67, 0.75), True, 0.7, (0.41, 0.46)),
        _Furniture("winchester_sofa_140", "sofa", (2.32, 0.94), True, 0.7, (0.41, 0.46)),
        _Furniture("couch_95", "sofa", (2.07, 0.88), True, 0.7, (0.41, 0.46)),
    ),
    (
        _Furniture("armchair_1", "chair", (0.59, 0.63), False, 0.7, (0.42, 0.48)),
        _Furniture("chair_114", "chair", (0.40, 0.49), False, 0.7, (0.42, 0.48)),
        _Furniture("osaka_chair_125", "chair", (0.48, 0.52), False, 0.7, (0.42, 0.48)),
        _Furniture("chair_31", "chair", (0.45, 0.58), False, 0.7, (0.42, 0.48)),
        _Furniture("piano_bench_159", "stool", (0.62, 0.35), False, 0.7, (0.42, 0.50)),
    ),
    (
        _Furniture("desk_152", "table", (1.60, 0.80), True, 0.6),
        _Furniture("oak_table_27", "table", (1.24, 1.24), False, 0.3),
        _Furniture("wardrobe_68", "cabinet", (2.00, 0.66), True, 0.6),
        _Furniture("high_cabinet_146", "cabinet", (0.60, 0.61), True, 0.6),
        _Furniture("shelves_39", "cabinet", (0.79, 0.39), True, 0.5),
        _Furniture("vertical_shelves_61", "shelving", (0.44, 0.39), True, 0.5),
    ),
)
_COUNTS = ((1, 3), (2, 5), (2, 5))
"""Fewest pieces and one more than the most, for each of the three groups."""
_TRIES = 60
_GAP = 0.04


def room_records(n_train: int, n_held_out: int, seed: int) -> tuple[RoomRecord, ...]:
    """Names of the rooms of both splits: by turns a random room and a variation of a training room.

    No name occurs twice, so the splits are disjoint.
    """
    records = []
    for index in range(n_train + n_held_out):
        split: Split = "train" if index < n_train else "held_out"
        number = 1000 * (seed + 1) + index
        base = TRAINING_ROOMS[index // 2 % len(TRAINING_ROOMS)]
        name = f"{RANDOM_PREFIX}_{number}" if index % 2 == 0 else f"{base}_v{number}"
        records.append(RoomRecord(name, split))
    return tuple(records)


def training_scene(name: str) -> Scene:
    """The room of that name, furnished and baked (from the cache after the first time)."""
    layout = random_layout(int(name.split("_")[1])) if _is_random(name) else read_layout(name)
    return bake_layout(layout, furnish(layout), CELL)


def random_layout(seed: int) -> Layout:
    """An empty room of 4 to 6 m a side with a bed or sofa or two, seats, tables and cabinets.

    Pieces are drawn one after another and kept where their footprint, with free floor before its
    front, meets no other footprint. The same seed gives the same room.
    """
    rng = np.random.default_rng([seed, 62])
    width, depth = (float(side) for side in rng.uniform(4.0, 6.0, 2))
    items: list[Item] = []
    taken: list[tuple[float, float, float, float]] = []
    for kinds, (fewest, most) in zip(_KINDS, _COUNTS, strict=True):
        for _ in range(int(rng.integers(fewest, most))):
            kind = kinds[int(rng.integers(len(kinds)))]
            found = _find_place(kind, (width, depth), taken, rng)
            if found is not None:
                x, y, yaw, box = found
                taken.append(box)
                items.append(_item(f"piece{len(items)}", kind, x, y, yaw, rng))
    tint, wall = (0.55, 0.5, 0.45), (0.8, 0.8, 0.78)
    name = f"{RANDOM_PREFIX}_{seed}"
    return Layout(name, (width, depth, 2.6), "wood", tint, wall, (), tuple(items))


def _is_random(name: str) -> bool:
    return name.startswith(f"{RANDOM_PREFIX}_")


def _item(
    name: str, kind: _Furniture, x: float, y: float, yaw: float, rng: np.random.Generator
) -> Item:
    seat = None if kind.seat is None else float(rng.uniform(*kind.seat))
    default_pack().piece(kind.asset)
    return Item(name, MPCAT40.index(kind.label), x, y, yaw, piece=kind.asset, seat=seat)


def _find_place(
    kind: _Furniture,
    size: tuple[float, float],
    taken: list[tuple[float, float, float, float]],
    rng: np.random.Generator,
) -> tuple[float, float, float, tuple[float, float, float, float]] | None:
    """Position, yaw in degrees and footprint box with its free front; None if nothing was found."""
    for _ in range(_TRIES):
        quarter = int(rng.integers(4))
        half = np.array(kind.size[::-1] if quarter % 2 else kind.size) / 2 + _GAP
        back = np.array([(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)][quarter])
        low, high = half, np.array(size) - half
        if np.any(low >= high):
            continue
        centre = rng.uniform(low, high)
        if kind.at_wall:
            centre = np.where(back > 0, high, np.where(back < 0, low, centre))
        lower, upper = centre - half, centre + half
        lower, upper = lower - kind.front * (back > 0), upper + kind.front * (back < 0)
        box = (float(lower[0]), float(lower[1]), float(upper[0]), float(upper[1]))
        if _inside(box, size) and not any(_overlap(box, other) for other in taken):
            return float(centre[0]), float(centre[1]), 90.0 * quarter, box
    return None


def _inside(box: tuple[float, float, float, float], size: tuple[float, float]) -> bool:
    return box[0] >= 0 and box[1] >= 0 and box[2] <= size[0] and box[3] <= size[1]


def _overlap(
    one: tuple[float, float, float, float], two: tuple[float, float, float, float]
) -> bool:
    return one[0] < two[2] and two[0] < one[2] and one[1] < two[3] and two[1] < one[3]

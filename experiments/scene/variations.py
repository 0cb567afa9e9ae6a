"""Seeded variations of a room, so that learned models see more than the rooms that were drawn.

A variation may mirror the room, exchange pieces for others of their class, shift and turn what
stands free, recolour, take clutter away and drop new clutter on tops. It passes the same checks as
the room: whatever causes a fault is put back until none is left.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from experiments.scene.furnish import furnish
from experiments.scene.layout import Colour, Item, Layout, Opening, Wall
from experiments.scene.layout_checks import LayoutReport, check_layout
from experiments.scene.pack import Pack, default_pack
from experiments.scene.scene import MPCAT40
from renderer.files import InputError

FAMILIES: tuple[tuple[str, ...], ...] = (
    ("chair_with_cushion_108", "oak_chair_26", "chair_31", "chair_79", "chair_114",
     "osaka_chair_125", "chair_143", "chair_171"),
    ("plant_126", "decorative_plant_113"),
    ("sofa_132", "winchester_sofa_140", "couch_95"),
)  # fmt: skip
"""Pieces that may stand in for one another."""
CLUTTER: tuple[tuple[str, str, str], ...] = (
    ("objects", "piece", "coffee_cup_9"), ("objects", "piece", "milk_53"),
    ("objects", "piece", "bread_90"), ("objects", "piece", "calendar_81"),
    ("objects", "shape", "bookstack"), ("objects", "shape", "papers"),
    ("objects", "shape", "laptop"), ("objects", "shape", "vase"),
    ("objects", "shape", "bowl"), ("objects", "shape", "glass"),
    ("objects", "shape", "pen_cup"), ("plant", "piece", "cactus_107"),
    ("plant", "piece", "little_plant_77"),
)  # fmt: skip
TINTS: tuple[Colour, ...] = (
    (0.56, 0.48, 0.38), (0.46, 0.48, 0.40), (0.52, 0.38, 0.30), (0.60, 0.57, 0.52),
    (0.40, 0.36, 0.33), (0.55, 0.52, 0.42),
)  # fmt: skip
_SHIFT, _TURN = 0.08, 12.0
"""Metres and degrees: standard bounds of the jitter."""
_ROUNDS = 12


def vary(layout: Layout, seed: int, pack: Pack | None = None) -> Layout:
    """A sound variation of a sound layout, named `<room>_v<seed>`; the same seed gives the same.

    Raises InputError when the layout itself does not pass the checks.
    """
    pack = pack or default_pack()
    rng = np.random.default_rng([seed, 20_26])
    base = replace(layout, name=f"{layout.name}_v{seed}")
    base = mirrored(base) if rng.random() < 0.5 else base
    floor, walls = _shaded(base.floor_tint, rng), _shaded(base.wall_colour, rng)
    base = replace(base, floor_tint=floor, wall_colour=walls)
    changed = _changed(base, rng, pack)
    return _made_sound(base, changed, pack)


def mirrored(layout: Layout) -> Layout:
    """The room seen in a mirror on its east wall: x turned round, pieces mirrored with it."""
    width = layout.size[0]
    return replace(
        layout,
        openings=tuple(_mirrored_opening(opening, width) for opening in layout.openings),
        items=tuple(
            replace(
                item,
                x=width - item.x,
                yaw=-item.yaw,
                scale=(-item.scale[0], item.scale[1], item.scale[2]),
                wall=_SWAPPED.get(item.wall, item.wall) if item.wall else None,
            )
            for item in layout.items
        ),
    )


_SWAPPED: Mapping[Wall, Wall] = {"e": "w", "w": "e"}


def _mirrored_opening(opening: Opening, width: float) -> Opening:
    wall = _SWAPPED.get(opening.wall, opening.wall)
    if opening.wall in "ns":
        return replace(opening, u0=width - opening.u1, u1=width - opening.u0)
    return replace(opening, wall=wall)


def _shaded(colour: Colour, rng: np.random.Generator) -> Colour:
    """A little lighter or darker, a little warmer or cooler."""
    red, green, blue = np.array(colour) * rng.uniform(0.9, 1.06) * rng.uniform(0.97, 1.03, 3)
    return (min(float(red), 0.86), min(float(green), 0.86), min(float(blue), 0.86))


def _changed(base: Layout, rng: np.random.Generator, pack: Pack) -> dict[str, Item | None]:
    """New items by id, None where one is taken away; ids that `base` lacks are dropped on top."""
    changes: dict[str, Item | None] = {}
    stand_ins = _stand_ins(base, rng)
    carries = {item.on for item in base.items}
    for item in base.items:
        new = item
        if item.piece in stand_ins and item.on is None:
            piece, tint = stand_ins[item.piece]
            new = _exchanged(new, piece, pack)
            new = replace(new, tint=tint) if new.seat else new
        if _free_standing(item):
            shift = rng.uniform(-_SHIFT, _SHIFT, 2)
            new = replace(
                new,
                x=new.x + shift[0],
                y=new.y + shift[1],
                yaw=new.yaw + rng.uniform(-_TURN, _TURN),
            )
        if "seed" in new.params or new.shape in ("bookcase", "bookstack", "picture"):
            new = replace(new, params={**new.params, "seed": int(rng.integers(1 << 30))})
        small = item.on is not None or MPCAT40[item.label] in ("objects", "clothes")
        gone = small and item.id not in carries and item.wall is None and rng.random() < 0.2
        changes[item.id] = None if gone else new
    return changes | _dropped(base, rng)


def _stand_ins(base: Layout, rng: np.random.Generator) -> dict[str | None, tuple[str, Colour]]:
    """One stand-in and tint for every piece that has a family: equal chairs stay equal."""
    chosen: dict[str | None, tuple[str, Colour]] = {}
    for piece in dict.fromkeys(item.piece for item in base.items):
        for family in FAMILIES:
            if piece in family:
                tint = TINTS[int(rng.integers(len(TINTS)))]
                chosen[piece] = family[int(rng.integers(len(family)))], tint
    return chosen


def _exchanged(item: Item, piece: str, pack: Pack) -> Item:
    """Another piece, made no wider and deeper than the one that it replaces."""
    if piece == item.piece:
        return item
    old, new = (np.ptp(pack.piece(name).points(), axis=0) for name in (str(item.piece), piece))
    share = min(1.0, *(abs(item.scale[k]) * old[k] / new[k] for k in (0, 1)))
    side = -1.0 if item.scale[0] < 0 else 1.0
    return replace(item, piece=piece, scale=(side * share, share, min(1.0, 1.1 * share)))


def _free_standing(item: Item) -> bool:
    """Chairs, stools, plants and things on the floor; what stands along walls stays there."""
    loose = ("chair", "stool", "plant", "objects", "clothes")
    return item.on is None and item.wall is None and MPCAT40[item.label] in loose


def _dropped(base: Layout, rng: np.random.Generator) -> dict[str, Item | None]:
    """New clutter on tables, cabinets and counters."""
    tops = [
        item
        for item in base.items
        if item.on is None
        and item.wall is None
        and MPCAT40[item.label] in ("table", "cabinet", "counter")
    ]
    added: dict[str, Item | None] = {}
    for index in range(int(rng.integers(2, 7)) if tops else 0):
        support = tops[int(rng.integers(len(tops)))]
        name, kind, asset = CLUTTER[int(rng.integers(len(CLUTTER)))]
        x, y = rng.uniform(-0.35, 0.35, 2)
        added[f"dropped{index}"] = Item(
            id=f"dropped{index}",
            label=MPCAT40.index(name),
            x=support.x + float(x),
            y=support.y + float(y),
            yaw=float(rng.uniform(-180, 180)),
            piece=asset if kind == "piece" else None,
            shape=asset if kind == "shape" else None,
            on=support.id,
        )
    return added


def _made_sound(base: Layout, changes: dict[str, Item | None], pack: Pack) -> Layout:
    """Take back the changes that cause faults, round by round, until the room is sound."""
    original = {item.id: item for item in base.items}
    for _ in range(_ROUNDS):
        changes = {name: item for name, item in changes.items() if _stands(item, base, pack)}
        varied = _applied(base, changes)
        report, _ = check_layout(varied.name, varied.size, furnish(varied, pack))
        if not report.faults():
            return varied
        culprits = _culprits(report)
        culprits |= {item.on for item in varied.items if item.id in culprits and item.on}
        kept = {
            name: item
            for name, item in changes.items()
            if (culprits and name not in culprits) or (not culprits and name not in original)
        }
        if kept == changes:
            break
        changes = kept
    raise InputError(base.name, "layout", report.faults()[0], "a room that passes the checks")


def _stands(item: Item | None, base: Layout, pack: Pack) -> bool:
    """Whether dropped clutter has its support under it."""
    if item is None or not item.id.startswith("dropped"):
        return True
    support = base.item(str(item.on))
    try:
        furnish(replace(base, items=(replace(support, on=None), item)), pack)
    except InputError:
        return False
    return True


def _applied(base: Layout, changes: dict[str, Item | None]) -> Layout:
    """The layout with its changes; what stands on something that moved moves along."""
    before = {item.id: item for item in base.items}
    items: dict[str, Item] = {}
    for name, item in {**before, **changes}.items():
        if item is None or (item.on is not None and item.on not in items):
            continue
        support = before.get(item.on or "")
        items[name] = item if support is None else _carried(item, support, items[support.id])
    return replace(base, items=tuple(items.values()))


def _carried(item: Item, before: Item, after: Item) -> Item:
    """The item moved and turned with its support."""
    turn = np.radians(after.yaw - before.yaw)
    dx, dy = item.x - before.x, item.y - before.y
    x = after.x + np.cos(turn) * dx - np.sin(turn) * dy
    y = after.y + np.sin(turn) * dx + np.cos(turn) * dy
    return replace(item, x=float(x), y=float(y), yaw=item.yaw + after.yaw - before.yaw)


def _culprits(report: LayoutReport) -> set[str]:
    """Objects that cause a fault of their own; empty when only the whole is at fault."""
    found = {name for o in report.overlaps if o.depth > o.allowed for name in (o.a, o.b)}
    found |= {*report.floating, *report.outside, *report.wrong_seats}
    return found | (set(report.unreached) if len(report.unreached) > 2 else set())

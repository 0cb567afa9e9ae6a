"""Parametric furniture: tables, benches, bookcases, office pieces, lamps, curtains, rugs.

Every function takes keyword parameters only, in metres and sRGB colours, and returns the parts of
one piece in its own frame: footprint centred on the origin, standing on z = 0, front towards -y.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from experiments.scene.parametric_primitives import (
    Colour,
    ShapePart,
    Triangles,
    box,
    cylinder,
    lathe,
    moved,
    part,
    sheet,
    superellipsoid,
    tube,
    turned,
)

Size3 = tuple[float, float, float]
Size2 = tuple[float, float]

WOOD: Colour = (0.52, 0.38, 0.26)
DARK: Colour = (0.20, 0.20, 0.21)
METAL: Colour = (0.58, 0.59, 0.60)
BOOKS: tuple[Colour, ...] = (
    (0.48, 0.22, 0.20), (0.24, 0.32, 0.42), (0.30, 0.38, 0.31), (0.62, 0.52, 0.38),
    (0.36, 0.28, 0.24), (0.70, 0.66, 0.58), (0.42, 0.44, 0.48), (0.56, 0.36, 0.24),
    (0.28, 0.24, 0.32), (0.52, 0.48, 0.30), (0.34, 0.46, 0.48), (0.76, 0.72, 0.64),
)  # fmt: skip
PAGES: Colour = (0.80, 0.77, 0.69)


def table(
    *,
    size: Size3 = (1.2, 0.8, 0.74),
    top: float = 0.035,
    colour: Colour = WOOD,
    pedestal: bool = False,
    shelf: bool = False,
) -> tuple[ShapePart, ...]:
    """A table on four legs or on one pedestal, with or without a lower shelf."""
    width, depth, height = size
    board = box((width, depth, top), (0, 0, height - top), bevel=0.006)
    if pedestal:
        return part(colour, board), part(DARK, *_pedestal(width, depth, height - top))
    leg = min(0.06, 0.12 * min(width, depth))
    x, y = width / 2 - leg, depth / 2 - leg
    solids = [box((leg, leg, height - top), (sx * x, sy * y, 0), bevel=0.004) for sx, sy in _SIGNS]
    apron = min(0.07, 0.2 * height)
    for side in (-1, 1):
        solids.append(box((2 * x, 0.018, apron), (0, side * y, height - top - apron)))
        solids.append(box((0.018, 2 * y, apron), (side * x, 0, height - top - apron)))
    if shelf:
        solids.append(box((2 * x, 2 * y, 0.02), (0, 0, 0.28 * height), bevel=0.004))
    return (part(colour, board, *solids),)


def _pedestal(width: float, depth: float, height: float) -> list[Triangles]:
    foot = 0.62 * min(width, depth) if width < 1.5 * depth else 0.75 * depth
    return [
        box((foot, foot, 0.025), bevel=0.008),
        cylinder(0.04, height - 0.035, (0, 0, 0.02), 16),
        box((0.5 * width, 0.08, 0.02), (0, 0, height - 0.02)),
        box((0.08, 0.5 * depth, 0.02), (0, 0, height - 0.02)),
    ]


def armchair(
    *,
    size: Size3 = (0.80, 0.82, 0.84),
    seat: float = 0.43,
    colour: Colour = (0.52, 0.49, 0.42),
    legs: Colour = (0.34, 0.25, 0.18),
) -> tuple[ShapePart, ...]:
    """An upholstered armchair: padded seat between two arms, a leaning back, short wooden legs."""
    width, depth, height = size
    foot, arm, back = 0.12, 0.15, 0.19
    x, y = width / 2 - 0.07, depth / 2 - 0.07
    feet = [cylinder(0.016, foot + 0.02, (sx * x, sy * y, 0), 10, 0.026) for sx, sy in _SIGNS]
    body = box((width - 0.04, depth - 0.06, seat - 0.24), (0, 0, foot), bevel=0.02)
    arms = [
        superellipsoid((arm, depth - 0.03, 0.60 - foot), (s * (width - arm) / 2, -0.01, foot), 0.28, 0.25, 24)
        for s in (-1, 1)
    ]  # fmt: skip
    pad = (width - 2 * arm + 0.02, depth - back - 0.04, 0.18)
    seat_pad = superellipsoid(pad, (0, -back / 2 - 0.02, seat - 0.18), 0.22, 0.2, 24)
    rest = superellipsoid(
        (width - 0.03, back, height - foot), (0, (depth - back) / 2 - 0.02, foot), 0.32, 0.3, 24
    )
    lean = turned(rest, "x", -5, (0, depth / 2, foot))
    cushion = superellipsoid(
        (pad[0] - 0.02, 0.15, 0.42), (0, depth / 2 - back - 0.05, seat - 0.03), 0.45, 0.35, 20
    )
    leaning = turned(cushion, "x", -12, (0, depth / 2 - back, seat))
    return part(colour, body, *arms, seat_pad, lean, leaning), part(legs, *feet)


def bench(
    *,
    size: Size3 = (1.3, 0.62, 1.1),
    seat: float = 0.46,
    colour: Colour = (0.46, 0.24, 0.20),
    frame: Colour = (0.38, 0.27, 0.19),
) -> tuple[ShapePart, ...]:
    """An upholstered booth bench: closed wooden frame, padded seat, back of upright channels."""
    width, depth, height = size
    cushion, back = 0.11, 0.06
    base = [
        box((width - 0.06, depth - 0.10, 0.09), (0, 0.03, 0)),
        box((width, depth - 0.02, seat - cushion - 0.09), (0, 0.01, 0.09), bevel=0.008),
        box((width, back, height), (0, depth / 2 - back / 2, 0), bevel=0.008),
        box((width + 0.02, back + 0.03, 0.03), (0, depth / 2 - back / 2, height - 0.015), bevel=0.008),
    ]  # fmt: skip
    n_pads = max(2, round((width - 0.06) / 0.45))
    pad = (width - 0.04) / n_pads
    lefts = -(width - 0.04) / 2 + pad * (np.arange(n_pads) + 0.5)
    seats = [
        superellipsoid((pad - 0.004, depth - back, cushion), (x, -back / 2, seat - cushion), 0.18, 0.18, 16)
        for x in lefts
    ]  # fmt: skip
    return (
        part(frame, *base),
        part(colour, *seats, *_channels(width - 0.06, seat, height - 0.05, depth / 2 - back)),
    )


def _channels(width: float, low: float, high: float, y: float) -> list[Triangles]:
    """Upright padded rolls side by side, leaning on the plane y."""
    n = max(3, round(width / 0.16))
    roll = width / n
    xs = -width / 2 + roll * (np.arange(n) + 0.5)
    return [
        superellipsoid((roll, 0.11, high - low + 0.03), (x, y - 0.035, low - 0.03), 0.25, 0.8, 12)
        for x in xs
    ]


def bookcase(
    *,
    size: Size3 = (0.9, 0.32, 2.0),
    shelves: int = 6,
    fill: float = 0.9,
    seed: int = 0,
    colour: Colour = (0.44, 0.32, 0.22),
) -> tuple[ShapePart, ...]:
    """A full bookcase: rows of coloured books, some leaning back, some lying in a pile."""
    width, depth, height = size
    board = 0.022
    case = [
        box((board, depth, height), (-(width - board) / 2, 0, 0)),
        box((board, depth, height), ((width - board) / 2, 0, 0)),
        box((width, depth, board), (0, 0, height - board)),
        box((width - board, 0.01, height), (0, depth / 2 - 0.005, 0)),
        box((width - 2 * board, depth - 0.02, 0.06), (0, 0.005, 0)),
    ]
    floors = 0.06 + (height - 0.06 - board) / shelves * np.arange(shelves)
    case += [box((width - 2 * board, depth - 0.015, board), (0, 0, z)) for z in floors]
    gap = float(floors[1] - floors[0]) - board if shelves > 1 else height - 0.1
    rng = np.random.default_rng(seed)
    inside = (width - 2 * board - 0.01, depth - 0.05, gap)
    rows = [_book_row(inside, fill, rng, float(z) + board) for z in floors]
    books = np.concatenate([corners for corners, _ in rows])
    colours = np.concatenate([tints for _, tints in rows])
    return part(colour, *case), ShapePart(books, WOOD, vertex_colours=colours)


def _book_row(
    room: Size3, fill: float, rng: np.random.Generator, z: float
) -> tuple[Triangles, Float[np.ndarray, "F 3 3"]]:
    """Upright books from the left until the shelf is filled to the wanted share."""
    width, depth, gap = room
    x, end = -width / 2, -width / 2 + width * min(1.0, fill + rng.uniform(-0.08, 0.08))
    series = 0
    spine, tall, tint = 0.03, 0.7, BOOKS[0]
    soups, tints = [], []
    while True:
        if series == 0:
            series = int(rng.integers(1, 5))
            spine, tall = rng.uniform(0.018, 0.05), rng.uniform(0.58, 0.93)
            tint = BOOKS[int(rng.integers(len(BOOKS)))]
        if x + spine > end:
            break
        deep = depth * rng.uniform(0.72, 0.9)
        size = (spine - 0.0015, deep, min(gap * tall, 0.34))
        soups.append(box(size, (x + spine / 2, -depth / 2 + 0.015 + deep / 2, z)))
        tints.append(book_colours(soups[-1], tint))
        x += spine
        series -= 1
    return np.concatenate(soups), np.concatenate(tints)


def book_colours(book: Triangles, tint: Colour, paper: str = "+z") -> Float[np.ndarray, "F 3 3"]:
    """Cover colour everywhere, paper on the cut edge that looks along `paper`."""
    normal = np.cross(book[:, 1] - book[:, 0], book[:, 2] - book[:, 0])
    axis, sign = "xyz".index(paper[1]), 1.0 if paper[0] == "+" else -1.0
    cut = sign * normal[:, axis] > 0.9 * np.linalg.norm(normal, axis=1)
    colours = np.where(cut[:, None], np.array(PAGES), np.array(tint))
    return np.repeat(colours[:, None], 3, axis=1)


def drawers(
    *, size: Size3 = (0.44, 0.55, 0.62), n: int = 3, colour: Colour = (0.70, 0.70, 0.68)
) -> tuple[ShapePart, ...]:
    """A pedestal of drawers with bar handles."""
    width, depth, height = size
    front = (height - 0.08) / n
    faces = [
        box((width - 0.01, 0.02, front - 0.008), (0, -depth / 2 + 0.01, 0.06 + k * front), bevel=0.003)
        for k in range(n)
    ]  # fmt: skip
    body = box((width, depth - 0.02, height - 0.04), (0, 0.01, 0.04), bevel=0.004)
    plinth = box((width - 0.06, depth - 0.08, 0.04), (0, 0.01, 0))
    handles = [
        box((0.3 * width, 0.018, 0.012), (0, -depth / 2 - 0.009, 0.06 + (k + 0.72) * front))
        for k in range(n)
    ]
    return part(colour, body, *faces), part(METAL, *handles), part(DARK, plinth)


def swivel(*, seat: float = 0.46, colour: Colour = (0.27, 0.27, 0.28)) -> tuple[ShapePart, ...]:
    """An office swivel chair: five-star foot with castors, padded seat and back, arm rests."""
    foot = [cylinder(0.035, 0.10, (0, 0, 0.05), 14), cylinder(0.026, seat - 0.2, (0, 0, 0.12), 12)]
    castors = []
    for angle in np.radians(90 + 72 * np.arange(5)):
        tip = (0.28 * np.cos(angle), 0.28 * np.sin(angle))
        foot.append(tube((0, 0, 0.10), (*tip, 0.065), 0.018, 8))
        castors.append(superellipsoid((0.055, 0.055, 0.055), (*tip, 0), 1.0, 1.0, 10))
    seat_pad = superellipsoid((0.49, 0.47, 0.09), (0, 0, seat - 0.085), 0.45, 0.45, 24)
    back = turned(superellipsoid((0.44, 0.08, 0.52), (0, 0.21, seat + 0.10), 0.5, 0.5, 24), "x", -6)
    frame = [
        box((0.24, 0.24, 0.03), (0, 0, seat - 0.105)),
        tube((0, 0.14, seat - 0.09), (0, 0.30, seat + 0.02), 0.02),
        tube((0, 0.30, seat + 0.02), (0, 0.31, seat + 0.30), 0.02),
    ]
    for side in (-1, 1):
        frame.append(tube((side * 0.2, 0.02, seat - 0.09), (side * 0.29, 0.02, seat - 0.06), 0.014))
        frame.append(
            tube((side * 0.29, 0.02, seat - 0.06), (side * 0.29, 0.02, seat + 0.19), 0.014)
        )
        frame.append(
            superellipsoid((0.06, 0.26, 0.03), (side * 0.29, 0, seat + 0.18), 0.5, 0.4, 12)
        )
    return part(colour, seat_pad, back), part(DARK, *frame, *castors), part(METAL, *foot)


def board(*, size: Size3 = (1.25, 0.42, 1.75)) -> tuple[ShapePart, ...]:
    """A whiteboard in a metal frame on two feet."""
    width, depth, height = size
    panel = box((width - 0.03, 0.012, 0.62 * height), (0, -0.014, 0.36 * height))
    frame = [
        box((width, 0.03, 0.03), (0, 0, 0.36 * height - 0.03)),
        box((width, 0.03, 0.03), (0, 0, 0.98 * height)),
        box((width - 0.2, 0.07, 0.012), (0, -0.05, 0.36 * height - 0.03)),
    ]
    for side in (-1, 1):
        x = side * (width / 2 - 0.015)
        frame.append(box((0.03, 0.03, height - 0.03), (x, 0, 0.03), bevel=0.004))
        frame.append(box((0.05, depth, 0.03), (x, 0, 0), bevel=0.008))
    pens = [box((0.13, 0.018, 0.018), (x, -0.055, 0.36 * height - 0.018)) for x in (-0.2, 0.02)]
    return part((0.82, 0.83, 0.82), panel), part(METAL, *frame), part((0.28, 0.33, 0.42), *pens)


def floorlamp(*, height: float = 1.6, colour: Colour = (0.80, 0.75, 0.64)) -> tuple[ShapePart, ...]:
    """A standing lamp with a fabric shade."""
    pole = [
        lathe([(0.14, 0.0), (0.14, 0.018), (0.03, 0.03)], 28),
        cylinder(0.011, height - 0.12, (0, 0, 0.02), 10),
    ]
    angles = np.linspace(0, 2 * np.pi, 29)
    ring = np.stack([np.cos(angles), np.sin(angles)], 1)
    rims = [(0.20, height - 0.30), (0.14, height)]
    grid = np.stack([np.concatenate([r * ring, np.full((29, 1), z)], 1) for r, z in rims], 1)
    bulb = superellipsoid((0.07, 0.07, 0.11), (0, 0, height - 0.22), 1.0, 1.0, 10)
    return (
        part((0.25, 0.24, 0.23), *pole),
        part(colour, sheet(grid, 0.004)),
        part((0.84, 0.82, 0.76), bulb),
    )


def curtain(
    *, size: Size2 = (0.34, 2.2), colour: Colour = (0.66, 0.60, 0.50)
) -> tuple[ShapePart, ...]:
    """A drawn-back curtain: a wavy sheet hanging from a short rod."""
    width, height = size
    u = np.linspace(-0.5, 0.5, 41)
    z = np.linspace(0.0, height - 0.03, 6)
    phase = 2 * np.pi * max(2, round(width / 0.09)) * u
    flare = 1.0 + 0.10 * (1 - z / height)
    x = u[:, None] * width * flare[None]
    y = 0.028 * np.sin(phase)[:, None] * (0.75 + 0.25 * flare[None])
    grid = np.stack([x, y, np.broadcast_to(z, x.shape)], -1)
    rod = turned(cylinder(0.012, width + 0.10, (0, 0, -(width + 0.10) / 2), 10), "y", 90)
    return part(colour, sheet(grid, 0.006)), part(DARK, moved(rod, (0, 0, height)))


def rug(
    *, size: Size2 = (2.0, 1.4), colour: Colour = (0.58, 0.52, 0.46), round: bool = False
) -> tuple[ShapePart, ...]:
    """A rug of one tone, eight millimetres thick, square or round."""
    if round:
        disc = lathe([(0.5, 0.0), (0.495, 0.008)], 48) * [size[0], size[1], 1.0]
        return (part(colour, disc),)
    return (part(colour, box((size[0], size[1], 0.008), bevel=0.003)),)


_SIGNS = ((-1, -1), (1, -1), (1, 1), (-1, 1))

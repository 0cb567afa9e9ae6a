"""Parametric clutter: what lies on tables, beds, shelves and floors, and what hangs on walls.

Same conventions as `parametric_furniture`. Wall pieces hang with their back at y = 0 and their
middle at z = 0.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

from experiments.scene.parametric_furniture import BOOKS, DARK, METAL, PAGES, WOOD, book_colours
from experiments.scene.parametric_primitives import (
    Colour,
    ShapePart,
    box,
    cylinder,
    heightfield,
    lathe,
    moved,
    part,
    pillow,
    sheet,
    superellipsoid,
    surface,
    tube,
    turned,
)

Size3 = tuple[float, float, float]
Size2 = tuple[float, float]

SCREEN: Colour = (0.13, 0.15, 0.18)
PAPER: Colour = (0.82, 0.82, 0.80)


def carton(
    *, size: Size3 = (0.42, 0.36, 0.32), colour: Colour = (0.66, 0.54, 0.40)
) -> tuple[ShapePart, ...]:
    """A closed cardboard box with a strip of tape along its flaps."""
    width, _, height = size
    lighter = tuple(min(0.84, 1.15 * c) for c in colour)
    tape = [
        box((width * 1.001, 0.05, 0.0015), (0, 0, height)),
        box((0.0015, 0.05, 0.10), (width / 2, 0, height - 0.10)),
        box((0.0015, 0.05, 0.10), (-width / 2, 0, height - 0.10)),
    ]
    return (
        part(colour, box(size, bevel=0.004)),
        part((lighter[0], lighter[1], lighter[2]), *tape),
    )


def briefcase(
    *, size: Size3 = (0.40, 0.11, 0.30), colour: Colour = (0.36, 0.26, 0.19)
) -> tuple[ShapePart, ...]:
    """A standing briefcase with handle and two locks."""
    width, depth, height = size
    body = box((width, depth, height), bevel=0.012)
    handle = [
        tube((-0.06, 0, height - 0.005), (-0.05, 0, height + 0.035), 0.007, 8),
        tube((-0.05, 0, height + 0.035), (0.05, 0, height + 0.035), 0.007, 8),
        tube((0.06, 0, height - 0.005), (0.05, 0, height + 0.035), 0.007, 8),
    ]
    locks = [
        box((0.035, 0.006, 0.03), (x, -depth / 2 - 0.002, height - 0.07)) for x in (-0.12, 0.12)
    ]
    seam = box((width * 1.002, 0.012, height * 1.001))
    return part(colour, body), part(DARK, *handle, seam), part(METAL, *locks)


def bookstack(*, n: int = 3, seed: int = 0) -> tuple[ShapePart, ...]:
    """A pile of n lying books, each turned a little."""
    rng = np.random.default_rng(seed)
    z = 0.0
    soups, colours = [], []
    for k in range(n):
        scale = 1.0 - 0.04 * k
        size = (
            scale * rng.uniform(0.15, 0.18),
            scale * rng.uniform(0.22, 0.25),
            rng.uniform(0.018, 0.04),
        )
        book = box(size)
        tint = BOOKS[int(rng.integers(len(BOOKS)))]
        colours.append(_lying_colours(book, tint))
        soups.append(moved(turned(book, "z", rng.uniform(-14, 14)), (0, 0, z)))
        z += size[2]
    return (ShapePart(np.concatenate(soups), WOOD, vertex_colours=np.concatenate(colours)),)


def _lying_colours(book: Float[np.ndarray, "F 3 3"], tint: Colour) -> Float[np.ndarray, "F 3 3"]:
    """Paper on three cut edges, the spine towards -x."""
    colours = book_colours(book, tint, "+x")
    for edge in ("+y", "-y"):
        cut = np.all(book_colours(book, tint, edge) == np.array(PAGES), axis=(1, 2))
        colours[cut] = PAGES
    return colours


def openbook(*, size: Size2 = (0.34, 0.24)) -> tuple[ShapePart, ...]:
    """An open book, face up: two arched blocks of pages on a cover."""
    width, depth = size
    t = np.linspace(0, 1, 7)
    arch = 0.006 + 0.018 * np.sin(np.pi * (0.15 + 0.8 * (1 - t))) * (0.4 + 0.6 * (1 - t))
    page = heightfield(np.repeat(arch[:, None], 2, axis=1), (width / 2, depth))
    right = moved(page, (width / 4, 0, 0.003))
    left = (right * [-1.0, 1, 1])[:, ::-1]
    cover = box((width + 0.012, depth + 0.01, 0.003))
    return part(PAPER, right, left), part((0.44, 0.26, 0.22), cover)


def papers(*, n: int = 4, seed: int = 0) -> tuple[ShapePart, ...]:
    """A few loose sheets of A4, fanned out."""
    rng = np.random.default_rng(seed)
    soups = []
    for k in range(n):
        page = turned(box((0.21, 0.297, 0.0016)), "z", rng.uniform(-22, 22))
        soups.append(moved(page, (*rng.uniform(-0.035, 0.035, 2), 0.0016 * k)))
    return (part(PAPER, *soups),)


def laptop(*, angle: float = 108.0) -> tuple[ShapePart, ...]:
    """An open laptop, screen towards -y."""
    body = box((0.33, 0.23, 0.016), bevel=0.004)
    keys = box((0.28, 0.10, 0.001), (0, 0.035, 0.016))
    pad = box((0.10, 0.065, 0.001), (0, -0.065, 0.016))
    hinge = (0.0, 0.11, 0.014)
    lid = turned(box((0.33, 0.22, 0.007), (0, 0, 0.016), bevel=0.002), "x", -angle, hinge)
    glass = turned(box((0.31, 0.195, 0.0015), (0, 0.002, 0.0148)), "x", -angle, hinge)
    return part((0.56, 0.57, 0.58), body, lid), part(SCREEN, keys, glass), part(METAL, pad)


def monitor(*, size: Size2 = (0.55, 0.33)) -> tuple[ShapePart, ...]:
    """A computer screen on a foot, looking towards -y."""
    width, height = size
    lift = 0.12
    case = [
        box((width, 0.03, height), (0, 0.01, lift), bevel=0.006),
        box((0.05, 0.03, lift + 0.12), (0, 0.04, 0.01)),
        box((0.24, 0.17, 0.012), (0, 0.03, 0), bevel=0.005),
    ]
    glass = box((width - 0.03, 0.002, height - 0.035), (0, -0.0055, lift + 0.02))
    return part(DARK, *case), part(SCREEN, glass)


def tv(*, size: Size2 = (0.9, 0.52)) -> tuple[ShapePart, ...]:
    """A flat television on two feet, looking towards -y."""
    width, height = size
    lift = 0.06
    case = [box((width, 0.035, height), (0, 0.01, lift), bevel=0.006)]
    case += [box((0.03, 0.20, 0.012), (x, 0, 0), bevel=0.004) for x in (-0.3 * width, 0.3 * width)]
    case += [box((0.02, 0.02, lift + 0.02), (x, 0.01, 0)) for x in (-0.3 * width, 0.3 * width)]
    glass = box((width - 0.024, 0.002, height - 0.03), (0, -0.008, lift + 0.018))
    return part(DARK, *case), part(SCREEN, glass)


def keyboard(*, size: Size2 = (0.42, 0.13)) -> tuple[ShapePart, ...]:
    """A computer keyboard with its keys in four rows."""
    width, depth = size
    base = box((width, depth, 0.012), bevel=0.004)
    row = (depth - 0.02) / 4
    keys = [
        box((width - 0.02, row - 0.005, 0.006), (0, -depth / 2 + 0.01 + (k + 0.5) * row, 0.012))
        for k in range(4)
    ]
    return part((0.34, 0.35, 0.36), base), part((0.66, 0.67, 0.67), *keys)


def printer(*, size: Size3 = (0.42, 0.36, 0.24)) -> tuple[ShapePart, ...]:
    """A desktop printer with a paper tray."""
    width, depth, height = size
    body = [
        box((width, depth, 0.72 * height), bevel=0.015),
        box((0.94 * width, 0.8 * depth, 0.3 * height), (0, 0.03, 0.7 * height), bevel=0.012),
    ]
    slot = box((0.62 * width, 0.02, 0.16 * height), (0, -depth / 2 - 0.002, 0.36 * height))
    panel = box((0.3 * width, 0.08, 0.004), (0.24 * width, -0.06, 0.999 * height))
    sheets = box((0.21, 0.11, 0.006), (0, -depth / 2 - 0.05, 0.34 * height))
    return part((0.68, 0.68, 0.67), *body), part(DARK, slot, panel), part(PAPER, sheets)


def cushion(
    *, size: Size3 = (0.42, 0.42, 0.14), colour: Colour = (0.55, 0.45, 0.38)
) -> tuple[ShapePart, ...]:
    """A lying cushion."""
    return (part(colour, pillow(size)),)


def blanket(
    *, size: Size2 = (1.5, 0.5), colour: Colour = (0.55, 0.50, 0.42), seed: int = 0
) -> tuple[ShapePart, ...]:
    """A thrown blanket: flat, thicker at its folded rim, with a few soft ripples."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(-1, 1, 31), np.linspace(-1, 1, 15), indexing="ij")
    rim = np.clip(6 * (1 - np.maximum(np.abs(u) ** 3, np.abs(v) ** 3)), 0, 1) ** 0.5
    ripples = sum(
        0.0035 * np.sin(k * np.pi * u + rng.uniform(0, 6) + rng.uniform(-1, 1) * v)
        for k in (2, 3, 5)
    )
    return (part(colour, heightfield(0.004 + rim * (0.024 + ripples), size)),)


def pouf(
    *, size: Size3 = (0.52, 0.52, 0.42), colour: Colour = (0.52, 0.44, 0.36)
) -> tuple[ShapePart, ...]:
    """A round, stuffed floor cushion with ribbed sides."""
    ribs = 12
    angles = np.linspace(0, 2 * np.pi, 8 * ribs + 1)
    z = np.linspace(0, 1, 13)
    profile = np.sqrt(np.maximum(1 - np.abs(2 * z - 1) ** 3.2, 0)) ** 0.8
    bulge = 1 - 0.025 * (1 - np.abs(np.sin(ribs * angles / 2)))
    radius = 0.5 * profile[None] * bulge[:, None]
    x, y = radius * np.cos(angles)[:, None], radius * np.sin(angles)[:, None]
    grid = np.stack([x, y, np.broadcast_to(z, radius.shape)], -1)
    return (part(colour, surface(grid) * np.array(size)),)


def backpack(*, colour: Colour = (0.42, 0.37, 0.28)) -> tuple[ShapePart, ...]:
    """A backpack standing on its base, front pocket towards -y."""
    body = turned(superellipsoid((0.31, 0.17, 0.44), flat=0.35, square=0.5, n=24), "x", -5)
    pocket = superellipsoid((0.23, 0.10, 0.20), (0, -0.085, 0.04), 0.35, 0.45, 18)
    handle = [
        tube((-0.035, 0.05, 0.425), (-0.03, 0.05, 0.465), 0.008, 8),
        tube((-0.03, 0.05, 0.465), (0.03, 0.05, 0.465), 0.008, 8),
        tube((0.035, 0.05, 0.425), (0.03, 0.05, 0.465), 0.008, 8),
    ]
    y = np.linspace(0.05, 0.40, 9)
    bow = 0.095 + 0.05 * np.sin(np.pi * np.linspace(0, 1, 9))
    straps = []
    for side in (-0.085, 0.085):
        left = np.stack([np.full(9, side - 0.022), bow, y], 1)
        right = np.stack([np.full(9, side + 0.022), bow, y], 1)
        straps.append(sheet(np.stack([left, right]), 0.008))
    darker = (0.75 * colour[0], 0.75 * colour[1], 0.75 * colour[2])
    return part(colour, body), part(darker, pocket, *straps, *handle)


def basket(
    *, size: Size3 = (0.36, 0.36, 0.30), colour: Colour = (0.58, 0.47, 0.34)
) -> tuple[ShapePart, ...]:
    """An open woven basket with a rim."""
    profile = [
        (0.42, 0.0),
        (0.47, 0.4),
        (0.5, 0.97),
        (0.5, 1.0),
        (0.46, 1.0),
        (0.43, 0.4),
        (0.38, 0.06),
    ]
    return (part(colour, lathe(profile, 28) * np.array(size)),)


def vase(*, height: float = 0.24, colour: Colour = (0.58, 0.62, 0.60)) -> tuple[ShapePart, ...]:
    """A ceramic vase."""
    r = [0.20, 0.28, 0.33, 0.30, 0.20, 0.13, 0.12, 0.16, 0.13, 0.10, 0.10]
    z = [0.0, 0.12, 0.35, 0.55, 0.74, 0.86, 0.94, 1.0, 0.99, 0.94, 0.80]
    return (part(colour, height * lathe(list(zip(r, z, strict=True)), 24)),)


def glass(*, height: float = 0.11, colour: Colour = (0.66, 0.72, 0.72)) -> tuple[ShapePart, ...]:
    """A drinking glass or beaker."""
    profile = [(0.27, 0.0), (0.34, 1.0), (0.31, 1.0), (0.25, 0.08)]
    return (part(colour, height * lathe(profile, 20)),)


def pen_cup(*, seed: int = 0) -> tuple[ShapePart, ...]:
    """A beaker with a few pens."""
    rng = np.random.default_rng(seed)
    beaker = lathe([(0.038, 0.0), (0.038, 0.10), (0.034, 0.10), (0.034, 0.01)], 20)
    pens = [
        tube((0, 0, 0.012), (*(0.045 * rng.uniform(-1, 1, 2)), rng.uniform(0.13, 0.16)), 0.004, 6)
        for _ in range(5)
    ]
    return part((0.40, 0.42, 0.42), beaker), part((0.28, 0.33, 0.42), *pens)


def bowl(*, radius: float = 0.13, colour: Colour = (0.70, 0.67, 0.60)) -> tuple[ShapePart, ...]:
    """A bowl of fruit."""
    r = [0.40, 0.44, 0.80, 1.0, 0.95, 0.74, 0.30]
    z = [0.0, 0.04, 0.28, 0.55, 0.55, 0.30, 0.12]
    fruit = [
        superellipsoid((0.55, 0.55, 0.52), at, 1.0, 1.0, 12)
        for at in ((-0.35, -0.1, 0.24), (0.3, -0.3, 0.24), (0.2, 0.38, 0.24), (0.0, 0.0, 0.5))
    ]
    orange, green = (0.72, 0.50, 0.26), (0.52, 0.58, 0.30)
    return (
        part(colour, radius * lathe(list(zip(r, z, strict=True)), 24)),
        part(orange, *(radius * f for f in fruit[:2])),
        part(green, *(radius * f for f in fruit[2:])),
    )


def picture(
    *,
    size: Size2 = (0.55, 0.42),
    colour: Colour = (0.48, 0.50, 0.50),
    frame: Colour = (0.26, 0.21, 0.17),
    seed: int = 0,
) -> tuple[ShapePart, ...]:
    """A framed landscape with a passepartout; the painting's hills come from the seed."""
    width, height = size
    border, mat = 0.022, 0.13 * min(size)
    bars = [
        box((width, 0.024, border), (0, -0.012, height / 2 - border)),
        box((width, 0.024, border), (0, -0.012, -height / 2)),
        box((border, 0.024, height), ((width - border) / 2, -0.012, -height / 2)),
        box((border, 0.024, height), (-(width - border) / 2, -0.012, -height / 2)),
    ]
    card = box((width - border, 0.010, height - border), (0, -0.005, -(height - border) / 2))
    w, h = width / 2 - border - mat, height / 2 - border - mat
    quad = np.array([[-w, -0.0105, -h], [w, -0.0105, -h], [w, -0.0105, h], [-w, -0.0105, h]])
    corner_uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    index = np.array([[0, 1, 2], [0, 2, 3]])
    painting = ShapePart(
        quad[index], (1.0, 1.0, 1.0), uv=corner_uv[index], texture=_landscape(colour, seed)
    )
    return part(frame, *bars), part((0.80, 0.79, 0.75), card), painting


def _landscape(colour: Colour, seed: int) -> UInt8[np.ndarray, "96 128 3"]:
    """Four hazy ranges of hills under a graded sky, all in shades of one colour."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, 128), np.linspace(1, 0, 96))
    base = np.array(colour)
    sky = 0.45 * base + 0.42
    image = sky + (0.12 * (y - 0.5))[..., None] * np.array([0.9, 1.0, 1.15])
    for layer in range(4):
        ridge = np.full_like(x, 0.68 - 0.16 * layer)
        for octave in (1, 2, 3, 5):
            amplitude = 0.07 / octave
            ridge = ridge + amplitude * np.sin(2 * np.pi * octave * (x + rng.uniform()))
        shade = base * (1.12 - 0.22 * layer) + 0.10 * (1 - layer / 3)
        soft = np.clip((ridge - y) / 0.012, 0, 1)[..., None]
        image = image * (1 - soft) + shade * soft
    return np.asarray(np.round(255 * np.clip(image, 0.05, 0.86)), dtype=np.uint8)


def clock(*, radius: float = 0.15) -> tuple[ShapePart, ...]:
    """A round wall clock that shows ten past ten."""
    disc = turned(cylinder(radius, 0.03, segments=36), "x", 90)
    face = turned(cylinder(0.9 * radius, 0.004, (0, 0, 0.0285), 36), "x", 90)
    hands = [
        turned(box((0.010, 0.003, 0.55 * radius), (0, -0.0345, 0)), "y", -55),
        turned(box((0.007, 0.003, 0.78 * radius), (0, -0.0345, 0)), "y", 60),
    ]
    return part((0.30, 0.29, 0.28), disc, *hands), part((0.82, 0.81, 0.77), face)

"""The shell of a room: floor, walls, windows, doors and skirting, all facing into the room."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from experiments.scene.layout import Layout, Opening
from experiments.scene.objects import MaterialPart
from experiments.scene.textures import TILE_METRES, floor_texture, paint_texture

GRID = 0.1
"""Floor and walls are cut into squares of this side (metres), so that occlusion can vary on them."""
WALLS = ("n", "e", "s", "w")

_WHITE = (0.82, 0.82, 0.80)
_DOOR = (0.60, 0.49, 0.37)
_SKY = (0.80, 0.86, 0.90)
_METAL = (0.45, 0.45, 0.46)
_REVEAL = 0.10
"""How deep windows sit in the wall."""
_SKIRTING_HEIGHT, _SKIRTING_DEPTH = 0.08, 0.014
_CASING_WIDTH, _CASING_DEPTH = 0.07, 0.018

Interval = tuple[float, float]
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class ShellPart:
    """One surface of the shell."""

    instance: str
    """`floor`, `wall_n` ... (the instances of the scene); frames and doors belong to their wall."""
    wall: str | None
    material: MaterialPart
    occlusion: float | None = None
    """A constant occlusion factor; None means that it is baked."""


def shell_parts(layout: Layout) -> list[ShellPart]:
    """The drawn shell of a room; metres, z up, faces seen from inside only."""
    return [_floor(layout), *(part for wall in WALLS for part in _wall(layout, wall))]


def shell_walls(room_size: tuple[float, float, float]) -> dict[str, Float[np.ndarray, "F 3 3"]]:
    """Floor and walls as bare rectangles of two triangles, facing into the room.

    Returns `floor`, `wall_n`, `wall_e`, `wall_s` and `wall_w`; metres, z up.
    """
    width, depth, height = room_size
    floor = np.array([[0, 0, 0], [width, 0, 0], [width, depth, 0], [0, depth, 0]])
    surfaces = {"floor": _quads(floor[None], np.array([0.0, 0, 1]))}
    for name in WALLS:
        frame = _WallFrame.of(name, room_size)
        surfaces[f"wall_{name}"] = frame.rectangle((0.0, frame.length), (0.0, height), 0.0)
    return surfaces


def _floor(layout: Layout) -> ShellPart:
    width, depth, _ = layout.size
    x, y = _lines(0.0, width), _lines(0.0, depth)
    cells = [(a, b, c, d) for a, b in pairwise(x) for c, d in pairwise(y)]
    quads = np.array([[[a, c, 0], [b, c, 0], [b, d, 0], [a, d, 0]] for a, b, c, d in cells])
    corners = _quads(quads, np.array([0.0, 0, 1]))
    uv = (corners[..., :2] / TILE_METRES).astype(np.float32)
    texture = floor_texture(layout.floor, layout.floor_tint)
    material = MaterialPart(corners, _flat_normals(corners), (1.0, 1.0, 1.0), uv, texture)
    return ShellPart("floor", None, material)


def _wall(layout: Layout, wall: str) -> Iterator[ShellPart]:
    """One wall with its openings and skirting."""
    frame = _WallFrame.of(wall, layout.size)
    openings = [opening for opening in layout.openings if opening.wall == wall]
    yield _painted(layout, wall, frame, openings)
    for opening in openings:
        yield from (
            _window(wall, frame, opening)
            if opening.kind == "window"
            else _door(wall, frame, opening)
        )
    boxes = [
        frame.box(interval, (-_SKIRTING_DEPTH, 0.0), (0.0, _SKIRTING_HEIGHT))
        for interval in _between_doors(frame.length, openings)
    ]
    yield _trim(wall, boxes, _WHITE, 0.85)


def _painted(
    layout: Layout, wall: str, frame: _WallFrame, openings: Sequence[Opening]
) -> ShellPart:
    """The wall's surface, a grid with the openings left out."""
    u = _lines(0.0, frame.length, [edge for o in openings for edge in (o.u0, o.u1)])
    z = _lines(0.0, layout.size[2], [edge for o in openings for edge in (o.z0, o.z1)])
    cells = [
        frame.rectangle((a, b), (c, d), 0.0)
        for a, b in pairwise(u)
        for c, d in pairwise(z)
        if not any(_covers(o, (a + b) / 2, (c + d) / 2) for o in openings)
    ]
    corners = np.concatenate(cells)
    along = corners[..., 0] if wall in "ns" else corners[..., 1]
    uv = (np.stack([along, corners[..., 2]], axis=-1) / TILE_METRES).astype(np.float32)
    texture = paint_texture(layout.wall_colour, seed=WALLS.index(wall))
    material = MaterialPart(corners, _flat_normals(corners), (1.0, 1.0, 1.0), uv, texture)
    return ShellPart(f"wall_{wall}", wall, material)


def _window(wall: str, frame: _WallFrame, opening: Opening) -> Iterator[ShellPart]:
    """A bright pane set back in the wall, white frame with one or two mullions, and a sill."""
    u, z = (opening.u0, opening.u1), (opening.z0, opening.z1)
    yield _trim(wall, [frame.rectangle(u, z, _REVEAL)], _SKY, 1.35)
    yield _trim(wall, frame.reveal(u, z, _REVEAL), _WHITE, 0.85)
    bar, depth = 0.05, (_REVEAL - 0.04, _REVEAL)
    count = 1 if u[1] - u[0] < 1.8 else 2
    uprights = np.linspace(u[0] + bar / 2, u[1] - bar / 2, count + 2)
    boxes = [frame.box((at - bar / 2, at + bar / 2), depth, z) for at in uprights]
    boxes += [frame.box(u, depth, (at, at + bar)) for at in (z[0], z[1] - bar)]
    sill = frame.box((u[0] - 0.05, u[1] + 0.05), (-0.05, _REVEAL), (z[0] - 0.03, z[0]))
    yield _trim(wall, [*boxes, sill], _WHITE, 0.95)


def _door(wall: str, frame: _WallFrame, opening: Opening) -> Iterator[ShellPart]:
    """A closed door leaf with two panels and a handle, between casings."""
    (u0, u1), (z0, z1) = (opening.u0, opening.u1), (opening.z0, opening.z1)
    set_back = 0.03
    panels = [(z0 + 0.15, z0 + 0.42 * (z1 - z0)), (z0 + 0.50 * (z1 - z0), z1 - 0.15)]
    raised = [frame.box((u0 + 0.13, u1 - 0.13), (set_back - 0.008, set_back), z) for z in panels]
    yield _trim(wall, [frame.rectangle((u0, u1), (z0, z1), set_back)], _DOOR, 0.85)
    yield _trim(wall, raised, tuple(1.05 * c for c in _DOOR), 0.88)
    yield _trim(wall, frame.reveal((u0, u1), (z0, z1), set_back), _WHITE, 0.75)
    sides = [(u0 - _CASING_WIDTH, u0), (u1, u1 + _CASING_WIDTH)]
    over = z1 + _CASING_WIDTH
    casings = [frame.box(side, (-_CASING_DEPTH, 0.0), (z0, over)) for side in sides]
    casings.append(frame.box((u0, u1), (-_CASING_DEPTH, 0.0), (z1, over)))
    yield _trim(wall, casings, _WHITE, 0.90)
    handle = [
        frame.box((u0 + 0.05, u0 + 0.09), (set_back - 0.012, set_back), (z0 + 0.92, z0 + 1.08)),
        frame.box((u0 + 0.06, u0 + 0.18), (set_back - 0.055, set_back - 0.035), (1.01, 1.03)),
        frame.box((u0 + 0.06, u0 + 0.08), (set_back - 0.055, set_back), (1.01, 1.03)),
    ]
    yield _trim(wall, handle, _METAL, 0.95)


def _trim(
    wall: str,
    pieces: Sequence[Float[np.ndarray, "_ 3 3"]],
    colour: Sequence[float],
    occlusion: float,
) -> ShellPart:
    corners = np.concatenate(pieces)
    red, green, blue = colour
    material = MaterialPart(corners, _flat_normals(corners), (red, green, blue))
    return ShellPart(f"wall_{wall}", wall, material, occlusion)


def _between_doors(length: float, openings: Sequence[Opening]) -> list[Interval]:
    """Stretches of a wall that skirting covers: all but the doors and their casings."""
    doors = sorted((o.u0 - _CASING_WIDTH, o.u1 + _CASING_WIDTH) for o in openings if o.z0 <= 0)
    edges = [0.0, *(edge for door in doors for edge in door), length]
    stretches = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [(a, b) for a, b in stretches if b - a > 0.01]


def _covers(opening: Opening, u: float, z: float) -> bool:
    return bool(opening.u0 < u < opening.u1 and opening.z0 < z < opening.z1)


def _lines(start: float, end: float, extra: Sequence[float] = ()) -> Float[np.ndarray, " N"]:
    """Grid lines about `GRID` apart, through the extra places as well."""
    even = np.linspace(start, end, max(2, round((end - start) / GRID) + 1))
    far = [line for line in even[1:-1] if all(abs(line - other) > 0.02 for other in extra)]
    inner = [other for other in extra if start < other < end]
    return np.unique(np.round([start, *far, *inner, end], 6))


@dataclass(frozen=True)
class _WallFrame:
    """Coordinates of a wall: u along it (room x or y), w outwards from its surface, z up."""

    origin: Float[np.ndarray, "3"]
    along: Float[np.ndarray, "3"]
    outward: Float[np.ndarray, "3"]
    length: float

    @classmethod
    def of(cls, wall: str, room_size: tuple[float, float, float]) -> _WallFrame:
        width, depth, _ = room_size
        x, y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
        return {
            "n": cls(depth * y, x, y, width),
            "s": cls(0 * y, x, -y, width),
            "e": cls(width * x, y, x, depth),
            "w": cls(0 * x, y, -x, depth),
        }[wall]

    def at(self, u: float, w: float, z: float) -> Float[np.ndarray, "3"]:
        place: Float[np.ndarray, "3"] = self.origin + u * self.along + w * self.outward
        place[2] += z
        return place

    def rectangle(self, u: Interval, z: Interval, w: float) -> Float[np.ndarray, "2 3 3"]:
        """Parallel to the wall, facing into the room."""
        places = ((u[0], z[0]), (u[1], z[0]), (u[1], z[1]), (u[0], z[1]))
        return _quads(np.array([[self.at(a, w, c) for a, c in places]]), -self.outward)

    def reveal(self, u: Interval, z: Interval, depth: float) -> list[Float[np.ndarray, "2 3 3"]]:
        """The four sides of an opening, from the wall's surface to `depth`."""
        up = np.array([0.0, 0, 1])
        sides = [((u[0], u[0]), z, self.along), ((u[1], u[1]), z, -self.along)]
        sides += [(u, (z[0], z[0]), up), (u, (z[1], z[1]), -up)]
        quads = []
        for (a, b), (c, d), normal in sides:
            ends = [(a, 0.0, c), (b, 0.0, d), (b, depth, d), (a, depth, c)]
            quads.append(_quads(np.array([[self.at(*end) for end in ends]]), normal))
        return quads

    def box(self, u: Interval, w: Interval, z: Interval) -> Float[np.ndarray, "10 3 3"]:
        """A box without its back, which the wall hides."""
        up = np.array([0.0, 0, 1])
        quads = [self.rectangle(u, z, w[0])]
        for at, normal in ((u[0], -self.along), (u[1], self.along)):
            ends = [(at, w[0], z[0]), (at, w[1], z[0]), (at, w[1], z[1]), (at, w[0], z[1])]
            quads.append(_quads(np.array([[self.at(*end) for end in ends]]), normal))
        for at, normal in ((z[0], -up), (z[1], up)):
            ends = [(u[0], w[0], at), (u[1], w[0], at), (u[1], w[1], at), (u[0], w[1], at)]
            quads.append(_quads(np.array([[self.at(*end) for end in ends]]), normal))
        return np.concatenate(quads)


def _quads(
    corners: Float[np.ndarray, "Q 4 3"], normal: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "F 3 3"]:
    """Split rectangles into triangles that turn counter-clockwise seen against `normal`."""
    turn = np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0])
    ring = corners if turn @ normal > 0 else corners[:, ::-1]
    return ring[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3).astype(np.float32)


def _flat_normals(corners: Float[np.ndarray, "F 3 3"]) -> Float[np.ndarray, "F 3 3"]:
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return np.repeat(unit[:, None], 3, axis=1).astype(np.float32)

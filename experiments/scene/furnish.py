"""Furnishing: turn a layout into placed objects, triangles in the room's frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, UInt8

from experiments.scene.layout import Colour, Item, Layout
from experiments.scene.normals import creased_normals
from experiments.scene.objects import MaterialPart, PlacedObject
from experiments.scene.pack import Pack, Piece, default_pack
from experiments.scene.parametric import make_shape
from experiments.scene.scene import MPCAT40
from experiments.scene.settle import settled_height, surface_heights
from renderer.files import InputError

SOFT_ASSETS = frozenset({"shape:cushion", "shape:blanket", "pack:teddy_bear_51"})
"""Things that may sink some centimetres into what they lie on."""
DRAPED = frozenset({"blanket"})
"""Shapes that follow the surface they lie on and hang over its edge."""
_HANG = 0.22
"""Metres that a draped cloth hangs down at most."""


def furnish(layout: Layout, pack: Pack | None = None) -> tuple[PlacedObject, ...]:
    """Make and place every object of a layout, in its order.

    Objects stand on the floor, hang at their given height, or are settled on their support by rays
    straight down. Raises InputError for an unknown piece or shape, or when the support is missed.
    """
    pack = pack or default_pack()
    placed: dict[str, PlacedObject] = {}
    for item in layout.items:
        placed[item.id] = place(item, placed, pack, layout.name)
    return tuple(placed.values())


def place(
    item: Item, placed: dict[str, PlacedObject], pack: Pack, source: object = "layout"
) -> PlacedObject:
    """Make one object and stand it where its item says; its support must be in `placed`."""
    bodies = _own_frame(item, pack, source)
    turn = _yaw_matrix(item.yaw)
    bodies = tuple(
        replace(b, corners=b.corners @ turn.T, normals=b.normals @ turn.T) for b in bodies
    )
    z = _height(item, bodies, placed, source)
    shift = np.array([item.x, item.y, z])
    if item.shape in DRAPED and item.on is not None:
        bodies = tuple(_draped(b, placed[item.on].triangles(), shift) for b in bodies)
    parts = tuple(
        MaterialPart(
            corners=body.corners + shift,
            normals=body.normals,
            colour=body.colour,
            uv=body.uv,
            texture=body.texture,
            vertex_colours=body.vertex_colours,
        )
        for body in bodies
    )
    return PlacedObject(
        id=item.id,
        asset=item.asset,
        label=item.label,
        x=item.x,
        y=item.y,
        z=z,
        yaw_deg=item.yaw,
        parts=parts,
        on=item.on,
        wall=item.wall,
        soft=is_soft(item),
    )


def is_soft(item: Item) -> bool:
    """Whether the thing gives way: it settles on the middle height below it and may sink in."""
    return item.asset in SOFT_ASSETS or MPCAT40[item.label] == "cushion"


@dataclass(frozen=True)
class _Body:
    """One material of an object in its own frame, scaled."""

    corners: Float[np.ndarray, "F 3 3"]
    normals: Float[np.ndarray, "F 3 3"]
    colour: Colour
    uv: Float[np.ndarray, "F 3 2"] | None
    texture: UInt8[np.ndarray, "h w 3"] | None
    vertex_colours: Float[np.ndarray, "F 3 3"] | None


def _own_frame(item: Item, pack: Pack, source: object) -> tuple[_Body, ...]:
    """Piece or shape, scaled, with normals, tinted."""
    if item.piece is not None:
        piece = pack.piece(item.piece)
        scale = _scale(item, piece, source)
        bodies = tuple(
            _Body(p.corners * scale, p.corners, p.colour, p.uv, p.texture, None)
            for p in piece.parts
        )
    else:
        shapes = make_shape(str(item.shape), item.params, f"{source}: {item.id}")
        bodies = tuple(
            _Body(p.corners * item.scale, p.corners, p.colour, p.uv, p.texture, p.vertex_colours)
            for p in shapes
        )
    if np.prod(item.scale) < 0:
        bodies = tuple(_reversed(body) for body in bodies)
    bodies = _with_normals(bodies)
    return bodies if item.tint is None else _tinted(bodies, item.tint)


def _reversed(body: _Body) -> _Body:
    """The same triangles the other way round: mirroring turns faces inside out."""
    uv, colours = body.uv, body.vertex_colours
    return replace(
        body,
        corners=body.corners[:, ::-1],
        uv=None if uv is None else uv[:, ::-1],
        vertex_colours=None if colours is None else colours[:, ::-1],
    )


def _scale(item: Item, piece: Piece, source: object) -> Float[np.ndarray, " 3"]:
    """The item's scale; a wanted seat height sets the third factor."""
    scale = np.array(item.scale)
    if item.seat is not None:
        if piece.seat is None:
            raise InputError(source, f"{item.id}.seat", item.seat, "a piece that has a seat")
        scale[2] = item.seat / piece.seat
    return scale


def _with_normals(bodies: tuple[_Body, ...]) -> tuple[_Body, ...]:
    """Creased normals over the whole object, so that shading runs across material borders."""
    normals = creased_normals(np.concatenate([body.corners for body in bodies]))
    starts = np.cumsum([0, *(len(body.corners) for body in bodies)])
    return tuple(
        replace(body, normals=normals[start:stop])
        for body, start, stop in zip(bodies, starts[:-1], starts[1:], strict=True)
    )


def _height(
    item: Item,
    bodies: tuple[_Body, ...],
    placed: dict[str, PlacedObject],
    source: object,
) -> float:
    """Height of the base: given, settled on the support, or the floor."""
    if item.z is not None:
        return item.z
    if item.on is None:
        return 0.0
    points = np.concatenate([body.corners.reshape(-1, 3) for body in bodies])
    width, depth, _ = np.ptp(points, axis=0)
    triangles = placed[item.on].triangles()
    size = (float(width), float(depth))
    height = settled_height(triangles, item.x, item.y, size, 0.5 if is_soft(item) else 0.8)
    if np.isnan(height):
        raise InputError(source, f"{item.id}.on", item.on, "a support under the object's middle")
    return height


def _draped(
    body: _Body, support: Float[np.ndarray, "F 3 3"], shift: Float[np.ndarray, " 3"]
) -> _Body:
    """Raise or lower every corner by the support's height below it, relative to the middle."""
    points = (body.corners + shift).reshape(-1, 3)[:, :2]
    distinct, index = np.unique(np.round(points, 6), axis=0, return_inverse=True)
    below = surface_heights(support, distinct) - shift[2]
    rise = np.clip(np.nan_to_num(below, nan=-_HANG), -_HANG, _HANG)[index.reshape(-1)]
    corners = body.corners.copy()
    corners[..., 2] += rise.reshape(-1, 3)
    return replace(body, corners=corners, normals=creased_normals(corners, 75.0))


def _tinted(bodies: tuple[_Body, ...], tint: Colour) -> tuple[_Body, ...]:
    """Give the tint to the material with the largest surface and to all of its colour.

    A textured material keeps its pattern: its brightness is kept relative to its mean.
    """
    area = [triangle_areas(body.corners).sum() for body in bodies]
    main = bodies[int(np.argmax(area))]
    return tuple(_recoloured(body, tint) if _alike(body, main) else body for body in bodies)


def _alike(body: _Body, main: _Body) -> bool:
    return body is main or (body.texture is None and body.colour == main.colour)


def _recoloured(body: _Body, tint: Colour) -> _Body:
    if body.texture is None:
        return replace(body, colour=tint)
    grey = body.texture.astype(float).mean(-1, keepdims=True)
    coloured = np.clip(grey / grey.mean() * np.array(tint), 0.02, 0.86)
    return replace(body, texture=np.round(255 * coloured).astype(np.uint8))


def triangle_areas(corners: Float[np.ndarray, "F 3 3"]) -> Float[np.ndarray, " F"]:
    """Areas in square metres."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(cross, axis=1) / 2)


def _yaw_matrix(degrees: float) -> Float[np.ndarray, "3 3"]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

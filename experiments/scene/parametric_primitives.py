"""Primitive solids that parametric furniture is put together from.

All return triangle soups with outward faces, in metres, z up. `at` is the centre of the underside
unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

Triangles = Float[np.ndarray, "_ 3 3"]
Vector = Sequence[float | int]
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class ShapePart:
    """The triangles of one material of a parametric shape, in the shape's own frame."""

    corners: Float[np.ndarray, "F 3 3"]
    colour: Colour
    vertex_colours: Float[np.ndarray, "F 3 3"] | None = None
    uv: Float[np.ndarray, "F 3 2"] | None = None
    texture: UInt8[np.ndarray, "h w 3"] | None = None


def part(colour: Colour, *solids: Triangles) -> ShapePart:
    """One material made of several solids."""
    return ShapePart(np.concatenate(solids), colour)


def box(size: Vector, at: Vector = (0, 0, 0), bevel: float = 0.0) -> Triangles:
    """A box; a bevel rounds its twelve edges by one slanted face each."""
    half = np.asarray(size, float) / 2
    middle = np.add(at, (0.0, 0.0, half[2]))
    if bevel <= 0:
        return np.asarray(middle + half * _UNIT_BOX)
    bevel = min(bevel, 0.45 * 2 * float(half.min()))
    return np.asarray(middle + _bevelled(half, bevel))


def lathe(profile: Sequence[tuple[float, float]], segments: int = 24) -> Triangles:
    """Turn a profile of (radius, height) from bottom to top about the z axis; ends are closed."""
    points = [(0.0, profile[0][1]), *profile, (0.0, profile[-1][1])]
    angles = np.linspace(0, 2 * np.pi, segments + 1)
    ring = np.stack([np.cos(angles), np.sin(angles)], 1)
    radius, height = np.array(points).T
    spread = np.broadcast_to(height[:, None, None], (len(points), segments + 1, 1))
    grid = np.concatenate([radius[:, None, None] * ring[None], spread], axis=2)
    return surface(grid.transpose(1, 0, 2))


def cylinder(
    radius: float,
    height: float,
    at: Vector = (0, 0, 0),
    segments: int = 20,
    top_radius: float | None = None,
) -> Triangles:
    """An upright cylinder or truncated cone."""
    top = radius if top_radius is None else top_radius
    return np.asarray(lathe([(radius, 0.0), (top, height)], segments) + np.asarray(at, float))


def tube(a: Vector, b: Vector, radius: float, segments: int = 10) -> Triangles:
    """A round bar from point a to point b."""
    start, end = np.asarray(a, float), np.asarray(b, float)
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    helper = np.array([1.0, 0, 0]) if abs(axis[0]) < 0.9 else np.array([0, 1.0, 0])
    side = np.cross(axis, helper)
    side /= np.linalg.norm(side)
    frame = np.stack([side, np.cross(axis, side), axis])
    return np.asarray(cylinder(radius, length, segments=segments) @ frame + start)


def superellipsoid(
    size: Vector,
    at: Vector = (0, 0, 0),
    flat: float = 0.4,
    square: float = 0.5,
    n: int = 20,
) -> Triangles:
    """A rounded block: exponents towards 0 make it boxy, 1 makes it an ellipsoid.

    `flat` shapes the profile from top to bottom, `square` the outline from above (Barr 1981).
    """
    v, u = np.meshgrid(
        np.linspace(-np.pi / 2, np.pi / 2, n // 2 + 1), np.linspace(-np.pi, np.pi, n + 1), indexing="ij"
    )  # fmt: skip
    x = _power(np.cos(v), flat) * _power(np.cos(u), square)
    y = _power(np.cos(v), flat) * _power(np.sin(u), square)
    z = _power(np.sin(v), flat)
    half = np.asarray(size, float) / 2
    grid = np.stack([x, y, z], -1) * half + np.add(at, (0.0, 0.0, half[2]))
    return surface(grid.transpose(1, 0, 2))


def pillow(size: Vector, at: Vector = (0, 0, 0), n: int = 12) -> Triangles:
    """A cushion: thick in the middle, thin along its seam, corners drawn in a little."""
    u, v = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1), indexing="ij")
    puff = np.maximum((1 - np.abs(u) ** 2.6) * (1 - np.abs(v) ** 2.6), 0) ** 0.45
    waist = 1 - 0.05 * (1 - np.abs(u * v))
    x, y = u * waist * size[0] / 2, v * waist * size[1] / 2
    top = np.stack([x, y, 0.5 + 0.5 * puff], -1)
    below = np.stack([x, y, 0.5 - 0.5 * puff], -1)
    scale, shift = np.array([1, 1, size[2]]), np.asarray(at, float)
    faces = [surface(top), surface(below)[:, ::-1]]
    return np.asarray(np.concatenate(faces) * scale + shift)


def heightfield(
    heights: Float[np.ndarray, "N M"], size: tuple[float, float], at: Vector = (0, 0, 0)
) -> Triangles:
    """A closed slab: sampled upper surface, flat underside on z = 0, upright sides."""
    n, m = heights.shape
    x, y = np.meshgrid(
        np.linspace(-size[0] / 2, size[0] / 2, n), np.linspace(-size[1] / 2, size[1] / 2, m), indexing="ij"
    )  # fmt: skip
    top = np.stack([x, y, heights], -1)
    base = np.stack([x, y, np.zeros_like(x)], -1)
    skirts = [
        np.stack([base[:, 0], top[:, 0]], 1),
        np.stack([top[:, -1], base[:, -1]], 1),
        np.stack([top[0], base[0]], 1),
        np.stack([base[-1], top[-1]], 1),
    ]
    soup = [surface(top), surface(base)[:, ::-1], *(surface(s) for s in skirts)]
    return np.asarray(np.concatenate(soup) + np.asarray(at, float))


def sheet(grid: Float[np.ndarray, "N M 3"], thickness: float) -> Triangles:
    """A bent sheet with two sides; its rim is left open."""
    du, dv = np.gradient(grid, axis=0), np.gradient(grid, axis=1)
    normal = np.cross(du, dv)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    front, back = grid + normal * thickness / 2, grid - normal * thickness / 2
    return np.concatenate([surface(front), surface(back)[:, ::-1]])


def turned(
    corners: Triangles, axis: str, degrees: float | int, about: Vector = (0, 0, 0)
) -> Triangles:
    """Rotate about an axis through a point, counter-clockwise seen from the axis' tip."""
    angle = np.radians(degrees)
    c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    centre = np.asarray(about, float)
    return np.asarray((corners - centre) @ matrix.T + centre)


def moved(corners: Triangles, by: Vector) -> Triangles:
    """Translate."""
    return np.asarray(corners + np.asarray(by, float))


def surface(grid: Float[np.ndarray, "N M 3"]) -> Triangles:
    """Two triangles per grid cell, facing along d/di x d/dj; empty ones are left out."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    soup = np.concatenate([np.stack([a, b, c], -2), np.stack([a, c, d], -2)]).reshape(-1, 3, 3)
    area = np.linalg.norm(np.cross(soup[:, 1] - soup[:, 0], soup[:, 2] - soup[:, 0]), axis=1)
    return np.asarray(soup[area > 1e-10])


def _power(value: Float[np.ndarray, "N M"], exponent: float) -> Float[np.ndarray, "N M"]:
    """Signed power; a sine that should be zero must not grow into a crack along the seam."""
    size = np.where(np.abs(value) < 1e-12, 0.0, np.abs(value))
    return np.asarray(np.sign(value) * size**exponent)


def _bevelled(half: Float[np.ndarray, " 3"], bevel: float) -> Triangles:
    """Convex hull of the three boxes that are shortened along two axes each, by its faces."""
    inner = half - bevel
    soup: list[np.ndarray] = []
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            quad = np.zeros((4, 3))
            quad[:, axis] = sign * half[axis]
            quad[:, i], quad[:, j] = inner[i] * _QUAD[0], inner[j] * _QUAD[1]
            soup += _quad(quad)
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        for si in (-1.0, 1.0):
            for sj in (-1.0, 1.0):
                quad = np.zeros((4, 3))
                quad[:, axis] = inner[axis] * np.array([-1.0, 1, 1, -1])
                quad[:, i] = si * np.array([half[i], half[i], inner[i], inner[i]])
                quad[:, j] = sj * np.array([inner[j], inner[j], half[j], half[j]])
                soup += _quad(quad)
    for signs in np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T:
        soup.append(np.stack([signs * np.where(np.arange(3) == k, half, inner) for k in range(3)]))
    corners = np.stack(soup)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = (normal * corners.mean(1)).sum(1) < 0
    corners[inwards] = corners[inwards][:, ::-1]
    return corners


_QUAD = np.array([[-1.0, 1, 1, -1], [-1.0, -1, 1, 1]])


def _quad(points: Float[np.ndarray, "4 3"]) -> list[np.ndarray]:
    return [points[[0, 1, 2]], points[[0, 2, 3]]]


def _unit_box() -> Triangles:
    soup = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            points = np.zeros((4, 3))
            points[:, axis] = sign
            points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = _QUAD[0], _QUAD[1]
            soup += _quad(points if sign > 0 else points[::-1])
    return np.stack(soup)


_UNIT_BOX = _unit_box()

"""A scene of boxes and half-spaces with exact distances: what one clip of the training data touches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8


@dataclass(frozen=True)
class Box:
    """A solid box. World: z up, metres."""

    centre: Float[np.ndarray, "3"]
    half: Float[np.ndarray, "3"]
    """Half its length along each of its own axes."""
    axes: Float[np.ndarray, "3 3"]
    """Rows are its unit axes in the world."""
    label: int
    """mpcat40 class."""

    def signed(self, points: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N"]:
        """Exact signed distance, metres, negative inside."""
        beyond = np.abs((points - self.centre) @ self.axes.T) - self.half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
        return np.asarray(outside + np.minimum(beyond.max(axis=-1), 0.0))


@dataclass(frozen=True)
class HalfSpace:
    """Everything behind a plane is solid: the floor, a wall."""

    normal: Float[np.ndarray, "3"]
    """Unit, pointing into the air."""
    offset: float
    """Of the plane along the normal, metres."""
    label: int

    def signed(self, points: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N"]:
        """Exact signed distance, metres, negative inside."""
        return np.asarray(points @ self.normal - self.offset)


Solid = Box | HalfSpace


@dataclass(frozen=True)
class ContactScene:
    """Some solids; the first one is the floor."""

    solids: tuple[Solid, ...]

    def nearest(
        self, points: Float[np.ndarray, "*N 3"]
    ) -> tuple[Float[np.ndarray, "*N"], UInt8[np.ndarray, "*N"], Float[np.ndarray, "*N"]]:
        """Distance to the nearest surface (m, unsigned), its class, and the depth inside any solid (m)."""
        flat = points.reshape(-1, 3)
        distance = np.full(len(flat), np.inf)
        depth = np.full(len(flat), 0.0)
        label = np.zeros(len(flat), dtype=np.uint8)
        for solid in self.solids:
            signed = solid.signed(flat)
            nearer = np.abs(signed) < distance
            distance = np.where(nearer, np.abs(signed), distance)
            label = np.where(nearer, np.uint8(solid.label), label)
            depth = np.maximum(depth, -signed)
        shape = points.shape[:-1]
        return distance.reshape(shape), label.reshape(shape), depth.reshape(shape)


@dataclass(frozen=True)
class Heading:
    """Directions of a person in the plane: ahead, to the left, up; coordinates along them."""

    ahead: Float[np.ndarray, "3"]
    left: Float[np.ndarray, "3"]

    @staticmethod
    def of(ahead: Float[np.ndarray, "3"]) -> Heading:
        """From any vector that is not vertical."""
        flat = ahead * np.array([1.0, 1.0, 0.0])
        flat = flat / np.linalg.norm(flat)
        return Heading(flat, np.array([-flat[1], flat[0], 0.0]))

    @property
    def axes(self) -> Float[np.ndarray, "3 3"]:
        """Rows: ahead, left, up."""
        return np.stack([self.ahead, self.left, np.array([0.0, 0.0, 1.0])])

    def local(self, points: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N 3"]:
        """Coordinates (ahead, left, up) of points, about the world's origin."""
        return np.asarray(points @ self.axes.T)

    def box(
        self, low: tuple[float, float, float], high: tuple[float, float, float], label: int
    ) -> Box:
        """The box between two corners in (ahead, left, up)."""
        lower, upper = np.array(low), np.array(high)
        half = np.maximum((upper - lower) / 2, 0.005)
        return Box((upper + lower) / 2 @ self.axes, half, self.axes, label)


def tilted_slab(
    heading: Heading,
    lean: float,
    front: float,
    thickness: float,
    along: tuple[float, float],
    across: tuple[float, float],
    label: int,
) -> Box:
    """A board leaning back by `lean` radians, such as a back rest; its front faces ahead.

    Its front plane is at `front` along its normal, it reaches over `along` up the lean and over
    `across` to the left; all measured from the world's origin, metres.
    """
    ahead, left, up = heading.axes
    rising = np.cos(lean) * up - np.sin(lean) * ahead
    normal = np.cos(lean) * ahead + np.sin(lean) * up
    centre = (front - thickness / 2) * normal + sum(along) / 2 * rising + sum(across) / 2 * left
    half = np.array([thickness, across[1] - across[0], along[1] - along[0]]) / 2
    return Box(centre, np.maximum(half, 0.005), np.stack([normal, left, rising]), label)

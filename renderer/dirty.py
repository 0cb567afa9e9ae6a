"""The dirty rectangle: the pixels that a body can change, by itself or by its shadows.

The rectangle is a bound, never a guess: a point of the room changes only when it lies in the key
light's shadow of the body (on a ray from a vertex along the light, widened by the filter) or close
below the body (contact darkening). Both sets are unions of segments, widened by a radius; a
projection maps a segment into the rectangle around its ends, and what comes near the camera plane
makes the whole picture dirty.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Integer

from renderer.light import LightBox

CONTACT_HEIGHT_M, CONTACT_DEPTH_M = 0.30, 0.10
CONTACT_STEP_M = 0.028
"""Distance of the 4 x 4 looks that the shader takes into the contact map (mesh.frag)."""
PIXEL_MARGIN = 2
_CLOSE_M = 0.3


@dataclass(frozen=True)
class Rect:
    """Pixels [left, right) x [bottom, top), origin at the lower left corner."""

    left: int
    bottom: int
    right: int
    top: int

    @property
    def width(self) -> int:
        """Pixels across."""
        return self.right - self.left

    @property
    def height(self) -> int:
        """Pixels upwards."""
        return self.top - self.bottom

    @property
    def is_empty(self) -> bool:
        """No pixel inside."""
        return self.width <= 0 or self.height <= 0


@dataclass(frozen=True)
class Projection:
    """World to pixels of one camera."""

    view: Float[np.ndarray, "4 4"]
    projection: Float[np.ndarray, "4 4"]
    width: int
    height: int

    def seen(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "3 N"]:
        """Points in camera axes (right, up, back), one row an axis."""
        rows: np.ndarray = self.view[:3, :3] @ points.T + self.view[:3, 3:]
        return rows

    def turned(self, vector: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 1"]:
        """A world direction in camera axes, as a column."""
        column: np.ndarray = (self.view[:3, :3] @ vector)[:, None]
        return column

    def rect_of(self, seen: Float[np.ndarray, "3 N"], radius: float) -> Rect:
        """Rectangle (not clipped) around balls of this radius (m) at points in camera axes.

        The whole picture if one of them is close to the camera plane. A ball of radius r at depth
        d reaches at most r (scale + offset) / (d - r) pixels from the picture of its centre.
        """
        near = -float(seen[2].max()) - radius
        if near < _CLOSE_M:
            return Rect(0, 0, self.width, self.height)
        ends: list[int] = []
        for axis, size in enumerate((self.width, self.height)):
            scale = float(self.projection[axis, axis]) * size / 2
            pixels = seen[axis] / seen[2]
            offsets = -scale * float(pixels.max()), -scale * float(pixels.min())
            reach = radius * (scale + max(map(abs, offsets))) / near + PIXEL_MARGIN
            ends += [
                math.floor(offsets[0] + size / 2 - reach),
                math.ceil(offsets[1] + size / 2 + reach),
            ]
        return Rect(ends[0], ends[2], ends[1], ends[3])

    def clip(self, rect: Rect) -> Rect:
        """The part inside the picture."""
        return Rect(
            max(rect.left, 0),
            max(rect.bottom, 0),
            min(rect.right, self.width),
            min(rect.top, self.height),
        )

    def rects_of(self, corners: Float[np.ndarray, "C K 3"]) -> Integer[np.ndarray, "C 4"]:
        """Left, bottom, right, top around each triangle; one near the camera covers all."""
        seen = corners @ self.view[:3, :3].T + self.view[:3, 3]
        depth = -seen[..., 2]
        close = depth.min(axis=1) < _CLOSE_M
        scale = np.array([
            self.projection[0, 0] * self.width / 2,
            self.projection[1, 1] * self.height / 2,
        ])  # fmt: skip
        safe = np.maximum(depth, _CLOSE_M)[..., None]
        pixels = seen[..., :2] / safe * scale + np.array([self.width, self.height]) / 2
        low = np.floor(pixels.min(axis=1)) - PIXEL_MARGIN
        high = np.ceil(pixels.max(axis=1)) + PIXEL_MARGIN
        low[close], high[close] = 0, (self.width, self.height)
        return np.concatenate([low, high], axis=1).astype(np.int64)


def dirty_rect(
    camera: Projection,
    vertices: Float[np.ndarray, "V 3"],
    direction: Float[np.ndarray, "3"],
    lowest_z: float,
    shadow_radius: float,
    contact_radius: float,
) -> Rect:
    """Pixels that may differ from the empty room when the body stands there.

    `direction` is that of the key light; `lowest_z` the room's lowest height (m), below which no
    shadow is seen; `shadow_radius` and `contact_radius` (m) are the reaches of the two filters.
    """
    body = camera.seen(np.asarray(vertices, dtype=np.float64))
    fall = np.maximum(vertices[:, 2] - (lowest_z - 2 * shadow_radius), 0.0) / -direction[2]
    shadow = body + fall * camera.turned(direction)
    up = camera.turned(np.array([0.0, 0.0, 1.0]))
    rects = [
        camera.rect_of(body, shadow_radius),
        camera.rect_of(shadow, shadow_radius),
        camera.rect_of(body + CONTACT_DEPTH_M * up, contact_radius),
        camera.rect_of(body - CONTACT_HEIGHT_M * up, contact_radius),
    ]
    # Clipped only now: the ends of a segment may lie beyond different sides of the picture.
    return camera.clip(functools.reduce(_union, rects))


def contact_reach(texel: float) -> float:
    """How far to the side (metres) the body darkens a surface below it, given the map's texel."""
    return math.sqrt(2) * (1.5 * CONTACT_STEP_M + texel) + 0.002


def meets(rects: Integer[np.ndarray, "C 4"], rect: Rect) -> Bool[np.ndarray, " C"]:
    """Which of these rectangles share a pixel with `rect`."""
    left, bottom, right, top = rects.T
    shared: np.ndarray = (left < rect.right) & (right > rect.left) & (bottom < rect.top)
    shared &= top > rect.bottom
    return shared


def shadow_rect(box: LightBox, vertices: Float[np.ndarray, "V 3"], shadow_size: int) -> Rect:
    """Texels of the shadow map that the body covers, with a margin."""
    seen = box.view[:2, :3] @ np.asarray(vertices, np.float64).T + box.view[:2, 3:]
    ends: list[int] = []
    for row, half in zip(seen, (box.half_width, box.half_height), strict=True):
        low, high = (0.5 * shadow_size * (float(x) / half + 1) for x in (row.min(), row.max()))
        ends += [math.floor(low) - 2, math.ceil(high) + 2]
    left, right, bottom, top = (min(max(end, 0), shadow_size) for end in ends)
    return Rect(left, bottom, right, top)


def _union(a: Rect, b: Rect) -> Rect:
    return Rect(
        min(a.left, b.left),
        min(a.bottom, b.bottom),
        max(a.right, b.right),
        max(a.top, b.top),
    )

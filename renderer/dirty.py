"""The dirty rectangle: the pixels that a body can change, by itself or by its shadows.

The rectangle is a bound, never a guess: a point of the room changes only when it lies in the key
light's shadow of the body (on a ray from a vertex along the light, widened by the filter) or close
below the body (contact darkening). Both sets are unions of segments, widened by a radius; a
projection maps a segment into the rectangle around its ends, and what comes near the camera plane
makes the whole picture dirty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Integer

from renderer.light import LightBox

CONTACT_HEIGHT_M, CONTACT_DEPTH_M = 0.30, 0.10
CONTACT_RADIUS_M = 0.14
"""Reach of the contact darkening to the side, filter and map texels included."""
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

    def rect_of(self, points: Float[np.ndarray, "N 3"], radius: float) -> Rect:
        """Rectangle around balls of this radius (metres) at the points; whole picture if close."""
        seen = points @ self.view[:3, :3].T + self.view[:3, 3]
        depth = -seen[:, 2]
        near = float(depth.min()) - radius
        if near < _CLOSE_M:
            return Rect(0, 0, self.width, self.height)
        scale = np.array([
            self.projection[0, 0] * self.width / 2,
            self.projection[1, 1] * self.height / 2,
        ])  # fmt: skip
        pixels = seen[:, :2] / depth[:, None] * scale + np.array([self.width, self.height]) / 2
        # A ball of radius r at depth d reaches at most r (scale + |offset|) / (d - r) pixels.
        offset = np.abs(pixels - np.array([self.width, self.height]) / 2).max(axis=0)
        reach = radius * (scale + offset) / near + PIXEL_MARGIN
        low = np.floor(pixels.min(axis=0) - reach).astype(int)
        high = np.ceil(pixels.max(axis=0) + reach).astype(int)
        return self.clip(Rect(int(low[0]), int(low[1]), int(high[0]), int(high[1])))

    def clip(self, rect: Rect) -> Rect:
        """The part inside the picture."""
        return Rect(
            max(rect.left, 0),
            max(rect.bottom, 0),
            min(rect.right, self.width),
            min(rect.top, self.height),
        )

    def box_rects(self, boxes: Float[np.ndarray, "C 2 3"]) -> Integer[np.ndarray, "C 4"]:
        """Left, bottom, right, top of axis-aligned boxes; a box near the camera covers all."""
        picks = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
        corners = boxes[:, picks, np.arange(3)]
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
) -> Rect:
    """Pixels that may differ from the empty room when the body stands there.

    `direction` is that of the key light; `lowest_z` the room's lowest height (m), below which no
    shadow is seen; `shadow_radius` (m) the reach of the shadow filter in the world.
    """
    body = np.asarray(vertices, dtype=np.float64)
    fall = np.maximum(body[:, 2] - (lowest_z - 2 * shadow_radius), 0.0) / -direction[2]
    shadow = body + fall[:, None] * direction
    above = body + np.array([0.0, 0.0, CONTACT_DEPTH_M])
    below = body - np.array([0.0, 0.0, CONTACT_HEIGHT_M])
    cast = camera.rect_of(np.concatenate([body, shadow]), shadow_radius)
    contact = camera.rect_of(np.concatenate([above, below]), CONTACT_RADIUS_M)
    return _union(cast, contact)


def meets(rects: Integer[np.ndarray, "C 4"], rect: Rect) -> Bool[np.ndarray, " C"]:
    """Which of these rectangles share a pixel with `rect`."""
    left, bottom, right, top = rects.T
    shared: np.ndarray = (left < rect.right) & (right > rect.left) & (bottom < rect.top)
    shared &= top > rect.bottom
    return shared


def shadow_rect(box: LightBox, vertices: Float[np.ndarray, "V 3"], shadow_size: int) -> Rect:
    """Texels of the shadow map that the body covers, with a margin."""
    seen = np.asarray(vertices, np.float64) @ box.view[:2, :3].T + box.view[:2, 3]
    texels = (seen * np.array([1 / box.half_width, 1 / box.half_height]) * 0.5 + 0.5) * shadow_size
    low, high = np.floor(texels.min(axis=0)) - 2, np.ceil(texels.max(axis=0)) + 2
    low, high = np.clip(low, 0, shadow_size), np.clip(high, 0, shadow_size)
    return Rect(int(low[0]), int(low[1]), int(high[0]), int(high[1]))


def _union(a: Rect, b: Rect) -> Rect:
    if a.is_empty or b.is_empty:
        return b if a.is_empty else a
    return Rect(
        min(a.left, b.left),
        min(a.bottom, b.bottom),
        max(a.right, b.right),
        max(a.top, b.top),
    )

"""The stage: all that the renderer needs of a scene and a body, as plain arrays.

The renderer knows no method, no motion format and no study. Frame: z up, metres, the floor at
`floor_z`. Colours are sRGB in [0, 1].
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float, Integer, UInt8

Hides = Literal["never", "wall", "ceiling", "with_wall", "tall"]


@dataclass(frozen=True)
class StagePart:
    """One piece of the static room: a triangle soup that is shown or hidden as a whole.

    `corners` are per-face vertex positions; a piece of furniture with n materials gives n parts
    of the same `instance`. `group` names what disappears together in a view: the wall ("wall:n"),
    or the tall object with everything that stands on it ("object:wardrobe").
    """

    corners: Float[np.ndarray, "F 3 3"]
    normals: Float[np.ndarray, "F 3 3"]
    colours: Float[np.ndarray, "F 3 3"]
    """sRGB colour per corner before occlusion; white where a texture carries the colour."""
    occlusion: Float[np.ndarray, "F 3"]
    """Baked ambient occlusion factor per corner, 1 = open."""
    instance: str
    group: str
    uv: Float[np.ndarray, "F 3 2"] | None = None
    texture: UInt8[np.ndarray, "h w 3"] | None = None
    wall: str | None = None
    """The wall (n, e, s, w) that this part is or belongs to, if any."""
    released: dict[str, Float[np.ndarray, "F 3"]] = field(default_factory=dict)
    """By group: how much `occlusion` grows in a view where that tall object is hidden."""

    def occlusion_without(self, hidden: Collection[str]) -> Float[np.ndarray, "F 3"]:
        """Occlusion per corner in a view that hides these groups: no dark patch stays behind."""
        gained = [self.released[group] for group in self.released if group in hidden]
        if not gained:
            return self.occlusion
        brightest = np.maximum(self.occlusion, 1.0)
        freed: Float[np.ndarray, "F 3"] = np.minimum(self.occlusion + sum(gained), brightest)
        return freed


@dataclass(frozen=True)
class Stage:
    """A static room and one moving body."""

    parts: tuple[StagePart, ...]
    room_size: tuple[float, float, float]
    """W (x), D (y), H (z) in metres; the room box is [0, W] x [0, D] x [floor_z, floor_z + H]."""
    vertices: Float[np.ndarray, "T V 3"]
    faces: Integer[np.ndarray, "G 3"]
    fps: float
    floor_z: float = 0.0
    body_colour: tuple[float, float, float] = (0.36, 0.53, 0.72)
    regions: dict[str, Integer[np.ndarray, " K"]] = field(default_factory=dict)
    """Named vertex index lists of the body (soles, pelvis, hands), for camera scoring."""

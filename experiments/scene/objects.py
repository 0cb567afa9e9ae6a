"""Placed objects: the furniture of a room as triangle soups in the room's frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8


@dataclass(frozen=True)
class MaterialPart:
    """The triangles of one object that share a material. Room frame, metres, z up."""

    corners: Float[np.ndarray, "F 3 3"]
    normals: Float[np.ndarray, "F 3 3"]
    """Unit normals per corner, creased at 40 degrees."""
    colour: tuple[float, float, float]
    """sRGB; white where the texture carries the colour."""
    uv: Float[np.ndarray, "F 3 2"] | None = None
    texture: UInt8[np.ndarray, "h w 3"] | None = None
    vertex_colours: Float[np.ndarray, "F 3 3"] | None = None
    """sRGB per corner where one colour does not do (rows of book spines); overrides `colour`."""


@dataclass(frozen=True)
class PlacedObject:
    """One piece of furniture or clutter, standing where the layout says."""

    id: str
    asset: str
    label: int
    """mpcat40 class index."""
    x: float
    y: float
    z: float
    yaw_deg: float
    parts: tuple[MaterialPart, ...]
    on: str | None = None
    """Id of the object that it stands on; None for the floor."""
    wall: str | None = None
    """Wall (n, e, s, w) that it hangs on or belongs to."""
    soft: bool = False
    """Cushions, bedding and toys may sink further into what they lie on."""

    def triangles(self) -> Float[np.ndarray, "F 3 3"]:
        """All triangles of the object, materials joined."""
        return np.concatenate([part.corners for part in self.parts])

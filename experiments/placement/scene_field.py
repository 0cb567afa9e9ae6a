"""What a placement reads of a scene: signed distance and nearest class at body vertices."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from experiments.placement.packed_volumes import PackedVolumes
from experiments.scene.lookup import SceneLookup
from experiments.scene.scene import MPCAT40, N_CLASSES, Scene

_BLANK = [MPCAT40.index(name) for name in ("void", "unlabeled")]
_SHELL = [MPCAT40.index(name) for name in ("wall", "floor", "ceiling")]


class SceneField:
    """Distances for the energy of a placement.

    Vertices in contact read the true surface, so that a seat is touched and not the air above it;
    all others read the thickened one, in which thin boards register.
    """

    def __init__(
        self,
        scene: Scene,
        dtype: torch.dtype = torch.float32,
        device: torch.device | str = "cpu",
    ) -> None:
        self.thick = SceneLookup(scene, thickened=True, dtype=dtype, device=device)
        self.plain = SceneLookup(scene, thickened=False, dtype=dtype, device=device)
        self.packed = PackedVolumes(self.plain, self.thick)
        self.semantics_off = semantics_off(scene)
        """Why classes cannot be compared in this scene; empty if they can."""

    def distance(
        self, points: Float[Tensor, "*B T V 3"], contact: Bool[Tensor, "T V"]
    ) -> Float[Tensor, "*B T V"]:
        """Signed distance in metres, negative inside solids; points in the scene's frame."""
        distance = self.thick.distance(points)
        ever = contact.any(0)
        if not ever.any():
            return distance
        plain = self.plain.distance(points[..., ever, :])
        # Only the columns that are ever in contact are read twice.
        column = torch.cumsum(ever, 0).sub(1).clamp(min=0)
        return torch.where(contact, plain[..., column], distance)

    def clearance(self, points: Float[Tensor, "*B T M 3"]) -> Float[Tensor, "*B T"]:
        """Least distance to the true surface over some points of a frame, metres."""
        return self.plain.distance(points).amin(-1)

    def label(
        self, points: Float[Tensor, "*B T V 3"], contact: Bool[Tensor, "T V"]
    ) -> Int64[Tensor, "*B T V"]:
        """Class of the nearest surface (mpcat40 index) where a vertex is ever in contact, else 0."""
        ever = contact.any(0)
        label = torch.zeros(points.shape[:-1], dtype=torch.int64, device=points.device)
        label[..., ever] = self.plain.label(points[..., ever, :])
        return label


def semantics_off(scene: Scene) -> str:
    """Why the classes of a scene cannot be compared with expected ones; empty if they can."""
    present = np.flatnonzero(np.bincount(scene.volumes.label.ravel()))
    unknown = present[present >= N_CLASSES]
    if len(unknown):
        return f"the scene has classes outside mpcat40 ({', '.join(map(str, unknown))})"
    if np.isin(present, _BLANK).any() and np.isin(present, _BLANK + _SHELL).all():
        return "no object of the scene has a label"
    return ""

"""Reading the baked volumes at points: distance (differentiable) and nearest label."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor
from torch.nn.functional import grid_sample

from experiments.scene.scene import Scene, Volumes


class SceneLookup:
    """The volumes of one scene as tensors, ready to be read many times.

    `thickened` chooses the distance that thin furniture registers in (placement); metrics leave it
    off. Distances are metres, negative inside solids; points are in the room's frame, metres, z up.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        thickened: bool = False,
        dtype: torch.dtype = torch.float32,
        device: torch.device | str = "cpu",
    ) -> None:
        volumes = scene.volumes
        grid = volumes.thickened if thickened else volumes.sdf
        self.scene_id = scene.scene_id
        self.thickened = thickened
        self.cell = volumes.cell
        # Float[Tensor, "X Y Z"], UInt8[Tensor, "X Y Z"] and metres of node (0, 0, 0).
        self.sdf = torch.as_tensor(np.ascontiguousarray(grid), dtype=dtype, device=device)
        self.labels = torch.as_tensor(np.ascontiguousarray(volumes.label), device=device)
        self.origin = torch.tensor(volumes.origin, dtype=dtype, device=device)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of nodes along x, y and z."""
        x, y, z = self.sdf.shape
        return x, y, z

    def distance(self, points: Float[Tensor, "... 3"]) -> Float[Tensor, "..."]:
        """Signed distance in metres, differentiable in `points`; see `trilinear`."""
        return trilinear(self.sdf, self.origin, self.cell, points)

    def label(self, points: Float[Tensor, "... 3"]) -> Int64[Tensor, "..."]:
        """mpcat40 class index of the nearest surface; see `nearest`."""
        return nearest(self.labels, self.origin, self.cell, points).to(torch.int64)

    def bounds(self) -> tuple[Float[Tensor, "3"], Float[Tensor, "3"]]:
        """First and last node of the grid, metres: where distances are more than clamped values."""
        steps = torch.tensor(self.sdf.shape, device=self.sdf.device) - 1
        return self.origin, self.origin + self.cell * steps


def trilinear(
    volume: Float[Tensor, "X Y Z"],
    origin: Float[Tensor, "3"],
    cell: float,
    points: Float[Tensor, "... 3"],
) -> Float[Tensor, "..."]:
    """Trilinear interpolation of a node-centred volume, corner-aligned, clamped at the border.

    Node (i, j, k) stands at `origin + cell * (i, j, k)`. Points beyond the outermost nodes read the
    value of the nearest border point, with no gradient across that border. The gradient is that of
    the interpolant: constant steps across cell faces are possible, inside cells it is exact.
    """
    steps = torch.tensor(volume.shape, dtype=points.dtype, device=points.device) - 1
    unit = 2 * (points - origin) / (cell * steps) - 1
    # grid_sample counts its coordinates from the last axis of the volume.
    flat = unit.flip(-1).reshape(1, -1, 1, 1, 3)
    values = grid_sample(volume[None, None], flat, padding_mode="border", align_corners=True)
    return values.reshape(points.shape[:-1])


def nearest(
    volume: UInt8[Tensor, "X Y Z"],
    origin: Float[Tensor, "3"],
    cell: float,
    points: Float[Tensor, "... 3"],
) -> UInt8[Tensor, "..."]:
    """The value at the nearest node. Classes have no in-between, so they are never interpolated."""
    last = torch.tensor(volume.shape, device=points.device) - 1
    with torch.no_grad():
        node = ((points - origin) / cell).round().to(torch.int64)
        i, j, k = node.clamp(torch.zeros_like(last), last).unbind(-1)
    return volume[i, j, k]


def trilinear_reference(volumes: Volumes, thickened: bool, point: Float[np.ndarray, "3"]) -> float:
    """The same distance by its textbook definition, one point at a time: the oracle of the tests."""
    grid = volumes.thickened if thickened else volumes.sdf
    last = np.array(grid.shape) - 1
    position = np.clip((point - np.array(volumes.origin)) / volumes.cell, 0, last)
    low = np.minimum(np.floor(position).astype(int), np.maximum(last - 1, 0))
    fraction = position - low
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, fraction, 1 - fraction))
        total += float(weight) * float(grid[tuple(np.minimum(low + corner, last))])
    return total

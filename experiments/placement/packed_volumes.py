"""The volumes of a scene laid out for reading many points at once, with a gradient from the corners.

`SceneField` is the plain way to the same numbers. Here points are coordinate-major (all x, then all
y, then all z), and only the columns asked for are interpolated.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from jaxtyping import Bool, Float, Int64, Integer, UInt8
from torch import Tensor
from torch.autograd.function import once_differentiable

from experiments.scene.lookup import SceneLookup


class PackedVolumes:
    """True and thickened distance behind one another, labels, and which cells can be solid."""

    def __init__(self, plain: SceneLookup, thick: SceneLookup) -> None:
        self.shape = plain.shape
        self.cell = plain.cell
        self.origin = plain.origin
        self._before = -self.origin / self.cell
        self.distances: Float[Tensor, " 2N"] = torch.stack([plain.sdf, thick.sdf]).flatten()
        self.label: UInt8[Tensor, " N"] = plain.labels.flatten()
        self.solid: Bool[Tensor, " N"] = cells_with_inside(thick.sdf).flatten()
        self.thick_from = math.prod(self.shape)
        """Where the thickened distances begin in `distances`."""
        # Half the memory to move where it suffices: every vertex takes part in finding its cell.
        self._index = torch.int32 if 2 * self.thick_from < 2**31 else torch.int64

    def distance(
        self,
        points: Float[Tensor, "3 P"],
        columns: Int64[Tensor, " M"],
        first: Integer[Tensor, " M"],
    ) -> Float[Tensor, " M"]:
        """Signed distance in metres at some columns, each of them once; differentiable in `points`.

        `first` is 0 for the true distance, `thick_from` for the thickened one.
        """
        value: Float[Tensor, " M"] = _Trilinear.apply(points, columns, first, self)  # type: ignore[no-untyped-call]
        return value

    def nearest_label(
        self, points: Float[Tensor, "3 P"], columns: Int64[Tensor, " M"]
    ) -> UInt8[Tensor, " M"]:
        """Class at the nearest node."""
        node = self.nodes(self.steps(points.index_select(1, columns)).round_())
        return self.label.index_select(0, self.flat_(node))

    def possibly_inside(self, points: Float[Tensor, "3 P"]) -> Bool[Tensor, " P"]:
        """Points in cells one of whose corners is inside something: no other has a depth."""
        return self.solid.index_select(0, self.flat_(self.nodes(self.steps(points))))

    def steps(self, points: Float[Tensor, "3 M"]) -> Float[Tensor, "3 M"]:
        """Points in steps of the grid from its first node."""
        return torch.add(self._before[:, None], points, alpha=1.0 / self.cell)

    def clamped(self, steps: Float[Tensor, "3 M"]) -> Float[Tensor, "3 M"]:
        """The nearest position inside the grid; what is not a number stays so."""
        rows = zip(steps, self.shape, strict=True)
        return torch.stack([row.clamp(0, size - 1) for row, size in rows])

    def nodes(self, steps: Float[Tensor, "3 M"], short: int = 1) -> Integer[Tensor, "3 M"]:
        """The node below a position, inside the grid less `short` nodes at its end.

        Clamped as integers: a position that is not a number must not lead out of the grid.
        """
        node = steps.to(self._index)
        for row, size in zip(node, self.shape, strict=True):
            row.clamp_(0, size - short)
        return node

    def flat_(self, node: Integer[Tensor, "3 M"]) -> Integer[Tensor, " M"]:
        """Place of a node in a flattened volume; overwrites `node`."""
        _, depth, height = self.shape
        i, j, k = node
        place: Integer[Tensor, " M"] = i.mul_(depth * height).add_(j, alpha=height).add_(k)
        return place


class _Trilinear(torch.autograd.Function):
    """Trilinear interpolation, clamped at the border; value and gradient from the same corners."""

    @staticmethod
    def forward(ctx: Any, points: Any, columns: Any, first: Any, volumes: PackedVolumes) -> Any:
        steps = volumes.steps(points.index_select(1, columns))
        position = volumes.clamped(steps)
        node = volumes.nodes(position, short=2)
        x, y, z = position - node
        corner = _corners(volumes, volumes.flat_(node).add_(first))
        along_z = corner[:, :, 1] - corner[:, :, 0]
        face = torch.addcmul(corner[:, :, 0], along_z, z)
        along_y = face[:, 1] - face[:, 0]
        edge = torch.addcmul(face[:, 0], along_y, y)
        along_x = edge[1] - edge[0]
        if ctx.needs_input_grad[0]:
            rise = torch.addcmul(along_z[:, 0], along_z[:, 1] - along_z[:, 0], y)
            slope = torch.stack([along_x, _mix(x, along_y), _mix(x, rise)]).div_(volumes.cell)
            # Beyond the border the value no longer depends on that coordinate.
            slope *= position == steps
            ctx.save_for_backward(columns, slope)
            ctx.n_points = points.shape[1]
        return torch.addcmul(edge[0], along_x, x)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, upstream: Any) -> Any:
        columns, slope = ctx.saved_tensors
        gradient = upstream.new_zeros((3, ctx.n_points))
        gradient.index_copy_(1, columns, slope * upstream)
        return gradient, None, None, None


def _corners(volumes: PackedVolumes, base: Integer[Tensor, " M"]) -> Float[Tensor, "2 2 2 M"]:
    """The values at the eight corners of cells, by the place of their lowest corner."""
    _, depth, height = volumes.shape
    steps = [i * depth * height + j * height + k for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    places = base + torch.tensor(steps, dtype=base.dtype, device=base.device)[:, None]
    return volumes.distances.index_select(0, places.flatten()).reshape(2, 2, 2, -1)


def _mix(share: Float[Tensor, " M"], ends: Float[Tensor, "2 M"]) -> Float[Tensor, " M"]:
    return ends[0] + share * (ends[1] - ends[0])


def cells_with_inside(sdf: Float[Tensor, "X Y Z"]) -> Bool[Tensor, "X Y Z"]:
    """For every node whether the cell above it has a negative corner.

    The last nodes of an axis stand for the cell below them: positions there belong to it.
    """
    found = sdf < 0
    for axis in range(3):
        size = found.shape[axis]
        cell = found.narrow(axis, 0, size - 1) | found.narrow(axis, 1, size - 1)
        found = torch.cat([cell, cell.narrow(axis, size - 2, 1)], dim=axis)
    return found

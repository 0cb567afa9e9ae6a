"""Where a person can walk in a furnished room, on a grid seen from above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Integer
from scipy import ndimage

from experiments.scene.objects import PlacedObject
from experiments.scene.surface import surface_samples

CELL = 0.025
BODY_RADIUS = 0.25
"""Radius of the disc that stands for a walking person, metres."""
_STEP_OVER, _HEAD = 0.03, 1.8
"""Lower things are stepped over; things that begin higher are walked under."""
_CLOSING = 2


@dataclass(frozen=True)
class WalkMap:
    """Cells of `cell` metres over the floor, index [x, y] from the south-west corner."""

    obstacle: Bool[np.ndarray, "X Y"]
    walkable: Bool[np.ndarray, "X Y"]
    """Cells in which the middle of the disc can stand."""
    region: Integer[np.ndarray, "X Y"]
    """Connected region of every walkable cell, 1 for the largest; 0 elsewhere."""
    cell: float

    @property
    def free_share(self) -> float:
        """Share of the floor that no furniture covers."""
        return 1.0 - float(self.obstacle.mean())

    @property
    def walkable_share(self) -> float:
        """Share of the floor on which the middle of the disc can stand."""
        return float(self.walkable.mean())

    @property
    def largest_share(self) -> float:
        """Share of the walkable floor that is one connected region; 0 where nothing is walkable."""
        total = int(self.walkable.sum())
        return float((self.region == 1).sum() / total) if total else 0.0

    def distance_to_largest(
        self, low: Float[np.ndarray, " 2"], high: Float[np.ndarray, " 2"]
    ) -> float:
        """Distance from a box on the floor (x, y bounds) to the largest region, metres."""
        cells = (np.argwhere(self.region == 1) + 0.5) * self.cell
        if not len(cells):
            return float("inf")
        outside = np.maximum(np.maximum(low - cells, cells - high), 0.0)
        return float(np.linalg.norm(outside, axis=1).min())


def walk_map(
    objects: Sequence[PlacedObject], size: tuple[float, float, float], cell: float = CELL
) -> WalkMap:
    """Rasterise the furniture, close small gaps, fit the disc, label connected regions.

    An obstacle is every object that begins below 1.8 m, by what of it is higher than 3 cm.
    """
    shape = (round(size[0] / cell), round(size[1] / cell))
    obstacle = np.zeros(shape, dtype=bool)
    for placed in objects:
        points, _ = surface_samples(placed.triangles(), 0.6 * cell)
        if points[:, 2].min() < _HEAD:
            _mark(obstacle, points[points[:, 2] > _STEP_OVER], cell)
    padded = np.pad(obstacle, _CLOSING + 1)
    closed = ndimage.binary_closing(padded, iterations=_CLOSING)
    obstacle = closed[_CLOSING + 1 : -_CLOSING - 1, _CLOSING + 1 : -_CLOSING - 1] | obstacle
    blocked = np.pad(obstacle, 1, constant_values=True)
    clearance = ndimage.distance_transform_edt(~blocked)[1:-1, 1:-1] * cell
    walkable = clearance >= BODY_RADIUS
    return WalkMap(obstacle, walkable, _regions(walkable), cell)


def _mark(obstacle: Bool[np.ndarray, "X Y"], points: Float[np.ndarray, "N 3"], cell: float) -> None:
    """Set the cells under the points."""
    index = np.floor(points[:, :2] / cell).astype(int)
    inside = np.all((index >= 0) & (index < obstacle.shape), axis=1)
    obstacle[index[inside, 0], index[inside, 1]] = True


def _regions(walkable: Bool[np.ndarray, "X Y"]) -> Integer[np.ndarray, "X Y"]:
    """Four-neighbour regions, numbered by falling size."""
    labels, n = ndimage.label(walkable)
    sizes = np.bincount(labels.ravel(), minlength=n + 1)[1:]
    rank = np.zeros(n + 1, dtype=int)
    rank[1 + np.argsort(-sizes, kind="stable")] = np.arange(1, n + 1)
    return np.asarray(rank[labels])

"""Pictures of a room for people: plan, label volume and slices of the signed distance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull, QhullError

from experiments.scene.layout import Opening
from experiments.scene.layout_checks import is_rug
from experiments.scene.objects import PlacedObject
from experiments.scene.scene import MPCAT40, Scene
from experiments.scene.walk import WalkMap
from renderer.files import atomic_path

SLICE_HEIGHTS = (0.05, 0.25, 0.45, 0.70, 1.00, 1.50)
"""Metres above the floor: feet, shins, seats, tables, backs, shelves."""


def draw_plan(
    target: Path,
    name: str,
    size: tuple[float, float, float],
    objects: Sequence[PlacedObject],
    walk: WalkMap,
    openings: Sequence[Opening] = (),
) -> None:
    """Outlines of all objects from above with their ids, over the walkable floor."""
    figure = Figure(figsize=(1.9 * size[0] + 1, 1.9 * size[1] + 1), layout="constrained")
    axes = figure.add_subplot()
    shown = np.where(walk.region == 1, 2, np.where(walk.walkable, 1, 0))
    colours = ListedColormap(["#ffffff", "#f3dcb8", "#d5e8d0"])
    axes.imshow(shown.T, origin="lower", extent=(0, size[0], 0, size[1]), cmap=colours, vmax=2)
    for placed in objects:
        _outline(axes, placed)
    for opening in openings:
        _opening(axes, opening, size)
    axes.set(xlim=(-0.1, size[0] + 0.1), ylim=(-0.1, size[1] + 0.1), aspect="equal")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_title(f"{name}: green = walkable and connected, sand = cut off", fontsize=10)
    axes.add_patch(Polygon([(0, 0), (size[0], 0), size[:2], (0, size[1])], fill=False, lw=2))
    _save(figure, target)


def draw_labels(target: Path, scene: Scene) -> None:
    """Nearest class seen from above: the label of the highest solid node, and at three heights."""
    heights = (0.1, 0.45, 0.9, 1.4)
    present = np.unique(scene.volumes.label)
    colours = _class_colours()
    figure = Figure(figsize=(4 * len(heights) + 1.8, 4.4), layout="constrained")
    for column, height in enumerate(heights):
        axes = figure.add_subplot(1, len(heights), column + 1)
        plane = scene.volumes.label[:, :, _index(scene, height)]
        axes.imshow(colours[plane.T], origin="lower", extent=_extent(scene))
        axes.set_title(f"nearest class at z = {height:.2f} m", fontsize=9)
    keys = [Polygon([(0, 0), (0, 0), (0, 0)], color=colours[index]) for index in present]
    names = [MPCAT40[index] for index in present]
    figure.legend(keys, names, loc="outside right center", fontsize=8)
    _save(figure, target)


def draw_slices(target: Path, scene: Scene) -> None:
    """The signed distance at six heights; the black line is the surface, red is inside."""
    figure = Figure(figsize=(14, 8.6), layout="constrained")
    norm = TwoSlopeNorm(0.0, -0.2, 1.0)
    for index, height in enumerate(SLICE_HEIGHTS):
        axes = figure.add_subplot(2, 3, index + 1)
        plane = np.asarray(scene.volumes.sdf[:, :, _index(scene, height)], dtype=float)
        image = axes.imshow(plane.T, origin="lower", extent=_extent(scene), cmap="RdBu", norm=norm)
        low, cell = scene.volumes.origin, scene.volumes.cell
        x, y = (low[k] + cell * np.arange(plane.shape[k]) for k in (0, 1))
        axes.contour(x, y, plane.T, levels=[0.0], colors="black", linewidths=0.8)
        axes.set_title(f"{scene.scene_id}: signed distance at z = {height:.2f} m", fontsize=9)
    figure.colorbar(image, ax=figure.axes, label="metres", shrink=0.6)
    _save(figure, target)


def _outline(axes: Axes, placed: PlacedObject) -> None:
    """Convex hull of the object seen from above."""
    flat = placed.triangles().reshape(-1, 3)[:, :2]
    try:
        hull = flat[ConvexHull(flat).vertices]
    except QhullError:
        return
    colour = tuple(_class_colours()[placed.label])
    alpha = 0.15 if is_rug(placed) else 0.45 if placed.on is None else 0.75
    axes.add_patch(Polygon(hull, facecolor=(*colour, alpha), edgecolor="#333333", lw=0.6))
    text = "" if placed.on is not None or placed.wall is not None else placed.id
    x, y = flat.mean(0)
    axes.text(float(x), float(y), text, ha="center", va="center", fontsize=6)


def _opening(axes: Axes, opening: Opening, size: tuple[float, float, float]) -> None:
    along = np.array([opening.u0, opening.u1])
    fixed = {"n": size[1], "s": 0.0, "e": size[0], "w": 0.0}[opening.wall]
    x, y = (along, [fixed, fixed]) if opening.wall in "ns" else ([fixed, fixed], along)
    axes.plot(x, y, color="#5aa0d6" if opening.kind == "window" else "#9a6b3f", lw=5, alpha=0.8)


def _class_colours() -> Float[np.ndarray, "42 3"]:
    """One colour per mpcat40 class: two qualitative maps and a third, in class order."""
    maps: Any = matplotlib.colormaps
    table = [*maps["tab20"].colors, *maps["tab20b"].colors, *maps["tab20c"].colors]
    return np.array(table[: len(MPCAT40)], dtype=float)


def _index(scene: Scene, height: float) -> int:
    """Node layer nearest to a height above the floor."""
    volumes = scene.volumes
    layer = round((scene.floor_z + height - volumes.origin[2]) / volumes.cell)
    return int(np.clip(layer, 0, volumes.sdf.shape[2] - 1))


def _extent(scene: Scene) -> tuple[float, float, float, float]:
    volumes = scene.volumes
    low, half = volumes.origin, volumes.cell / 2
    high = [low[k] + volumes.cell * (volumes.sdf.shape[k] - 1) for k in (0, 1)]
    return (low[0] - half, high[0] + half, low[1] - half, high[1] + half)


def _save(figure: Figure, target: Path) -> None:
    with atomic_path(target) as temporary:
        figure.savefig(temporary, dpi=110)

"""Rooms by name: furnish, join, bake, and keep what was baked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from experiments.scene.assembly import CELL, THICKNESS, assemble
from experiments.scene.furnish import furnish
from experiments.scene.layout import Layout, read_layout
from experiments.scene.objects import PlacedObject
from experiments.scene.pack import default_pack
from experiments.scene.progress import progress_bar
from experiments.scene.scene import Scene
from experiments.scene.scene_folder import is_scene_folder, read_scene, write_scene
from experiments.scene.stage_parts import stage_parts


def load_room(name_or_dir: str | Path, cell: float = CELL) -> Scene:
    """A room that comes with the project, a layout file (.toml), or a scene folder.

    Layouts are furnished and baked at `cell` metres, about ten seconds of work the first time and
    from the cache afterwards; a scene folder brings its own volumes. Raises InputError.
    """
    if is_scene_folder(name_or_dir):
        return read_scene(Path(name_or_dir))
    layout = read_layout(name_or_dir)
    return bake_layout(layout, furnish(layout), cell)


def bake_layout(layout: Layout, objects: Sequence[PlacedObject], cell: float = CELL) -> Scene:
    """The scene of a furnished layout, with a progress bar while it has to be baked."""
    with progress_bar(f"Baking {layout.name}") as on_step:
        return assemble(layout.name, layout.size, objects, cell, THICKNESS, on_step)


def bake_scene_folder(name: str | Path, folder: Path, cell: float = CELL) -> Scene:
    """Write a room as a scene folder that other programs can read."""
    scene = load_room(name, cell)
    write_scene(folder, scene, stage_parts(name), licence="CC0-1.0", credits=_credits(scene))
    return scene


def _credits(scene: Scene) -> list[str]:
    """Who made the pieces of the furniture pack that stand in this room."""
    pack = default_pack()
    used = sorted({i.asset for i in scene.instances if i.asset.startswith("pack:")})
    pieces = [pack.piece(asset.removeprefix("pack:")) for asset in used]
    return [f"{piece.title}: {piece.creator}" for piece in pieces]

"""Commands on rooms: `pace-study scene inspect` and `pace-study scene bake`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click


@click.group()
def scene() -> None:
    """Bake and inspect rooms."""


@scene.command()
@click.argument("room", metavar="NAME|DIR")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Also draw plan, labels and distance slices into this folder (bakes the room).",
)
def inspect(room: str, as_json: bool, out: Path | None) -> None:
    """Check a room: overlaps, floating things, walkable floor, seats.

    NAME is a room of the project (bedroom, library, booth, living, office, dining), a variation
    such as office_v3, or a layout file; DIR is a scene folder. Exits with 1 if the room is at fault.
    """
    from experiments.scene.inspection import draw_room, inspect_room

    inspection = inspect_room(room)
    record = inspection.report.as_json()
    if out is not None:
        from experiments.scene.baking import load_room

        record["pictures"] = [str(path) for path in draw_room(inspection, load_room(room), out)]
    click.echo(json.dumps(record) if as_json else _report(record))
    if record["faults"]:
        raise SystemExit(1)


@scene.command()
@click.argument("room", metavar="NAME|DIR")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Write a scene folder that other programs can read.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def bake(room: str, out: Path | None, as_json: bool) -> None:
    """Bake the signed distance and labels of a room into the cache, or into a scene folder."""
    from experiments.scene.baking import bake_scene_folder, load_room

    baked = load_room(room) if out is None else bake_scene_folder(room, out)
    record = {
        "scene": baked.scene_id,
        "content_hash": baked.content_hash,
        "triangles": len(baked.faces),
        "nodes": list(baked.volumes.sdf.shape),
        "cell": baked.volumes.cell,
        "inside_share": round(float((baked.volumes.sdf < 0).mean()), 4),
        "classes": list(baked.class_names()),
        "folder": None if out is None else str(out),
    }
    click.echo(json.dumps(record) if as_json else _lines(record))


@scene.command()
@click.argument("room", metavar="NAME|DIR")
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, help="The .png or .jpg to write."
)
@click.option("--preset", default="720p", show_default=True, help="Name of a render preset.")
@click.option(
    "--azimuth",
    type=click.FloatRange(-360, 360),
    default=-45.0,
    show_default=True,
    help="Where the camera stands, degrees counter-clockwise from east.",
)
@click.option(
    "--elevation",
    type=click.FloatRange(5, 85),
    default=38.0,
    show_default=True,
    help="How far it looks down, degrees.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def picture(
    room: str, out: Path, preset: str, azimuth: float, elevation: float, as_json: bool
) -> None:
    """Draw a room from outside, as clips draw it: no ceiling, no walls on the camera's side."""
    from experiments.scene.baking import load_room
    from experiments.scene.stage_parts import stage_parts
    from renderer.room_picture import room_picture
    from renderer.settings import preset as settings_named
    from renderer.video import write_image

    baked, settings = load_room(room), settings_named(preset)
    image = room_picture(
        stage_parts(room), baked.room_size, baked.floor_z, azimuth, elevation, settings
    )
    write_image(out, image)
    record = {
        "scene": baked.scene_id,
        "picture": str(out),
        "width": settings.width,
        "height": settings.height,
    }
    click.echo(json.dumps(record) if as_json else _lines(record))


def _report(record: dict[str, Any]) -> str:
    """The figures as lines, then the faults."""
    shown = {key: value for key, value in record.items() if key not in ("faults", "overlaps")}
    overlaps = [f"{o['a']} in {o['b']} {100 * o['depth']:.1f} cm" for o in record["overlaps"]]
    faults = [f"FAULT: {fault}" for fault in record["faults"]] or ["no faults"]
    return "\n".join([_lines(shown), f"{'overlaps':18} {'; '.join(overlaps) or 'none'}", *faults])


def _lines(record: dict[str, Any]) -> str:
    return "\n".join(f"{key:18} {_plain(value)}" for key, value in record.items())


def _plain(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(str(entry) for entry in value) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{key} {entry}" for key, entry in value.items())
    return str(value)

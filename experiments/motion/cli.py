"""Commands `assets list` and `motion import`."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import click
from rich.progress import track

from experiments.motion.motion import Motion


@click.group()
def assets() -> None:
    """List bodies, motions and rooms with their checks."""


@assets.command("list")
@click.option("--body", default="male_slim", show_default=True, help="Embedded body to check on.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def list_assets(body: str, as_json: bool) -> None:
    """List bodies, default motions with their checks, and rooms."""
    from experiments.body.embedded import BODY_NAMES
    from experiments.motion.library import default_motions
    from experiments.scene.rooms import TEST_ROOMS, TRAINING_ROOMS

    specs = default_motions()
    rows = [
        motion_row(spec.motion_id, body)
        for spec in track(specs, "motions", console=_stderr(), transient=True)
    ]
    rooms = [{"id": name, "use": "test"} for name in TEST_ROOMS]
    rooms += [{"id": name, "use": "training"} for name in TRAINING_ROOMS]
    record = {"bodies": list(BODY_NAMES), "motions": rows, "rooms": rooms}
    if as_json:
        click.echo(json.dumps(record))
        return
    click.echo("bodies: " + ", ".join(BODY_NAMES))
    click.echo("rooms: " + ", ".join(room["id"] for room in rooms))
    click.echo(f"motions on {body}:\n{_table(rows)}")


def motion_row(motion_id: str, body_name: str) -> dict[str, Any]:
    """Everything `assets list` tells of one motion."""
    from experiments.motion.library import find_spec, load_motion

    spec = find_spec(motion_id)
    motion = load_motion(motion_id, body_name)
    extra = {"contact": list(spec.contact), "seat_height": spec.seat_height}
    return describe(motion) | extra | {"surface_height": spec.surface_height}


def describe(motion: Motion) -> dict[str, Any]:
    """Name, length, source and checks of a motion on its body, as plain values."""
    from experiments.motion.checks import check_motion
    from experiments.motion.figure import figure_of

    checks = dataclasses.asdict(check_motion(motion, figure_of(motion.body)))
    return {
        "id": motion.motion_id,
        "label": motion.label,
        "source": motion.source,
        "frames": motion.n_frames,
        "fps": motion.fps,
        "seconds": round(motion.duration_s, 3),
    } | {name: round(value, 3) for name, value in checks.items()}


@click.group()
def motion() -> None:
    """Import motion capture onto the embedded body."""


@motion.command("import")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Motion .npz to write.")
@click.option("--body", default="male_slim", show_default=True, help="Embedded body.")
@click.option("--fps", type=float, help="Frame rate of an .amc file (states none; CMU: 120).")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
def import_motion(file: Path, out: Path, body: str, fps: float | None, as_json: bool) -> None:
    """Read FILE (.amc, .bvh, AMASS .npz, DeepMimic .txt), retarget and clean it, write a motion .npz."""
    from experiments.motion.importing import read_motion_file
    from experiments.motion.motion import write_motion
    from renderer.files import InputError

    if out.suffix != ".npz":
        raise click.BadParameter(f"{out} does not end in .npz", param_hint="--out")
    imported = read_motion_file(file, body, fps)
    if out.is_dir():
        raise InputError(out, "--out", "a folder", "a file name")
    write_motion(imported, out)
    record = describe(imported) | {"file": str(out)}
    click.echo(json.dumps(record) if as_json else f"{out}\n{_table([record])}")


def _table(rows: list[dict[str, Any]]) -> str:
    heads = ["id", "seconds", "floor_error_cm", "foot_skate_cm_s", "sole_penetration_mm"]
    heads += ["lowest_other_cm", "joint_step_deg", "root_acceleration", "source"]
    cells = [heads, *[[str(row[head]) for head in heads] for row in rows]]
    widths = [max(len(line[column]) for line in cells) for column in range(len(heads))]
    lines = ["  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)) for line in cells]
    return "\n".join(line.rstrip() for line in lines)


def _stderr() -> Any:
    from rich.console import Console

    return Console(stderr=True)

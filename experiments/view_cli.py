"""The command `view`: placements as a page to look at in three dimensions."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from experiments.cli import progress_bars


@click.command()
@click.argument("placement", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder of the page.")
@click.option(
    "--tolerance",
    type=click.FloatRange(0.1, 100.0),
    default=10.0,
    show_default=True,
    help="Millimetres on both sides of a surface that count as contact.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def view(placement: tuple[Path, ...], out: Path, tolerance: float, as_json: bool) -> None:
    """Write a page that shows each PLACEMENT (.json or .npz) in its room, in three dimensions.

    The placements must be of one room, one length and one frame rate: they share a clock. The page
    needs no network and no server; open OUT/index.html in a browser.
    """
    from experiments.view import view_placements

    with progress_bars(" ".join(sys.argv)) as progress:
        record = view_placements(placement, out, tolerance, progress)
    bodies = record["bodies"].values()
    worst = max(body["error_max_mm"] for body in bodies)
    p99 = max(body["error_p99_mm"] for body in bodies)
    size = record["page_bytes"] / 2**20
    text = (
        f"{record['page']}: {len(bodies)} bodies, {size:.1f} MiB; skin within {p99:.2f} mm (99 %) and "
        f"{worst:.2f} mm (all) of the body model"
    )
    click.echo(json.dumps(record) if as_json else text)

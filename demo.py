"""The main job as one resumable run: `pace-study demo` and `make demo`."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, help="Folder for everything."
)
def demo(out: Path) -> None:
    """Place, render, ask, analyse: the whole path once, on the embedded defaults."""
    raise NotImplementedError

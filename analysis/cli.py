"""Commands of the analysis: `analyze`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from renderer.files import InputError

FOLDER = click.Path(file_okay=False, path_type=Path)
FILE = click.Path(dir_okay=False, path_type=Path)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("responses", type=FILE)
@click.option("--out", type=FOLDER, required=True, help="Folder for results.json, tables, figures.")
@click.option(
    "--catalogue",
    type=click.Path(path_type=Path),
    help="Stimulus set (catalogue.json or its folder): do its scores predict preference?",
)
@click.option(
    "--mode",
    type=click.Choice(["live", "pilot", "preview", "simulated"]),
    help="Which answers to analyse; default: live, or the only mode there is.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the bootstrap."
)
@click.option(
    "--bootstraps",
    type=click.IntRange(100),
    default=10_000,
    show_default=True,
    help="Draws of participants for the bootstrap intervals.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")  # fmt: skip
def analyze(
    responses: Path, out: Path, catalogue: Path | None, mode: str | None, seed: int,
    bootstraps: int, as_json: bool,
) -> None:  # fmt: skip
    """Turn the answers in RESPONSES (responses.csv) into preference tables, figures and a report."""
    from analysis.analyze import analyze as run
    from analysis.analyze import summary
    from analysis.tables import terminal_table

    results = run(responses, out, seed=seed, mode=mode, catalogue=catalogue, bootstraps=bootstraps)
    if as_json:
        click.echo(json.dumps(summary(results, out)))
        return
    click.echo(terminal_table(results))
    click.echo(f"\nwritten: {out / 'report.html'}, results.json, tables and figures beside it")


COMMANDS = {"analyze": analyze}


def main(name: str) -> None:
    """Run one command by itself: exit 2 on bad use, 1 with one clear line on bad input."""
    try:
        COMMANDS[name]()
    except InputError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)

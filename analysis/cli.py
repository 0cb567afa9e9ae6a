"""Commands of the analysis: `analyze`, `plan`, `check-claims`."""

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
    from rich.console import Console

    from analysis.analyze import analyze as run
    from analysis.analyze import summary
    from analysis.tables import terminal_table

    with Console(stderr=True).status("analysing"):
        results = run(
            responses, out, seed=seed, mode=mode, catalogue=catalogue, bootstraps=bootstraps
        )
    if as_json:
        click.echo(json.dumps(summary(results, out)))
        return
    click.echo(terminal_table(results))
    click.echo(f"\nwritten: {out / 'report.html'}, results.json, tables and figures beside it")


@click.command("check-claims", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("text", type=FILE)
@click.option(
    "--results",
    type=FILE,
    help="results.json to compare with; without it, only the text with itself.",
)
@click.option(
    "--claims",
    type=FILE,
    help="Names and aliases; default: claims.toml beside TEXT, then the results' names.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def check_claims(text: Path, results: Path | None, claims: Path | None, as_json: bool) -> None:
    """Compare the numbers in TEXT (.tex, .md) with results and one another; exit 1 on a mismatch."""
    from dataclasses import asdict

    from analysis.claims import check_text, claims_table

    found = check_text(text, claims, results)
    wrong = sum(claim.verdict == "MISMATCH" for claim in found)
    if as_json:
        click.echo(json.dumps({"mismatches": wrong, "claims": [asdict(claim) for claim in found]}))
    else:
        click.echo(claims_table(found))
    sys.exit(1 if wrong else 0)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--rate",
    "rates",
    type=float,
    multiple=True,
    default=(0.6,),
    show_default=True,
    help="True rate of a comparison; repeat for several.",
)
@click.option(
    "--participants",
    type=click.IntRange(2),
    multiple=True,
    default=(20, 42, 80),
    show_default=True,
    help="Number of participants; repeat for a curve.",
)
@click.option(
    "--answers",
    type=click.IntRange(2),
    default=20,
    show_default=True,
    help="Main trials of a participant per comparison.",
)
@click.option(
    "--pool", type=click.IntRange(2), help="Stimuli per comparison; default: as many as answers."
)
@click.option(
    "--sd-participant",
    type=click.FloatRange(0),
    default=0.5,
    show_default=True,
    help="Spread of participants on the logit scale.",
)
@click.option(
    "--sd-stimulus",
    type=click.FloatRange(0),
    default=0.5,
    show_default=True,
    help="Spread of stimuli on the logit scale.",
)
@click.option(
    "--dropout", type=float, default=0.0, show_default=True, help="Share who leave or are excluded."
)
@click.option(
    "--runs",
    type=click.IntRange(10),
    default=400,
    show_default=True,
    help="Simulated studies a row.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def plan(
    rates: tuple[float, ...], participants: tuple[int, ...], answers: int, pool: int | None,
    sd_participant: float, sd_stimulus: float, dropout: float, runs: int, seed: int, as_json: bool,
) -> None:  # fmt: skip
    """Forecast power and interval width of a study before it is run, by the report's own estimator."""
    from dataclasses import asdict

    from rich.console import Console
    from rich.progress import track

    from analysis import planner

    design = planner.Plan(
        rates, participants[0], answers, pool or answers, sd_participant, sd_stimulus, dropout
    )
    planner.check_plan(design)
    forecasts = []
    shown = Console(stderr=True)
    for count in track(participants, "simulating", console=shown, disable=not shown.is_terminal):
        forecasts += planner.curve(design, [count], runs, seed)
    if as_json:
        click.echo(
            json.dumps({"plan": asdict(design), "curve": [asdict(one) for one in forecasts]})
        )
        return
    click.echo(planner.plan_table(design, forecasts))
    floors = [
        f"{planner.independent_answers(rate, 0.8)} answers for {rate:.1%}"
        for rate in rates
        if rate != 0.5
    ]
    if floors:
        click.echo(
            "If answers were independent (they are not), 80 % power would take "
            f"{', '.join(floors)}."
        )


COMMANDS = {"analyze": analyze, "check-claims": check_claims, "plan": plan}


def main(name: str) -> None:
    """Run one command by itself: exit 2 on bad use, 1 with one clear line on bad input."""
    try:
        COMMANDS[name]()
    except InputError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)

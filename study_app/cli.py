"""The commands `study`, `serve` and `simulate`. Everything beyond click is imported when called."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from renderer.files import InputError

if TYPE_CHECKING:
    from sqlalchemy.orm import Session

    from study_app.db import Database

T = TypeVar("T")
Command = Callable[..., Any]

_database = click.option(
    "--database", "url", metavar="URL", help="Study database (default: PACE_DATABASE_URL)."
)
_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
_folder = click.Path(path_type=Path)


@click.group()
def study() -> None:
    """Create, open, watch, close and export studies."""


@study.command()
@click.argument("study_toml", type=_folder)
@click.option("--catalogue", type=_folder, required=True, help="Folder of the stimulus set.")
@_database
@_json
def create(study_toml: Path, catalogue: Path, url: str | None, as_json: bool) -> None:
    """Check STUDY_TOML against a stimulus set and freeze it as a version of the study."""
    from study_app.config import read_study
    from study_app.db import upgrade
    from study_app.lists import read_lists
    from study_app.stimuli import plan_study, shortages
    from study_app.studies import create_study

    config = read_study(study_toml)
    plan = plan_study(config, catalogue, study_toml)
    lists = read_lists(study_toml.parent / config.lists, plan) if config.lists else []
    database = _open_database(url)
    upgrade(database)

    def work(session: Session) -> dict[str, Any]:
        version = create_study(session, plan, datetime.now(UTC), lists)
        return {
            "study_id": version.study_id,
            "version": version.version,
            "pairs": sum(pair.kind == "main" for pair in plan.pairs),
            "cells": len(plan.cells),
            "notes": shortages(plan),
        }

    for note in shortages(plan):
        click.echo(f"note: {note}", err=True)
    _show(
        database.retry(work),
        as_json,
        "Study {study_id}, version {version}: {pairs} pairs in {cells} cells.",
    )


@study.command("open")
@click.argument("study_id")
@click.option("--mode", type=click.Choice(("live", "pilot")), default="live", show_default=True)
@click.option("--base-url", help="Public address of the server (default: PACE_BASE_URL).")
@_database
@_json
def open_(study_id: str, mode: str, base_url: str | None, url: str | None, as_json: bool) -> None:
    """Let participants in and print their link."""
    from study_app.settings import read_settings
    from study_app.studies import open_study

    base = read_settings(base_url=base_url).base_url.rstrip("/")
    version = _work(url, lambda session: open_study(session, study_id, mode, datetime.now(UTC)))
    result = {"study_id": study_id, "version": version.version, "mode": mode}
    result["participant_url"] = f"{base}/s/{study_id}"
    _show(result, as_json, "Open ({mode}). Link for participants: {participant_url}")


@study.command()
@click.argument("study_id")
@click.option("--preview", is_flag=True, help="For looking at the study in a browser yourself.")
@click.option("--base-url", help="Public address of the server (default: PACE_BASE_URL).")
@_database
@_json
def ticket(
    study_id: str, preview: bool, base_url: str | None, url: str | None, as_json: bool
) -> None:
    """Print a ticket for simulated participants, or a preview link; neither counts as live."""
    from study_app.settings import read_settings
    from study_app.studies import new_ticket

    mode = "preview" if preview else "simulated"
    token = _work(url, lambda session: new_ticket(session, study_id, mode, datetime.now(UTC)))
    result = {"ticket": token, "mode": mode}
    if preview:
        base = read_settings(base_url=base_url).base_url.rstrip("/")
        result["preview_url"] = f"{base}/s/{study_id}?ticket={token}"
    _show(result, as_json, "{preview_url}" if preview else "{ticket}")


@study.command()
@click.argument("study_id")
@_database
@_json
def status(study_id: str, url: str | None, as_json: bool) -> None:
    """Show progress and balance (never preferences: you stay blind)."""
    from study_app.studies import study_status

    result = _work(url, lambda session: study_status(session, study_id, datetime.now(UTC)))
    _show(
        result,
        as_json,
        "{study_id} is {state}. {mode}: {participants[enrolled]} enrolled, "
        "{participants[finished]} finished, {participants[left]} left, {answers} answers, "
        "{views_per_pair[min]} to {views_per_pair[max]} views a pair.",
    )


@study.command()
@click.argument("study_id")
@_database
@_json
def close(study_id: str, url: str | None, as_json: bool) -> None:
    """End data collection; from then on the export counts as frozen."""
    from study_app.studies import close_study

    version = _work(url, lambda session: close_study(session, study_id, datetime.now(UTC)))
    _show({"study_id": study_id, "version": version.version, "state": version.state}, as_json,
          "{study_id} is {state}.")  # fmt: skip


@study.command()
@click.argument("study_id")
@click.option("--out", type=_folder, required=True, help="Folder for responses.csv, codebook.json.")
@click.option("--mode", type=click.Choice(("live", "pilot", "preview", "simulated")))
@_database
@_json
def export(study_id: str, out: Path, mode: str | None, url: str | None, as_json: bool) -> None:
    """Write all answers and their codebook."""
    from study_app.export import export_study

    result = _work(url, lambda session: export_study(session, study_id, out, mode))
    _show(result, as_json, "{answers} answers in {responses}, codebook in {codebook}")


@study.command()
@click.argument("study_id")
@_database
@_json
def doctor(study_id: str, url: str | None, as_json: bool) -> None:
    """Sweep expired leases, recount every counter, look for every clip; exit 1 on any finding."""
    from study_app.doctor import examine

    result = _work(url, lambda session: examine(session, study_id, datetime.now(UTC)))
    _show(result, as_json, "{trials} trials and {clips} clips looked at, {swept} leases freed.")
    if result["findings"]:
        raise InputError("study", study_id, result["findings"][0], "no finding")


@study.command()
@click.argument("study_id")
@click.option("--participant", help="Pseudonymous code: delete this participant.")
@click.option("--platform-id", help="Identity on the recruiting platform: delete whoever had it.")
@click.option("--platform-key", is_flag=True, help="Cut the link to all platform identities.")
@_database
@_json
def forget(
    study_id: str,
    participant: str | None,
    platform_id: str | None,
    platform_key: bool,
    url: str | None,
    as_json: bool,
) -> None:
    """Delete a participant's data, or the link between answers and platform identities."""
    from study_app.forget import forget as forget_people

    if bool(participant) + bool(platform_id) + platform_key != 1:
        raise click.UsageError("give one of --participant, --platform-id, --platform-key")
    result = _work(
        url,
        lambda session: forget_people(
            session, study_id, datetime.now(UTC), participant, platform_id
        ),
    )
    _show(result, as_json, "Forgotten: {participants} participants, {identities} identities.")


@study.command()
@click.argument("study_id")
@click.argument("participant")
@click.option("--undo", is_flag=True, help="Count this participant again.")
@_database
@_json
def exclude(study_id: str, participant: str, undo: bool, url: str | None, as_json: bool) -> None:
    """Let others top up the pairs of PARTICIPANT (a code of the export); the answers stay."""
    from study_app.studies import exclude_participant

    result = _work(
        url,
        lambda session: exclude_participant(
            session, study_id, participant, not undo, datetime.now(UTC)
        ),
    )
    _show(result, as_json, "{participant}: excluded = {excluded}.")


@study.command()
@click.argument("study_toml", type=_folder, required=False)
@click.option("--participants", type=click.IntRange(1, 100_000), default=42, show_default=True)
@click.option("--dropout", type=click.FloatRange(0, 0.95), default=0.0, show_default=True)
@click.option("--motions", type=click.IntRange(1, 10_000), default=100, show_default=True,
              help="Motions a scene.")  # fmt: skip
@click.option("--seed", type=int, default=0, show_default=True)
@_json
def balance(
    study_toml: Path | None,
    participants: int,
    dropout: float,
    motions: int,
    seed: int,
    as_json: bool,
) -> None:
    """Certify balance before a launch: the real allocator over simulated arrivals (default: the paper)."""
    from study_app.balance import PAPER, certificate, design_of
    from study_app.config import read_study

    plan = PAPER if study_toml is None else design_of(read_study(study_toml), motions, study_toml)
    result = certificate(plan, participants, dropout, seed)
    if as_json:
        click.echo(json.dumps(result))
        return
    from study_app.balance import table

    click.echo(table(result))


@study.command()
@click.argument("study_toml", type=_folder)
@click.option("--motions", type=click.IntRange(1, 10_000), required=True, help="Motions a scene.")
@click.option("--participants", type=click.IntRange(2, 100_000), default=42, show_default=True)
@click.option("--rate", type=click.FloatRange(0, 1, min_open=True, max_open=True), default=0.6,
              show_default=True, help="True preference for the target.")  # fmt: skip
@click.option("--dropout", type=click.FloatRange(0, 0.95), default=0.0, show_default=True)
@click.option("--runs", type=click.IntRange(10, 100_000), default=200, show_default=True)
@click.option("--seed", type=int, default=0, show_default=True)
@_json
def forecast(
    study_toml: Path,
    motions: int,
    participants: int,
    rate: float,
    dropout: float,
    runs: int,
    seed: int,
    as_json: bool,
) -> None:
    """Forecast power and interval width of STUDY_TOML, by the report's own estimator."""
    from dataclasses import asdict

    from analysis import planner
    from study_app.config import read_study
    from study_app.forecast import study_plan

    plan = study_plan(read_study(study_toml), motions, participants, rate, dropout, study_toml)
    found = planner.forecast(plan, runs, seed)
    record = {"plan": asdict(plan), "forecast": asdict(found)}
    click.echo(json.dumps(record) if as_json else planner.plan_table(plan, [found]))


@click.command()
@_database
@click.option("--host", default="127.0.0.1", show_default=True)
@click.option("--port", type=click.IntRange(0, 65535), default=8000, show_default=True,
              help="0 = any free one.")  # fmt: skip
@click.option("--workers", type=click.IntRange(1, 64), help="Processes (default: PACE_WORKERS).")
@_json
def serve(url: str | None, host: str, port: int, workers: int | None, as_json: bool) -> None:
    """Serve studies to participants until stopped; prints the address when ready."""
    from study_app.server import serve_forever
    from study_app.settings import read_settings

    serve_forever(read_settings(database_url=url, workers=workers), host, port, as_json)


@click.command()
@click.option("--url", "server", required=True, help="Address of the running server.")
@click.option("--ticket", required=True, help="From `study ticket`.")
@click.option("--participants", type=click.IntRange(1, 10_000), default=12, show_default=True)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option(
    "--database", "url", metavar="URL", help="Names the clip groups in the printed truth."
)
@_json
def simulate(
    server: str, ticket: str, participants: int, seed: int, url: str | None, as_json: bool
) -> None:
    """Let simulated participants answer over HTTP, by a truth drawn from the seed and printed."""
    from rich.console import Console
    from rich.progress import Progress

    from study_app.simulate import simulate as run

    with Progress(console=Console(stderr=True), transient=True, disable=as_json) as bar:
        task = bar.add_task("answers", total=None)
        result = run(server, ticket, participants, seed, lambda n: bar.update(task, completed=n))
    if url is not None:
        result["truth"]["methods"] = _named(url, ticket, result["truth"]["groups"])
    if as_json:
        click.echo(json.dumps(result))
        return
    truth = result["truth"]
    click.echo(f"SIMULATED: {participants} participants, {result['answers']} answers (seed {seed})")
    click.echo(
        f"truth: side bias {truth['side_bias']:+.3f}, lapse {truth['lapse']:.3f}, log worths"
    )
    for name, worth in truth.get("methods", truth["groups"]).items():
        click.echo(f"  {name:24s} {worth:+.3f}")


def _named(url: str, ticket: str, groups: dict[str, float]) -> dict[str, float]:
    """Worths by method name; only who can open the database can say which group is which method."""
    from study_app.studies import ticket_groups

    named = _work(url, lambda session: ticket_groups(session, ticket))
    return {method: groups[group] for method, group in sorted(named.items()) if group in groups}


def _open_database(url: str | None) -> Database:
    from study_app.db import Database
    from study_app.settings import read_settings

    return Database(read_settings(database_url=url).database_url)


def _work(url: str | None, work: Callable[[Session], T]) -> T:
    """Run an operator's work on an existing database; a database that is away becomes one line."""
    from sqlalchemy.exc import OperationalError

    from study_app.db import require_schema

    database = _open_database(url)
    try:
        require_schema(database)
        return database.retry(work)
    except OperationalError as error:
        reason = str(error.orig).strip().splitlines()[0]
        raise InputError("database", "connection", reason, "a database that answers") from None
    finally:
        database.close()


def _show(result: dict[str, Any], as_json: bool, line: str) -> None:
    click.echo(json.dumps(result) if as_json else line.format(**result))

"""`responses.csv` and `codebook.json`: the only way of answers out of the database."""

from __future__ import annotations

import csv
import dataclasses
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session, joinedload

from analysis.columns import COLUMN_NAMES, COLUMNS, SCHEMA_VERSION, UNKNOWN
from analysis.rules import parse_rules, rules_sha256
from renderer.files import atomic_path, write_json
from study_app.models import Pair, Participant, Response, StudyVersion, Trial
from study_app.studies import find_study

RESPONSES, CODEBOOK = "responses.csv", "codebook.json"


def export_study(
    session: Session, study_id: str, folder: Path, mode: str | None = None
) -> dict[str, Any]:
    """Write both files, each whole or not at all; return paths and counts.

    All versions of the study are exported (each row names its own), all modes unless one is asked for.
    """
    version = find_study(session, study_id)
    rows = list(_rows(session, study_id, mode))
    responses = folder / RESPONSES
    with (
        atomic_path(responses) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as out,
    ):
        writer = csv.DictWriter(out, COLUMN_NAMES, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    counts = dict(sorted(Counter(row["mode"] for row in rows).items()))
    write_json(folder / CODEBOOK, _codebook(version, counts))
    return {
        "study_id": study_id,
        "responses": str(responses),
        "codebook": str(folder / CODEBOOK),
        "answers": len(rows),
        "answers_by_mode": counts,
    }


def _rows(session: Session, study_id: str, mode: str | None) -> Iterator[dict[str, str]]:
    query = (
        select(Response)
        .join(Response.trial)
        .join(Trial.participant)
        .join(Participant.version)
        .where(StudyVersion.study_id == study_id)
        .options(
            joinedload(Response.trial)
            .joinedload(Trial.participant)
            .joinedload(Participant.version),
            joinedload(Response.trial).joinedload(Trial.pair).joinedload(Pair.target_clip),
            joinedload(Response.trial).joinedload(Trial.pair).joinedload(Pair.baseline_clip),
        )
        .order_by(Participant.version_id, Participant.serial, Trial.ordinal)
    )
    if mode is not None:
        query = query.where(Participant.mode == mode)
    for response in session.scalars(query):
        yield _row(response)


def _row(response: Response) -> dict[str, str]:
    """One answer in the terms of `analysis.columns`; the method comes from side and trial."""
    trial, person = response.trial, response.trial.participant
    pair, version = trial.pair, person.version
    assert pair is not None
    methods = {"first": trial.first_clip.method, "second": trial.second_clip.method}
    return {
        "study_id": version.study_id,
        "study_version": version.version,
        "mode": person.mode,
        "participant": person.code,
        "trial_index": str(trial.ordinal),
        "block": str(trial.block),
        "trial_kind": trial.kind,
        "pair_id": pair.label,
        "scene": pair.scene,
        "motion": pair.motion,
        "target": pair.target_clip.method,
        "baseline": pair.baseline_clip.method,
        "first_method": methods["first"],
        "second_method": methods["second"],
        "expected_method": pair.expected_method or "",
        "repeat_of": "" if trial.repeat_of is None else str(trial.repeat_of),
        "layout": response.layout or UNKNOWN,
        "chosen_position": response.chosen_position,
        "chosen_method": methods[response.chosen_position],
        "response_time_ms": _measured(response.response_time_ms),
        "decision_time_ms": _measured(response.decision_time_ms),
        "plays_first": _measured(response.plays_first),
        "plays_second": _measured(response.plays_second),
        "viewed_first": response.viewed_first,
        "viewed_second": response.viewed_second,
        "started_at": UNKNOWN if trial.shown_at is None else _moment(trial.shown_at),
        "answered_at": _moment(response.answered_at),
        "late": "true" if response.late else "false",
    }


def _measured(value: int | None) -> str:
    return UNKNOWN if value is None else str(value)


def _moment(value: datetime) -> str:
    return value.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _codebook(version: StudyVersion, counts: dict[str, int]) -> dict[str, Any]:
    rules = parse_rules("study", version.config["exclusions"])
    mains = len(version.cells) * version.config["trials_per_cell"]
    return {
        "schema_version": SCHEMA_VERSION,
        "study_id": version.study_id,
        "study_version": version.version,
        "study_state": "closed" if version.state == "closed" else "open",
        "title": version.config["title"],
        "question": version.config["question"],
        "target": version.config["target"],
        "baselines": version.config["baselines"],
        "pairs": version.config["pairs"],
        "policy": version.config["policy"],
        "catalogue_sha256": version.catalogue_sha256,
        "main_trials": mains,
        "answers_by_mode": counts,
        "withdrawn": version.withdrawn,
        "exclusions": rules,
        "exclusions_sha256": rules_sha256(rules),
        "exclusions_changed_at": _moment(version.created_at),
        "collection_began_at": None if version.opened_at is None else _moment(version.opened_at),
        "closed_at": None if version.closed_at is None else _moment(version.closed_at),
        "columns": [dataclasses.asdict(column) for column in COLUMNS],
    }

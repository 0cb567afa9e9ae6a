"""The doctor recounts: counters are a cache of the trials, and every clip must still be there."""

from __future__ import annotations

from collections import Counter
from datetime import datetime
from pathlib import Path
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from renderer.files import file_sha256
from study_app.allocation import sweep
from study_app.models import (
    COUNTED_STATES,
    ClipRow,
    Pair,
    PairCount,
    Participant,
    Response,
    StudyVersion,
    Trial,
)
from study_app.studies import find_study


def examine(session: Session, study_id: str, now: datetime) -> dict[str, Any]:
    """Sweep expired leases, then compare all counters with a recount and all clips with their hashes."""
    version = find_study(session, study_id)
    swept = sweep(session, version.id, now)
    session.flush()
    findings = [*_counter_faults(session, version), *_answer_faults(session, version)]
    clips = session.scalars(select(ClipRow).where(ClipRow.version_id == version.id)).all()
    findings += _clip_faults(version, list(clips))
    trials = session.scalars(
        select(Trial.id).join(Trial.participant).where(Participant.version_id == version.id)
    ).all()
    return {
        "study_id": study_id,
        "version": version.version,
        "trials": len(trials),
        "clips": len(clips),
        "swept": swept,
        "findings": findings,
    }


def recount(session: Session, version_id: int) -> Counter[tuple[int, str, bool]]:
    """Views per (pair, mode, target first) from the trials alone, by what their states mean."""
    rows = session.execute(
        select(Trial.pair_id, Participant.mode, Trial.target_first)
        .join(Trial.participant)
        .where(Participant.version_id == version_id, Participant.excluded.is_(False))
        .where(Trial.state.in_(COUNTED_STATES), Trial.kind != "repeat")
    )
    return Counter((pair or 0, mode, bool(first)) for pair, mode, first in rows)


def _counter_faults(session: Session, version: StudyVersion) -> list[str]:
    truth = recount(session, version.id)
    rows = session.execute(
        select(PairCount, Pair.label)
        .join(Pair, Pair.id == PairCount.pair_id)
        .where(Pair.version_id == version.id)
        .execution_options(populate_existing=True)
    )
    faults = []
    for row, label in rows:
        true = (truth[row.pair_id, row.mode, True], truth[row.pair_id, row.mode, False])
        if (row.target_first, row.target_second) != true:
            shown = f"{row.target_first}/{row.target_second}"
            faults.append(f"pair {label}, {row.mode}: counter {shown}, recount {true[0]}/{true[1]}")
    return faults


def _answer_faults(session: Session, version: StudyVersion) -> list[str]:
    """An answered trial has its response, and only such a trial has one."""
    query = (
        select(Trial.id, Trial.state, Response.id)
        .join(Trial.participant)
        .outerjoin(Response, Response.trial_id == Trial.id)
        .where(Participant.version_id == version.id)
    )
    return [
        f"trial {trial}: state {state}, response {response}"
        for trial, state, response in session.execute(query)
        if (state == "answered") != (response is not None)
    ]


def _clip_faults(version: StudyVersion, clips: list[ClipRow]) -> list[str]:
    folder = Path(version.catalogue_folder)
    faults = []
    for clip in clips:
        if not (folder / clip.file).is_file():
            faults.append(f"clip {clip.clip_id}: file is missing")
        elif file_sha256(folder / clip.file) != clip.sha256:
            faults.append(f"clip {clip.clip_id}: file was altered")
    return faults

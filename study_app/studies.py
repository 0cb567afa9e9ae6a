"""What the operator does with a study: create, open, ticket, status, close, exclude, forget, doctor."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from renderer.files import InputError, value_sha256
from study_app import design
from study_app.config import StudyConfig
from study_app.models import (
    COUNTED_STATES,
    MODES,
    AuditEntry,
    Cell,
    ClipRow,
    Pair,
    PairCount,
    Participant,
    Response,
    Secret,
    StudyVersion,
    Ticket,
    Trial,
)
from study_app.stimuli import PairPlan, StudyPlan
from study_app.tokens import group_name, new_token, token_hash


def create_study(
    session: Session, plan: StudyPlan, now: datetime, lists: list[Any] | None = None
) -> StudyVersion:
    """Freeze a study; the same file over the same catalogue is the same version and changes nothing."""
    config = plan.config.model_dump(mode="json")
    version_hash = study_hash(plan, lists or [])
    existing = session.scalar(
        select(StudyVersion).where(
            StudyVersion.study_id == plan.config.study_id, StudyVersion.version == version_hash
        )
    )
    if existing is not None:
        existing.catalogue_folder = str(plan.folder)  # same content, perhaps moved
        return existing
    version = StudyVersion(
        study_id=plan.config.study_id,
        version=version_hash,
        config=config,
        lists=lists or [],
        catalogue_folder=str(plan.folder),
        catalogue_sha256=plan.catalogue_sha256,
        group_key=new_token(),
        created_at=now,
    )
    session.add(version)
    session.flush()
    _store_pairs(session, version, plan)
    _audit(session, version, now, "create", {"pairs": len(plan.pairs)})
    return version


def study_hash(plan: StudyPlan, lists: list[Any]) -> str:
    """Hash of everything that a participant could notice: configuration, catalogue, lists."""
    record = {
        "config": plan.config.model_dump(mode="json"),
        "catalogue": plan.catalogue_sha256,
        "lists": lists,
    }
    return value_sha256(record)[:16]


def _store_pairs(session: Session, version: StudyVersion, plan: StudyPlan) -> None:
    cells = [
        Cell(version_id=version.id, scene=cell.scene, target=cell.target, baseline=cell.baseline)
        for cell in plan.cells
    ]
    session.add_all(cells)
    clips = {
        clip.clip_id: ClipRow(
            version_id=version.id,
            clip_id=clip.clip_id,
            method=clip.method,
            file=clip.file,
            poster=clip.poster,
            sha256=clip.sha256,
            duration_s=clip.duration_s,
            width=clip.width,
            height=clip.height,
        )
        for pair in plan.pairs
        for clip in (pair.target, pair.baseline)
    }
    session.add_all(clips.values())
    session.flush()
    pairs = [_pair_row(version, pair, cells, clips) for pair in plan.pairs]
    session.add_all(pairs)
    session.flush()
    session.add_all(PairCount(pair_id=pair.id, mode=mode) for pair in pairs for mode in MODES)


def _pair_row(
    version: StudyVersion, pair: PairPlan, cells: list[Cell], clips: dict[str, ClipRow]
) -> Pair:
    label = value_sha256([pair.kind, pair.target.clip_id, pair.baseline.clip_id])[:12]
    return Pair(
        version_id=version.id,
        kind=pair.kind,
        cell_id=None if pair.cell is None else cells[pair.cell].id,
        label=f"p{label}",
        scene=pair.target.scene,
        motion=pair.target.motion,
        target_clip_id=clips[pair.target.clip_id].id,
        baseline_clip_id=clips[pair.baseline.clip_id].id,
        expected_method=pair.expected,
    )


def find_study(session: Session, study_id: str) -> StudyVersion:
    """The version that commands act on: the open one, else the newest. Raises `InputError`."""
    versions = session.scalars(
        select(StudyVersion).where(StudyVersion.study_id == study_id).order_by(StudyVersion.id)
    ).all()
    if not versions:
        known = session.scalars(select(StudyVersion.study_id).distinct()).all()
        wanted = (
            f"one of {', '.join(sorted(known))}" if known else "a study that was created before"
        )
        raise InputError("study", "study_id", study_id, wanted)
    return next((version for version in versions if version.state == "open"), versions[-1])


def newest_version(session: Session, study_id: str) -> StudyVersion:
    """The version that was created last, open or not."""
    find_study(session, study_id)
    newest = session.scalar(
        select(StudyVersion)
        .where(StudyVersion.study_id == study_id)
        .order_by(StudyVersion.id.desc())
        .limit(1)
    )
    assert newest is not None
    return newest


def open_study(session: Session, study_id: str, mode: str, now: datetime) -> StudyVersion:
    """Let participants in; `mode` says whether their answers count as live or pilot."""
    version = newest_version(session, study_id)
    current = find_study(session, study_id)
    if current.id != version.id and current.state == "open":
        raise InputError(
            "study", study_id, f"version {current.version} is open", "it to be closed first"
        )
    if version.state == "closed":
        raise InputError(
            "study", study_id, "closed", "a study that was not closed (its data are frozen)"
        )
    if version.state == "draft" or version.open_mode != mode:
        version.state, version.open_mode = "open", mode
        version.opened_at = version.opened_at or now
        _audit(session, version, now, "open", {"mode": mode})
    return version


def close_study(session: Session, study_id: str, now: datetime) -> StudyVersion:
    """End data collection; from now on answers are refused and the export counts as frozen."""
    version = find_study(session, study_id)
    if version.state != "closed":
        version.state, version.closed_at = "closed", now
        _audit(session, version, now, "close", {})
    return version


def new_ticket(session: Session, study_id: str, mode: str, now: datetime) -> str:
    """A ticket that lets simulated or preview participants in; shown once, stored as a hash."""
    version = find_study(session, study_id)
    if version.state == "closed":
        raise InputError("study", study_id, "closed", "a study that still takes answers")
    token = new_token()
    session.add(
        Ticket(version_id=version.id, token_hash=token_hash(token), mode=mode, created_at=now)
    )
    _audit(session, version, now, "ticket", {"mode": mode})
    return token


def study_status(session: Session, study_id: str, now: datetime) -> dict[str, Any]:
    """Progress and balance of a study, without any preference: the experimenter stays blind."""
    version = find_study(session, study_id)
    states = {
        mode: _participants(session, version, mode, now)
        for mode in MODES
        if _any_participant(session, version, mode)
    }
    mode = version.open_mode if version.state != "draft" else "live"
    if not states.get(mode) and states:
        mode = next(iter(states))
    return {
        "study_id": version.study_id,
        "version": version.version,
        "state": version.state,
        "mode": mode,
        "participants": states.get(mode, {"enrolled": 0, "finished": 0, "left": 0}),
        "withdrawn": version.withdrawn,
        "answers": _answers(session, version, mode),
        "views_per_pair": _views_per_pair(session, version, mode),
        "modes": {name: {**counts, "answers": _answers(session, version, name)}
                  for name, counts in states.items()},
    }  # fmt: skip


def _any_participant(session: Session, version: StudyVersion, mode: str) -> bool:
    found = session.scalar(
        select(Participant.id)
        .where(Participant.version_id == version.id, Participant.mode == mode)
        .limit(1)
    )
    return found is not None


def _participants(
    session: Session, version: StudyVersion, mode: str, now: datetime
) -> dict[str, int]:
    """`left` = not finished and without a living lease."""
    people = select(func.count()).where(
        Participant.version_id == version.id, Participant.mode == mode
    )
    enrolled = session.scalar(people) or 0
    finished = session.scalar(people.where(Participant.state == "finished")) or 0
    alive = (
        select(Trial.id)
        .where(Trial.participant_id == Participant.id, Trial.lease_expires_at > now)
        .where(Trial.state.in_(("leased", "shown")))
        .exists()
    )
    left = session.scalar(people.where(Participant.state != "finished", ~alive)) or 0
    return {"enrolled": enrolled, "finished": finished, "left": left}


def _answers(session: Session, version: StudyVersion, mode: str) -> int:
    query = (
        select(func.count(Response.id))
        .join(Response.trial)
        .join(Trial.participant)
        .where(Participant.version_id == version.id, Participant.mode == mode)
    )
    return session.scalar(query) or 0


def _views_per_pair(session: Session, version: StudyVersion, mode: str) -> dict[str, int]:
    views = PairCount.target_first + PairCount.target_second
    low, high = session.execute(
        select(func.min(views), func.max(views))
        .join(Pair, Pair.id == PairCount.pair_id)
        .where(Pair.version_id == version.id, Pair.kind == "main", PairCount.mode == mode)
    ).one()
    return {"min": low or 0, "max": high or 0}


def installation_secret(session: Session, name: str) -> str:
    """A key that is made once and kept: `cookies` or `platform`."""
    row = session.get(Secret, name)
    if row is None:
        row = Secret(name=name, value=new_token())
        session.add(row)
        session.flush()
    return row.value


def study_config(version: StudyVersion) -> StudyConfig:
    """The frozen configuration of a version."""
    return StudyConfig.model_validate(version.config, strict=False)


def study_cells(version: StudyVersion) -> list[design.Cell]:
    """Cells in their stored order, as the pure design knows them."""
    return [design.Cell(cell.scene, cell.target, cell.baseline) for cell in version.cells]


def _audit(
    session: Session, version: StudyVersion, now: datetime, action: str, detail: dict[str, Any]
) -> None:
    session.add(AuditEntry(version_id=version.id, at=now, action=action, detail=detail))


def exclude_participant(
    session: Session, study_id: str, code: str, excluded: bool, now: datetime
) -> dict[str, Any]:
    """Take a participant's trials out of the pair counters, or put them back; answers stay."""
    from study_app.allocation import count, lock_participant

    version = find_study(session, study_id)
    found = session.scalar(
        select(Participant.id).where(Participant.version_id == version.id, Participant.code == code)
    )
    if found is None:
        raise InputError("study", study_id, code, "the code of a participant")
    participant = lock_participant(session, found)
    participant.excluded = excluded
    for trial in participant.trials:
        counts = not excluded and trial.state in COUNTED_STATES
        count(session, trial, participant.mode, counted=counts)
    _audit(session, version, now, "exclude" if excluded else "include", {"participant": code})
    return {"study_id": study_id, "participant": code, "excluded": excluded}


def ticket_groups(session: Session, token: str) -> dict[str, str]:
    """Method -> opaque group name under this ticket; needs the database, so simulation stays blind."""
    ticket = session.scalar(select(Ticket).where(Ticket.token_hash == token_hash(token)))
    if ticket is None:
        raise InputError("study", "ticket", token[:6] + "...", "a ticket of this database")
    version = session.get_one(StudyVersion, ticket.version_id)
    methods = session.scalars(
        select(ClipRow.method).where(ClipRow.version_id == version.id).distinct()
    )
    return {m: group_name(version.group_key, ticket.token_hash, m) for m in methods}

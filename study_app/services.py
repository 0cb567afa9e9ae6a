"""What a participant's browser can do: enrol, see the next trial, report, answer, finish, withdraw.

Views call these functions and nothing else. Each runs inside one write transaction that the caller
opens (`Database.retry`), so a request either happened or it did not.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime, timedelta
from random import Random
from typing import Any

from sqlalchemy import delete, select, update
from sqlalchemy.orm import Session
from sqlalchemy.orm.attributes import set_committed_value

from study_app import design
from study_app.allocation import bind_next, count, lock_participant, renew_leases, seats_ahead
from study_app.config import StudyConfig
from study_app.db import Database
from study_app.models import (
    AuditEntry,
    Participant,
    Response,
    StudyVersion,
    Ticket,
    Trial,
    ViewingEvent,
)
from study_app.studies import study_config
from study_app.tokens import new_code, new_token, token_hash
from study_app.viewing import Evidence, Report, viewing_evidence


class Refused(Exception):
    """A request that cannot be served now; `reason` names the page to show."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


@dataclass(frozen=True)
class Arrival:
    """How somebody comes to enrol."""

    mode: str
    consent_sha256: str
    browser: str = "unknown"
    platform_hash: str | None = None
    ticket_id: int | None = None


@dataclass(frozen=True)
class Answer:
    """An answer as the page sent it, already checked for type and range."""

    answer_uuid: str
    chosen_position: str
    response_time_ms: int | None = None
    decision_time_ms: int | None = None
    plays_first: int | None = None
    plays_second: int | None = None
    layout: str | None = None
    screen: dict[str, Any] = field(default_factory=dict)
    scripted: bool = True
    """False for the plain form of a browser without scripts."""


def enrol(session: Session, version_id: int, arrival: Arrival, now: datetime) -> tuple[int, str]:
    """Enrol a participant and lay out all seats; return the participant's id and secret token.

    A person from a recruiting platform who comes again gets the old session back under a new token.
    """
    version = session.scalar(
        select(StudyVersion).where(StudyVersion.id == version_id).with_for_update()
    )
    assert version is not None
    _require_running(version, arrival.mode)
    token = new_token()
    known = _known_person(session, version, arrival)
    if known is not None:
        known.token_hash = token_hash(token)
        return known.id, token
    version.enrolled += 1
    participant = Participant(
        version_id=version.id,
        code=new_code(),
        serial=version.enrolled,
        mode=arrival.mode,
        token_hash=token_hash(token),
        ticket_id=arrival.ticket_id,
        platform_hash=arrival.platform_hash,
        enrolled_at=now,
        seen_at=now,
        consent_sha256=arrival.consent_sha256,
        browser=arrival.browser,
        steps={},
    )
    participant.trials = _seats(version, participant)
    session.add(participant)
    session.flush()
    return participant.id, token


def _known_person(session: Session, version: StudyVersion, arrival: Arrival) -> Participant | None:
    if arrival.platform_hash is None:
        return None
    return session.scalar(
        select(Participant).where(
            Participant.version_id == version.id,
            Participant.mode == arrival.mode,
            Participant.platform_hash == arrival.platform_hash,
        )
    )


def _seats(version: StudyVersion, participant: Participant) -> list[Trial]:
    config = study_config(version)
    rng = Random(f"{config.seed}|{participant.mode}|{participant.serial}|plan")
    plan = design.plan_session(
        len(version.cells), config.trials_per_cell, session_extras(config), rng
    )
    cells = [cell.id for cell in version.cells]
    if config.policy == "list":
        plan = _follow_list(plan, version, participant)
    return [
        Trial(
            ordinal=seat.ordinal,
            block=seat.block,
            kind=seat.kind,
            cell_id=None if seat.cell is None else cells[seat.cell],
            repeat_of=seat.repeat_of,
        )
        for seat in plan
    ]


def _follow_list(
    plan: list[design.PlannedTrial], version: StudyVersion, participant: Participant
) -> list[design.PlannedTrial]:
    """Give the main seats the cells that the prepared list names, in its order."""
    rows = iter(version.lists[(participant.serial - 1) % len(version.lists)])
    cells = {(c.scene, c.target, c.baseline): i for i, c in enumerate(version.cells)}
    followed = []
    for seat in plan:
        cell = seat.cell
        if seat.kind == "main":
            row = next(rows)
            cell = cells[row["scene"], row["target"], row["baseline"]]
        followed.append(
            design.PlannedTrial(seat.ordinal, seat.block, seat.kind, cell, seat.repeat_of)
        )
    return followed


def session_extras(config: StudyConfig) -> design.Extras:
    """The extra trials of a session in the form of the pure design."""
    extra = config.extra_trials
    return design.Extras(extra.catch, extra.identical, extra.repeat, extra.practice)


def find_participant(session: Session, token: str, study_id: str | None = None) -> Participant:
    """The participant whose secret token this is. Raises `Refused("not_found")`."""
    participant = session.scalar(
        select(Participant).where(Participant.token_hash == token_hash(token))
    )
    if participant is None or study_id not in (None, participant.version.study_id):
        raise Refused("not_found")
    return participant


def find_ticket(session: Session, token: str) -> Ticket:
    """The ticket with this token. Raises `Refused("not_found")`."""
    ticket = session.scalar(select(Ticket).where(Ticket.token_hash == token_hash(token)))
    if ticket is None:
        raise Refused("not_found")
    return ticket


def bind_window(
    database: Database, participant_id: int, now: datetime, window: int, lease: timedelta
) -> None:
    """Bind pairs to the present seat and those that the page preloads, one short transaction each."""
    while database.retry(lambda session: bind_next(session, participant_id, now, window, lease)):
        pass


def show_trial(
    session: Session, participant_id: int, now: datetime, lease: timedelta
) -> Trial | None:
    """The present trial, marked as shown and with its lease renewed; None when all are answered."""
    participant = lock_participant(session, participant_id)
    _require_running(participant.version, participant.mode)
    ahead = seats_ahead(participant)
    if not ahead:
        return None
    trial = ahead[0]
    set_committed_value(trial, "participant", participant)  # the session itself would let go of it
    trial.shown_at = trial.shown_at or now
    if trial.state == "leased":
        trial.state = "shown"
    _alive(session, participant, now, lease)
    return trial


def record_events(
    session: Session,
    participant_id: int,
    trial_token: str,
    events: list[dict[str, Any]],
    now: datetime,
    lease: timedelta,
) -> int:
    """Store reports of the page, each once; return how many were new. Any report renews the leases."""
    participant = lock_participant(session, participant_id)
    trial = _own_trial(session, participant, trial_token)
    _alive(session, participant, now, lease)
    known = set(session.scalars(select(ViewingEvent.uuid).where(ViewingEvent.trial_id == trial.id)))
    fresh = {event["uuid"]: event for event in events if event["uuid"] not in known}
    for event in fresh.values():
        session.add(
            ViewingEvent(
                trial_id=trial.id,
                uuid=event["uuid"],
                kind=event["kind"],
                position=event.get("position"),
                detail=event.get("detail", {}),
                received_at=now,
            )
        )
    return len(fresh)


def record_answer(
    session: Session,
    participant_id: int,
    trial_token: str,
    answer: Answer,
    now: datetime,
    lease: timedelta,
) -> Response:
    """Store the answer of a trial, or return the one that is stored already.

    A double click, a second tab, a resent request after a lost reply: all get the first answer
    back. A lease that expired meanwhile makes the answer late, not void.
    """
    participant = lock_participant(session, participant_id)
    trial = _own_trial(session, participant, trial_token)
    if trial.response is not None:
        return trial.response
    _require_running(participant.version, participant.mode)
    expires = trial.lease_expires_at
    late = trial.state == "expired" or (expires is not None and expires <= now)
    trial.response = Response(
        answer_uuid=answer.answer_uuid,
        chosen_position=answer.chosen_position,
        response_time_ms=answer.response_time_ms,
        decision_time_ms=answer.decision_time_ms,
        plays_first=answer.plays_first,
        plays_second=answer.plays_second,
        viewed_first=_evidence(participant, trial, "first", answer.scripted),
        viewed_second=_evidence(participant, trial, "second", answer.scripted),
        layout=answer.layout,
        screen=answer.screen,
        answered_at=now,
        late=late,
    )
    count(session, trial, participant.mode, counted=not participant.excluded)
    trial.state, trial.lease_expires_at = "answered", None
    feedback = practice_feedback(trial)
    if feedback is not None:
        note = {f"practice-{trial.ordinal}": {"feedback": feedback}}
        participant.steps = {**participant.steps, **note}
    _alive(session, participant, now, lease)
    session.flush()
    return trial.response


def practice_feedback(trial: Trial) -> str | None:
    """Practice trials tell whether the gross failure was noticed; no other trial tells anything."""
    if trial.kind != "practice" or trial.response is None or trial.pair is None:
        return None
    chosen_first = trial.response.chosen_position == "first"
    clip = trial.first_clip if chosen_first else trial.second_clip
    return "good" if clip.method == trial.pair.expected_method else "gross"


def _evidence(participant: Participant, trial: Trial, position: str, scripted: bool) -> Evidence:
    if participant.mode == "simulated":
        return "unknown"
    if not scripted:
        return "unproven"
    reports = [
        Report(event.kind, event.position, event.received_at, event.detail)
        for event in trial.events
    ]
    clip = trial.first_clip if position == "first" else trial.second_clip
    return viewing_evidence(reports, position, clip.duration_s)


def skip_trial(
    session: Session, participant_id: int, trial_token: str, now: datetime, lease: timedelta
) -> None:
    """Give up a trial whose clip would not play; its pair goes to somebody else."""
    participant = lock_participant(session, participant_id)
    trial = _own_trial(session, participant, trial_token)
    if trial.state == "answered":
        return
    count(session, trial, participant.mode, counted=False)
    trial.state, trial.lease_expires_at = "void", None
    _alive(session, participant, now, lease)


def _own_trial(session: Session, participant: Participant, trial_token: str) -> Trial:
    trial = session.scalar(
        select(Trial).where(Trial.participant_id == participant.id, Trial.token == trial_token)
    )
    if trial is None:
        raise Refused("bad_request")
    return trial


def _alive(session: Session, participant: Participant, now: datetime, lease: timedelta) -> None:
    participant.seen_at = now
    renew_leases(session, participant, now, lease)


def _require_running(version: StudyVersion, mode: str) -> None:
    """Simulated and preview participants may come before the study opens; nobody after it closed."""
    if version.state == "closed":
        raise Refused("closed")
    if version.state == "draft" and mode not in ("simulated", "preview"):
        raise Refused("unopened")


def record_step(
    session: Session, participant_id: int, name: str, detail: dict[str, Any], now: datetime
) -> None:
    """Note that a page beside the trials is done, with what was entered or measured there."""
    participant = lock_participant(session, participant_id)
    participant.steps = {**participant.steps, name: detail}
    participant.seen_at = now


def finish(session: Session, participant_id: int, now: datetime) -> str:
    """Mark a session as finished and return its completion code; safe to repeat."""
    participant = lock_participant(session, participant_id)
    if seats_ahead(participant):
        raise Refused("bad_request")
    if participant.completion_code is None:
        participant.completion_code = (
            study_config(participant.version).completion.code or new_code()
        )
        participant.state, participant.finished_at = "finished", now
    return participant.completion_code


def withdraw(session: Session, participant_id: int, now: datetime) -> None:
    """Delete a participant with all answers; only a count remains. Refused once the study is closed."""
    participant = lock_participant(session, participant_id)
    version = participant.version
    if version.state == "closed":
        raise Refused("closed")
    erase_participant(session, participant)
    session.execute(
        update(StudyVersion)
        .where(StudyVersion.id == version.id)
        .values(withdrawn=StudyVersion.withdrawn + 1)
    )
    session.add(AuditEntry(version_id=version.id, at=now, action="withdraw", detail={}))


def erase_participant(session: Session, participant: Participant) -> None:
    """Remove a participant's rows and take the trials out of the counters."""
    for trial in participant.trials:
        count(session, trial, participant.mode, counted=False)
    session.flush()
    trials = select(Trial.id).where(Trial.participant_id == participant.id)
    session.execute(delete(ViewingEvent).where(ViewingEvent.trial_id.in_(trials)))
    session.execute(delete(Response).where(Response.trial_id.in_(trials)))
    session.execute(delete(Trial).where(Trial.participant_id == participant.id))
    session.execute(delete(Participant).where(Participant.id == participant.id))
    session.expire_all()

"""Forgetting: a participant with all answers, or the link from answers to platform identities."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from renderer.files import InputError
from study_app.models import AuditEntry, Participant, StudyVersion
from study_app.services import erase_participant
from study_app.studies import find_study, installation_secret
from study_app.tokens import keyed_hash


def forget(
    session: Session,
    study_id: str,
    now: datetime,
    participant: str | None = None,
    platform_id: str | None = None,
) -> dict[str, Any]:
    """Delete one participant by code or platform identity; with neither, cut all platform links.

    Leaves an audit row with counts only. Raises `InputError` if nobody is meant.
    """
    version = find_study(session, study_id)
    if participant is None and platform_id is None:
        identities = _cut_links(session, version)
        _note(session, version, now, "forget identities", {"identities": identities})
        return {"study_id": study_id, "participants": 0, "identities": identities}
    people = _meant(session, version, participant, platform_id)
    for person in people:
        erase_participant(session, person)
    session.execute(
        update(StudyVersion)
        .where(StudyVersion.id == version.id)
        .values(withdrawn=StudyVersion.withdrawn + len(people))
    )
    _note(session, version, now, "forget", {"participants": len(people)})
    return {"study_id": study_id, "participants": len(people), "identities": 0}


def _meant(
    session: Session, version: StudyVersion, participant: str | None, platform_id: str | None
) -> list[Participant]:
    versions = select(StudyVersion.id).where(StudyVersion.study_id == version.study_id)
    query = select(Participant).where(Participant.version_id.in_(versions))
    if participant is not None:
        query = query.where(Participant.code == participant)
    else:
        key = installation_secret(session, "platform")
        digest = keyed_hash(key, version.study_id, platform_id or "")
        query = query.where(Participant.platform_hash == digest)
    people = list(session.scalars(query))
    if not people:
        raise InputError(
            "study", version.study_id, participant or "platform id", "a known participant"
        )
    return people


def _cut_links(session: Session, version: StudyVersion) -> int:
    """Drop the keyed hashes of this study: nobody can be recognised by a platform identity any more."""
    versions = select(StudyVersion.id).where(StudyVersion.study_id == version.study_id)
    linked = session.scalars(
        select(Participant.id).where(
            Participant.version_id.in_(versions), Participant.platform_hash.is_not(None)
        )
    ).all()
    session.execute(
        update(Participant).where(Participant.id.in_(linked)).values(platform_hash=None)
    )
    return len(linked)


def _note(
    session: Session, version: StudyVersion, now: datetime, action: str, detail: dict[str, int]
) -> None:
    session.add(AuditEntry(version_id=version.id, at=now, action=action, detail=detail))

"""Which page comes next for a participant: one function, so that reload, back button and a second
device all lead to the same place."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import select
from sqlalchemy.orm import Session

from study_app.models import Participant, Trial
from study_app.studies import study_config


@dataclass(frozen=True)
class Progress:
    """How far a session is; `done` and `total` leave practice out."""

    page: str
    done: int
    total: int
    practice_done: int
    practice_total: int


def progress_of(participant: Participant) -> Progress:
    """The page that is due, and the counts for the progress line."""
    real = [trial for trial in participant.trials if trial.kind != "practice"]
    practice = [trial for trial in participant.trials if trial.kind == "practice"]
    done, practised = _done(real), _done(practice)
    page = _step_due(participant) or (
        "trial" if done + practised < len(real + practice) else "done"
    )
    return Progress(page, done, len(real), practised, len(practice))


def _done(trials: list[Trial]) -> int:
    return sum(trial.state in ("answered", "void") for trial in trials)


def due_page(session: Session, participant: Participant) -> str:
    """The page that is due, without loading the session's trials."""
    ahead = select(Trial.id).where(
        Trial.participant_id == participant.id, Trial.state.not_in(("answered", "void"))
    )
    due = _step_due(participant)
    return due or ("trial" if session.scalar(ahead.limit(1)) is not None else "done")


def _step_due(participant: Participant) -> str | None:
    checks = study_config(participant.version).checks
    before = [
        ("instructions", True),
        ("demographics", checks.demographics),
        ("comprehension", checks.comprehension),
    ]
    for name, wanted in before:
        if wanted and name not in participant.steps:
            return name
    return None

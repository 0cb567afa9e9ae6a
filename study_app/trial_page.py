"""What the trial page shows, and how answers and reports from it are read.

Nothing here names a method, a clip or a file: clips go out under tokens made for this trial alone.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from sqlalchemy.orm import Session

from study_app import services
from study_app.allocation import seats_ahead
from study_app.config import StudyConfig
from study_app.models import ClipRow, Participant
from study_app.progress import Progress, progress_of
from study_app.services import Answer, Refused
from study_app.studies import study_config

WIDE_CLIP = 2.6
"""Clips wider than this (width over height) gain from stacking; see the layout table in the docs."""
MAX_MS = 24 * 3600 * 1000
Body = TypeVar("Body", bound=BaseModel)


def trial_view(
    session: Session, participant_id: int, now: datetime, lease: timedelta, window: int
) -> dict[str, Any] | None:
    """All that the template needs for the present trial; None when none is left."""
    trial = services.show_trial(session, participant_id, now, lease)
    if trial is None:
        return None
    person = trial.participant
    config, progress = study_config(person.version), progress_of(person)
    return {
        "config": config,
        "trial_token": trial.token,
        "answer_id": str(uuid.uuid4()),
        "kind": "practice" if trial.kind == "practice" else "main",
        "clips": {"first": _clip(trial.first_token, trial.first_clip),
                  "second": _clip(trial.second_token, trial.second_clip)},
        "layout": page_layout(config, trial.first_clip),
        "progress": progress,
        "number": (progress.practice_done if trial.kind == "practice" else progress.done) + 1,
        "total": progress.practice_total if trial.kind == "practice" else progress.total,
        "preload": _preload(person, window),
        "pause": _pause(config, person, progress),
        "hint": person.steps.get(f"practice-{trial.ordinal - 1}", {}).get("feedback"),
    }  # fmt: skip


def page_layout(config: StudyConfig, clip: ClipRow) -> str:
    """Stack strips, put grids side by side, unless the study fixes the layout (paper: stacked)."""
    if config.layout != "auto":
        return config.layout
    return "stacked" if clip.width / clip.height > WIDE_CLIP else "side_by_side"


def _clip(token: str | None, clip: ClipRow) -> dict[str, Any]:
    return {
        "token": token,
        "duration_s": clip.duration_s,
        "width": clip.width,
        "height": clip.height,
    }


def _preload(person: Participant, window: int) -> list[str]:
    ahead = [trial for trial in seats_ahead(person)[1:window] if trial.pair_id is not None]
    return [token for trial in ahead for token in (trial.first_token, trial.second_token) if token]


def _pause(config: StudyConfig, person: Participant, progress: Progress) -> str | None:
    """Name of the break that is due before this trial."""
    every, done = config.checks.break_every, progress.done
    name = f"break-{done}"
    due = every and done and done % every == 0 and done < progress.total
    return name if due and name not in person.steps else None


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)  # no database keeps NaN as JSON


class AnswerBody(_Strict):
    """The answer as the page's script sends it."""

    answer_id: uuid.UUID
    chosen: Literal["first", "second"]
    response_time_ms: int = Field(ge=0, le=MAX_MS)
    decision_time_ms: int = Field(ge=0, le=MAX_MS)
    plays_first: int = Field(ge=0, le=10_000)
    plays_second: int = Field(ge=0, le=10_000)
    layout: Literal["stacked", "side_by_side"]
    screen: dict[str, int | float | bool | None] = Field(default_factory=dict, max_length=30)

    def answer(self) -> Answer:
        """In the form of the services."""
        return Answer(
            answer_uuid=str(self.answer_id),
            chosen_position=self.chosen,
            response_time_ms=self.response_time_ms,
            decision_time_ms=self.decision_time_ms,
            plays_first=self.plays_first,
            plays_second=self.plays_second,
            layout=self.layout,
            screen=self.screen,
        )


class EventBody(_Strict):
    """One report of the page."""

    uuid: uuid.UUID
    kind: Literal[
        "painted", "ready", "play", "complete", "hidden", "visible", "stall", "error", "alive"
    ]
    position: Literal["first", "second"] | None = None
    detail: dict[str, int | float | bool | str | None] = Field(default_factory=dict, max_length=20)


class EventsBody(_Strict):
    """A batch of reports."""

    events: list[EventBody] = Field(min_length=1, max_length=100)


@dataclass(frozen=True)
class PlainAnswer:
    """An answer of the plain form."""

    trial_token: str
    answer: Answer


def answer_form(form: Mapping[str, str]) -> PlainAnswer:
    """Read the plain form. Raises `Refused` on anything that the page cannot have sent."""
    try:
        answer_uuid = str(uuid.UUID(form.get("answer_id", "")))
    except ValueError:
        raise Refused("bad_request") from None
    chosen = form.get("choice", "")
    if chosen not in ("first", "second"):
        raise Refused("bad_request")
    return PlainAnswer(form.get("trial", ""), Answer(answer_uuid, chosen, scripted=False))


def parse_body(model: type[Body], raw: bytes) -> Body:
    """Read a JSON body. Raises `Refused`: forged, truncated, huge or non-UTF-8 bodies end here."""
    try:
        return model.model_validate_json(raw)
    except ValidationError:
        raise Refused("bad_request") from None

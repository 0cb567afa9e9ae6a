"""The JSON calls of the trial page, and the door for simulated participants. All are safe to repeat."""

from __future__ import annotations

from flask import Blueprint, jsonify, request, session, url_for
from flask.typing import ResponseReturnValue
from pydantic import BaseModel, ConfigDict, Field

from study_app import services
from study_app.context import forget, installation, recall, remember
from study_app.models import Participant, StudyVersion, Trial
from study_app.services import Refused
from study_app.tokens import group_name
from study_app.trial_page import AnswerBody, EventsBody, parse_body

api = Blueprint("trials", __name__)


@api.post("/s/<study_id>/api/trials/<trial_token>/events")
def events(study_id: str, trial_token: str) -> ResponseReturnValue:
    """Reports about playing; each is stored once under its own UUID."""
    body = parse_body(EventsBody, request.get_data())
    records = [event.model_dump(mode="json") for event in body.events]
    here, person_id = installation(), _person_id(study_id)
    fresh = here.database.retry(
        lambda db: services.record_events(
            db, person_id, trial_token, records, here.now(), here.lease
        )
    )
    return jsonify(stored=fresh)


@api.post("/s/<study_id>/api/trials/<trial_token>/answer")
def answer(study_id: str, trial_token: str) -> ResponseReturnValue:
    """Store the answer, or tell which one is stored already."""
    body = parse_body(AnswerBody, request.get_data())
    here, person_id = installation(), _person_id(study_id)
    stored = here.database.retry(
        lambda db: services.record_answer(
            db, person_id, trial_token, body.answer(), here.now(), here.lease
        )
    )
    return jsonify(
        chosen=stored.chosen_position,
        answer_id=stored.answer_uuid,
        next=url_for("participant.session_page", study_id=study_id),
    )


@api.post("/s/<study_id>/api/trials/<trial_token>/skip")
def skip(study_id: str, trial_token: str) -> ResponseReturnValue:
    """Leave out a pair whose clip would not play."""
    here, person_id = installation(), _person_id(study_id)
    here.database.retry(
        lambda db: services.skip_trial(db, person_id, trial_token, here.now(), here.lease)
    )
    return jsonify(next=url_for("participant.session_page", study_id=study_id))


@api.get("/s/<study_id>/api/trials/<trial_token>/groups")
def groups(study_id: str, trial_token: str) -> ResponseReturnValue:
    """For simulated participants alone: opaque group of each clip, and the sound one of a catch pair.

    A simulated participant sees no pixels; this is its eye. To everybody else the page does not exist.
    """
    with installation().database.read() as db:
        person = db.get_one(Participant, _person_id(study_id))
        if person.mode != "simulated":
            raise Refused("not_found")
        trial = next((one for one in person.trials if one.token == trial_token), None)
        if trial is None:
            raise Refused("bad_request")
        return jsonify(_groups(person, trial, _ticket_hash(study_id)))


def _groups(person: Participant, trial: Trial, ticket_hash: str) -> dict[str, str | None]:
    assert trial.pair is not None
    key = person.version.group_key
    methods = (trial.first_clip.method, trial.second_clip.method)
    expected = trial.pair.expected_method
    sound = None if expected is None else ("first" if methods[0] == expected else "second")
    first, second = (group_name(key, ticket_hash, method) for method in methods)
    return {"first": first, "second": second, "sound": sound}


def _ticket_hash(study_id: str) -> str:
    with installation().database.read() as db:
        return services.find_ticket(db, recall(study_id, "ticket") or "").token_hash


class TicketBody(BaseModel):
    """A ticket shown at the door."""

    model_config = ConfigDict(extra="forbid")
    ticket: str = Field(min_length=10, max_length=100)


@api.post("/api/simulation")
def simulation() -> ResponseReturnValue:
    """Exchange a ticket for a fresh visit. No CSRF token: the ticket itself is the permission."""
    body = parse_body(TicketBody, request.get_data())
    with installation().database.read() as db:
        ticket = services.find_ticket(db, body.ticket)
        if ticket.mode != "simulated":
            raise Refused("not_found")
        person = db.get(StudyVersion, ticket.version_id)
        assert person is not None
        study_id = person.study_id
    forget(study_id)
    remember(study_id, "ticket", body.ticket)
    session["simulated"] = True
    return jsonify(start=url_for("participant.landing", study_id=study_id))


def _person_id(study_id: str) -> int:
    token = recall(study_id, "token")
    if token is None:
        raise Refused("bad_request")
    with installation().database.read() as db:
        return services.find_participant(db, token, study_id).id

"""The pages that a participant walks through; thin views over `services.py`."""

from __future__ import annotations

import re
import time
from typing import Any

from flask import (
    Blueprint,
    flash,
    make_response,
    redirect,
    render_template,
    request,
    session,
    url_for,
)
from flask.typing import ResponseReturnValue
from sqlalchemy.orm import Session

from renderer.files import InputError, value_sha256
from study_app import services
from study_app.config import StudyConfig
from study_app.context import forget, installation, recall, remember
from study_app.models import Participant, StudyVersion
from study_app.progress import due_page, progress_of
from study_app.services import Refused
from study_app.studies import find_study, study_config
from study_app.texts import study_texts
from study_app.tokens import keyed_hash
from study_app.trial_page import answer_form, trial_view

pages = Blueprint("participant", __name__)
PLATFORM_PARAMETERS = ("PROLIFIC_PID", "workerId", "SONA_ID", "participant")
SECONDS_PER_TRIAL = 25


@pages.get("/healthz")
def health() -> ResponseReturnValue:
    """Says that the server and its database answer."""
    with installation().database.read() as db:
        db.connection()
    return {"status": "ok"}


@pages.get("/")
def home() -> ResponseReturnValue:
    """Participants come by a study's link; without one there is nothing to see."""
    raise Refused("not_found")


@pages.get("/s/<study_id>")
def landing(study_id: str) -> ResponseReturnValue:
    """Entry from a link: take identities out of the address, then go where the session stands."""
    arrived_by = _take_identity(study_id) or _take_ticket(study_id)
    if arrived_by:
        return redirect(url_for(".landing", study_id=study_id), 303)
    token = recall(study_id, "token")
    if token is not None:
        try:
            with installation().database.read() as db:
                services.find_participant(db, token, study_id)
            return redirect(url_for(".session_page", study_id=study_id), 303)
        except Refused:
            forget(study_id)
    return _consent_page(study_id)


def _take_identity(study_id: str) -> bool:
    """A recruiting platform's identity leaves the address at once and is kept as a keyed hash only."""
    for name in PLATFORM_PARAMETERS:
        value = request.args.get(name)
        if value:
            digest = keyed_hash(installation().platform_key, study_id, value[:200])
            if recall(study_id, "platform") != digest:
                forget(study_id)
            remember(study_id, "platform", digest)
            return True
    return False


def _take_ticket(study_id: str) -> bool:
    ticket = request.args.get("ticket")
    if not ticket:
        return False
    forget(study_id)
    remember(study_id, "ticket", ticket[:100])
    return True


def _consent_page(study_id: str) -> ResponseReturnValue:
    with installation().database.read() as db:
        version = _version(db, study_id)
        mode, _ = _arrival_mode(db, version)
        if version.state == "closed":
            raise Refused("closed")
        if version.state == "draft" and mode not in ("simulated", "preview"):
            raise Refused("unopened")
        config = study_config(version)
        return render_template("consent.html", **_frame(config), n=_numbers(version, config))


@pages.post("/s/<study_id>/consent")
def consent(study_id: str) -> ResponseReturnValue:
    """Agreeing enrols; agreeing twice (double click, second tab) leads to the same session."""
    here = installation()
    token = recall(study_id, "token")
    if token is not None:
        return redirect(url_for(".session_page", study_id=study_id), 303)
    with here.database.read() as db:
        version = _version(db, study_id)
        mode, ticket_id = _arrival_mode(db, version)
        texts = study_texts(study_config(version).texts)
        arrival = services.Arrival(
            mode=mode,
            consent_sha256=value_sha256([texts["consent_version"], texts["consent_body"]]),
            browser=coarse_browser(request.headers.get("User-Agent", "")),
            platform_hash=recall(study_id, "platform"),
            ticket_id=ticket_id,
        )
        version_id = version.id
    _, token = here.database.retry(lambda db: services.enrol(db, version_id, arrival, here.now()))
    remember(study_id, "token", token)
    session["simulated"] = mode == "simulated"
    return redirect(url_for(".session_page", study_id=study_id), 303)


@pages.get("/s/<study_id>/session")
def session_page(study_id: str) -> ResponseReturnValue:
    """The page that is due for this participant, whatever was shown before."""
    here, token = installation(), _token(study_id)
    if token is None:
        return redirect(url_for(".landing", study_id=study_id), 303)
    with here.database.read() as db:
        try:
            person = services.find_participant(db, token, study_id)
        except Refused:  # deleted meanwhile: begin anew
            forget(study_id)
            return redirect(url_for(".landing", study_id=study_id), 303)
        if person.version.state == "closed" and person.state != "finished":
            raise Refused("closed")
        page, person_id = due_page(db, person), person.id
    if page in ("trial", "done"):
        show = _trial_page if page == "trial" else _done_page
        return show(study_id, person_id)
    with here.database.read() as db:
        return _step_page(services.find_participant(db, token, study_id), page)


def _step_page(person: Participant, page: str) -> str:
    config = study_config(person.version)
    return render_template(
        f"{page}.html",
        **_frame(config),
        n=_numbers(person.version, config),
        progress=progress_of(person),
        checks=config.checks,
        resume_token=recall(config.study_id, "token"),
    )


def _trial_page(study_id: str, person_id: int) -> ResponseReturnValue:
    here = installation()
    began = time.perf_counter()
    services.bind_window(here.database, person_id, here.now(), here.settings.window, here.lease)
    bound_ms = 1000 * (time.perf_counter() - began)
    view = here.database.retry(
        lambda db: trial_view(db, person_id, here.now(), here.lease, here.settings.window)
    )
    if view is None:  # the last trials were given up meanwhile
        return redirect(url_for(".session_page", study_id=study_id), 303)
    config = view.pop("config")
    page = make_response(render_template("trial.html", **_frame(config), **view))
    page.headers["Server-Timing"] = f"allocate;dur={bound_ms:.1f}"
    return page


def _done_page(study_id: str, person_id: int) -> ResponseReturnValue:
    here = installation()
    code = here.database.retry(lambda db: services.finish(db, person_id, here.now()))
    with here.database.read() as db:
        person = db.get_one(Participant, person_id)
        config = study_config(person.version)
        return render_template(
            "done.html",
            **_frame(config),
            code=code,
            checks=config.checks,
            commented="comments" in person.steps,
            url=config.completion.url,
            closed=person.version.state == "closed",
        )


@pages.post("/s/<study_id>/trial")
def answer(study_id: str) -> ResponseReturnValue:
    """The answer of a browser without scripts; the page's script uses the JSON call instead."""
    here, person_id = installation(), _person_id(study_id)
    form = answer_form(request.form)
    here.database.retry(
        lambda db: services.record_answer(
            db, person_id, form.trial_token, form.answer, here.now(), here.lease
        )
    )
    return redirect(url_for(".session_page", study_id=study_id), 303)


@pages.post("/s/<study_id>/step/<name>")
def step(study_id: str, name: str) -> ResponseReturnValue:
    """A page beside the trials is done: instructions, questions, comments, a break."""
    here, person_id = installation(), _person_id(study_id)
    with here.database.read() as db:
        person = services.find_participant(db, _token(study_id) or "", study_id)
        if person.version.state == "closed":
            raise Refused("closed")
        config = study_config(person.version)
    detail = _step_detail(name, config)
    if detail is not None:
        here.database.retry(
            lambda db: services.record_step(db, person_id, name, detail, here.now())
        )
    return redirect(url_for(".session_page", study_id=study_id), 303)


def _step_detail(name: str, config: StudyConfig) -> dict[str, Any] | None:
    """What to keep of a step's form; None = not passed, show the page again."""
    if name == "instructions":
        sizes = {key: _small_number(request.form.get(key)) for key in ("width", "height", "kbit")}
        return {key: value for key, value in sizes.items() if value is not None}
    if name == "comprehension":
        if request.form.get("answer") != "right":
            flash(study_texts(config.texts)["comprehension_retry"])
            return None
        return {}
    if name == "demographics":
        return {key: request.form.get(key, "")[:40] for key in ("age", "experience")}
    if name == "comments":
        return {"text": request.form.get("text", "").strip()[:2000]}
    if re.fullmatch(r"break-\d{1,4}", name):
        return {}
    raise Refused("not_found")


@pages.route("/s/<study_id>/withdraw", methods=["GET", "POST"])
def withdraw(study_id: str) -> ResponseReturnValue:
    """Ask once, then delete everything of this participant."""
    here, person_id = installation(), _person_id(study_id)
    with here.database.read() as db:
        config = study_config(db.get_one(Participant, person_id).version)
    if request.method == "GET":
        return render_template("withdraw.html", **_frame(config))
    here.database.retry(lambda db: services.withdraw(db, person_id, here.now()))
    forget(study_id)
    return render_template("withdrawn.html", **_frame(config))


@pages.get("/r/<token>")
def resume(token: str) -> ResponseReturnValue:
    """A personal link: go on where the session stands, on any device."""
    with installation().database.read() as db:
        study_id = services.find_participant(db, token).version.study_id
    forget(study_id)
    remember(study_id, "token", token)
    return redirect(url_for(".session_page", study_id=study_id), 303)


def coarse_browser(user_agent: str) -> str:
    """Family and device class, nothing that could tell one person from another."""
    families = (("Edg", "Edge"), ("Firefox", "Firefox"), ("Chrome", "Chrome"), ("Safari", "Safari"))
    family = next((name for mark, name in families if mark in user_agent), "other")
    return f"{family}, {'mobile' if 'Mobi' in user_agent else 'desktop'}"


def _version(db: Session, study_id: str) -> StudyVersion:
    try:
        return find_study(db, study_id)
    except InputError:
        raise Refused("not_found") from None


def _arrival_mode(db: Session, version: StudyVersion) -> tuple[str, int | None]:
    """Mode of whoever enrols now. Only a ticket made by the operator leads away from the open mode."""
    token = recall(version.study_id, "ticket")
    if token is None:
        return version.open_mode, None
    ticket = services.find_ticket(db, token)
    if ticket.version_id != version.id:
        raise Refused("not_found")
    return ticket.mode, ticket.id


def _token(study_id: str) -> str | None:
    return recall(study_id, "token")


def _person_id(study_id: str) -> int:
    token = _token(study_id)
    if token is None:
        raise Refused("bad_request")
    with installation().database.read() as db:
        return services.find_participant(db, token, study_id).id


def _small_number(text: str | None) -> int | None:
    return int(text) if text and text.isascii() and text.isdigit() and len(text) <= 7 else None


def _frame(config: StudyConfig) -> dict[str, Any]:
    return {"study": config, "study_id": config.study_id, "texts": study_texts(config.texts)}


def _numbers(version: StudyVersion, config: StudyConfig) -> dict[str, Any]:
    """Numbers that the texts may name."""
    extra = config.extra_trials
    trials = len(version.cells) * config.trials_per_cell
    trials += extra.catch + extra.identical + extra.repeat + extra.practice
    return {
        "trials": trials,
        "minutes": max(1, round(trials * SECONDS_PER_TRIAL / 60)),
        "question": config.question,
    }

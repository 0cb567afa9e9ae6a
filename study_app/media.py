"""Clips and posters, under tokens that work for one participant and one trial.

The response tells nothing about the file: no name, no date of the file, an entity tag made from the
token. Byte ranges are served (Safari plays nothing without them, and the cache needs them).
"""

from __future__ import annotations

import os
from pathlib import Path

from flask import Blueprint, Response, send_file, session
from sqlalchemy import or_, select
from sqlalchemy.orm import Session
from werkzeug.exceptions import Gone, NotFound

from study_app.context import installation
from study_app.models import Trial
from study_app.tokens import token_hash

clips = Blueprint("media", __name__)
PLAYABLE = ("leased", "shown", "expired")

_LINE = os.urandom(192 * 1024)
"""Something that no one can compress: 1.6 s at 1 Mbit/s."""


@clips.get("/line")
def line() -> Response:
    """Bytes for the page to time the line by."""
    return Response(_LINE, mimetype="application/octet-stream")


@clips.get("/m/<token>")
def clip(token: str) -> Response:
    """The video of one position of one trial."""
    return _send(token, "video/mp4")


@clips.get("/m/<token>/poster")
def poster(token: str) -> Response:
    """Its still picture."""
    return _send(token, "image/png")


def _send(token: str, kind: str) -> Response:
    with installation().database.read() as db:
        trial = _own_trial(db, token)
        row = trial.first_clip if trial.first_token == token else trial.second_clip
        folder = Path(trial.participant.version.catalogue_folder)
    path = folder / (row.file if kind == "video/mp4" else row.poster)
    if not path.is_file():
        raise NotFound
    mimetype = "image/jpeg" if path.suffix in (".jpg", ".jpeg") else kind
    response = send_file(path, mimetype=mimetype, conditional=True, etag=token[:16], max_age=3600)
    del response.headers["Last-Modified"]
    response.headers.pop("Content-Disposition", None)
    response.headers["Cache-Control"] = "private, max-age=3600"
    return response


def _own_trial(db: Session, token: str) -> Trial:
    """The trial of a token, if this visitor is its participant and it is not answered yet."""
    trial = db.scalar(
        select(Trial).where(or_(Trial.first_token == token, Trial.second_token == token))
    )
    if trial is None or trial.participant.token_hash not in _visitor_hashes():
        raise NotFound
    if trial.state not in PLAYABLE:
        raise Gone
    return trial


def _visitor_hashes() -> set[str]:
    visits = session.get("visits", {}).values()
    return {token_hash(visit["token"]) for visit in visits if "token" in visit}

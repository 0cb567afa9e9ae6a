"""Errors as helpful pages (or JSON for the page's script), and the headers of every response."""

from __future__ import annotations

from flask import Flask, Response, jsonify, render_template, request
from flask.typing import ResponseReturnValue
from flask_wtf.csrf import CSRFError
from sqlalchemy.exc import DataError, InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from werkzeug.exceptions import HTTPException

from study_app.services import Refused
from study_app.texts import TEXTS

_STATUS = {
    "not_found": 404,
    "bad_request": 400,
    "closed": 409,
    "unopened": 409,
    "busy": 429,
    "error": 503,
}
_REASON = {404: "not_found", 405: "bad_request", 410: "not_found", 429: "busy"}

_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        "media-src 'self'; connect-src 'self'; form-action 'self'; base-uri 'none'; "
        "frame-ancestors 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=(), interest-cohort=()",
}


def register(app: Flask) -> None:
    """Hook up the handlers."""
    app.register_error_handler(Refused, lambda error: error_page(error.reason))
    app.register_error_handler(CSRFError, lambda _: error_page("bad_request"))
    app.register_error_handler(OperationalError, _database_away)
    app.register_error_handler(InterfaceError, _database_away)
    app.register_error_handler(PoolTimeout, _database_away)
    app.register_error_handler(DataError, _impossible_value)
    app.register_error_handler(HTTPException, _http_error)
    app.register_error_handler(500, lambda _: error_page("error", 500))


def add_security_headers(response: Response) -> Response:
    """No inline script, no referrer, no framing; pages are never cached."""
    for name, value in _HEADERS.items():
        response.headers.setdefault(name, value)
    if not response.headers.get("Cache-Control"):
        response.headers["Cache-Control"] = "no-store"
    return response


def error_page(reason: str, status: int | None = None) -> ResponseReturnValue:
    """The page for `reason` (a prefix of keys in `TEXTS`), as JSON where a script asked."""
    code = status or _STATUS.get(reason, 400)
    heading, body = TEXTS[f"{reason}_heading"], TEXTS[f"{reason}_body"]
    study_id = (request.view_args or {}).get("study_id")
    if request.path.startswith("/api/") or "/api/" in request.path:
        return jsonify(error=reason, message=f"{heading}. {body}"), code
    page = render_template(
        "error.html", heading=heading, body=body, study_id=study_id, texts=TEXTS, reason=reason
    )
    return page, code


def _database_away(error: Exception) -> ResponseReturnValue:
    """Locked, full or gone: nothing was stored halfway, so trying again is safe."""
    return error_page("error", 503)


def _impossible_value(error: Exception) -> ResponseReturnValue:
    """PostgreSQL takes no zero byte in a text: such an address or form was never given out by us."""
    return error_page("not_found" if request.method == "GET" else "bad_request")


def _http_error(error: HTTPException) -> ResponseReturnValue:
    code = error.code or 500
    if code < 400:
        return error.get_response()
    return error_page(_REASON.get(code, "bad_request" if code < 500 else "error"), code)

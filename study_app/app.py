"""The application factory: everything a request passes on its way can be found from here."""

from __future__ import annotations

import secrets
from datetime import timedelta

from flask import Flask, session
from flask_limiter import Limiter
from flask_wtf.csrf import CSRFProtect
from werkzeug.middleware.proxy_fix import ProxyFix

from study_app import errors, media, participant, trials
from study_app.context import Installation
from study_app.db import Database, require_schema
from study_app.settings import Settings
from study_app.studies import installation_secret

MAX_BODY = 256 * 1024


def create_app(settings: Settings, database: Database | None = None) -> Flask:
    """The study app over one database, whose schema must be there (see `study_app.db.upgrade`)."""
    database = database or Database(settings.database_url)
    require_schema(database)
    cookie_key, platform_key = database.retry(
        lambda session: (
            installation_secret(session, "cookies"),
            installation_secret(session, "platform"),
        )
    )
    app = Flask(__name__)
    app.config.update(
        SECRET_KEY=settings.secret_key or cookie_key,
        MAX_CONTENT_LENGTH=MAX_BODY,
        MAX_FORM_MEMORY_SIZE=MAX_BODY,
        PERMANENT_SESSION_LIFETIME=timedelta(days=60),
        SESSION_COOKIE_NAME="study",
        SESSION_COOKIE_HTTPONLY=True,
        SESSION_COOKIE_SAMESITE="Lax",
        SESSION_COOKIE_SECURE=settings.secure_cookies,
        WTF_CSRF_TIME_LIMIT=None,  # a participant may rest for an hour on a page
        WTF_CSRF_SSL_STRICT=False,  # checks the Referer, which our own policy never sends
    )
    app.extensions["pace"] = Installation(database, settings, platform_key)
    if settings.trust_proxy:
        app.wsgi_app = ProxyFix(app.wsgi_app, x_for=0, x_proto=1, x_host=1)  # type: ignore[method-assign]
    csrf = CSRFProtect(app)
    csrf.exempt(trials.simulation)
    _limit_rate(app, settings)
    for blueprint in (participant.pages, trials.api, media.clips):
        app.register_blueprint(blueprint)
    errors.register(app)
    app.after_request(errors.add_security_headers)
    return app


def _limit_rate(app: Flask, settings: Settings) -> None:
    """A ceiling for one browser session; addresses are neither used nor kept (labs share one)."""

    def visitor() -> str:
        if "visitor" not in session:
            session["visitor"] = secrets.token_hex(8)
        return str(session["visitor"])

    Limiter(
        visitor,
        app=app,
        storage_uri="memory://",
        default_limits=[f"{settings.requests_per_minute} per minute"],
        default_limits_exempt_when=lambda: bool(session.get("simulated")),
    )

"""What every view needs: database, settings, clock, and who is asking."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from flask import current_app, session

from study_app.db import Database
from study_app.settings import Settings


@dataclass
class Installation:
    """One running app: its database, settings and keys."""

    database: Database
    settings: Settings
    platform_key: str

    @property
    def lease(self) -> timedelta:
        """How long a pair is held without a sign of life."""
        return timedelta(minutes=self.settings.lease_minutes)

    def now(self) -> datetime:
        """The server's clock; tests put another one here."""
        return datetime.now(UTC)


def installation() -> Installation:
    """The installation that serves this request."""
    found = current_app.extensions["pace"]
    assert isinstance(found, Installation)
    return found


def remember(study_id: str, name: str, value: str) -> None:
    """Keep a fact about this visitor of this study in the signed cookie."""
    visits: dict[str, Any] = dict(session.get("visits", {}))
    visits[study_id] = {**visits.get(study_id, {}), name: value}
    session["visits"] = visits
    session.permanent = True


def recall(study_id: str, name: str) -> str | None:
    """A fact kept by `remember`, or None."""
    value = session.get("visits", {}).get(study_id, {}).get(name)
    return value if isinstance(value, str) else None


def forget(study_id: str) -> None:
    """Drop everything about this study from the cookie."""
    visits: dict[str, Any] = dict(session.get("visits", {}))
    visits.pop(study_id, None)
    session["visits"] = visits

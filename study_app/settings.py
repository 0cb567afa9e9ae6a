"""Settings from the environment: one table with default, check and prose; nothing is read elsewhere."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from renderer.files import InputError


class Setting(NamedTuple):
    """One row of the table: environment variable, attribute, default, allowed range, prose."""

    variable: str
    attribute: str
    default: str | int | bool
    low: int
    high: int
    prose: str


SETTINGS: tuple[Setting, ...] = (
    Setting("PACE_DATABASE_URL", "database_url", "sqlite:///pace-study.sqlite", 0, 0,
            "SQLAlchemy address of the study database; sqlite or postgresql."),
    Setting("PACE_SECRET_KEY", "secret_key", "", 0, 0,
            "Signs session cookies; empty = one is made once and kept in the database."),
    Setting("PACE_BASE_URL", "base_url", "http://127.0.0.1:8000", 0, 0,
            "Public address of the server, as it stands in participant links."),
    Setting("PACE_LEASE_MINUTES", "lease_minutes", 30, 1, 24 * 60,
            "A pair is held so long for a participant who shows no sign of life."),
    Setting("PACE_WINDOW", "window", 4, 1, 20,
            "Pairs bound ahead: the present trial and those that the page preloads."),
    Setting("PACE_SECURE_COOKIES", "secure_cookies", False, 0, 0,
            "true behind https: cookies travel encrypted only."),
    Setting("PACE_TRUST_PROXY", "trust_proxy", False, 0, 0,
            "true behind one reverse proxy that sets X-Forwarded-Proto and X-Forwarded-Host."),
    Setting("PACE_WORKERS", "workers", 1, 1, 64, "Server processes."),
    Setting("PACE_THREADS", "threads", 8, 1, 128, "Threads a process."),
    Setting("PACE_REQUESTS_PER_MINUTE", "requests_per_minute", 600, 10, 100_000,
            "Limit for one session; simulated participants are exempt."),
)  # fmt: skip


@dataclass(frozen=True)
class Settings:
    """Validated settings; the fields are explained in `SETTINGS`."""

    database_url: str = "sqlite:///pace-study.sqlite"
    secret_key: str = ""
    base_url: str = "http://127.0.0.1:8000"
    lease_minutes: int = 30
    window: int = 4
    secure_cookies: bool = False
    trust_proxy: bool = False
    workers: int = 1
    threads: int = 8
    requests_per_minute: int = 600


def read_settings(environment: Mapping[str, str] | None = None, **overrides: object) -> Settings:
    """Settings from the environment, with options of the command line on top (`None` = not given).

    Raises `InputError` naming the variable and its value.
    """
    source = os.environ if environment is None else environment
    values = {
        row.attribute: _parse(row, source[row.variable])
        for row in SETTINGS
        if source.get(row.variable)
    }
    values |= {name: value for name, value in overrides.items() if value is not None}
    return Settings(**values)  # type: ignore[arg-type]  # _parse checked each against its row


def _parse(row: Setting, text: str) -> object:
    if isinstance(row.default, bool):
        if text.lower() not in ("true", "false"):
            raise InputError("environment", row.variable, text, "true or false")
        return text.lower() == "true"
    if isinstance(row.default, int):
        if not text.isascii() or not text.isdigit() or not row.low <= int(text) <= row.high:
            raise InputError(
                "environment", row.variable, text, f"a whole number from {row.low} to {row.high}"
            )
        return int(text)
    return text

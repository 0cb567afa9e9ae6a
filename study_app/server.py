"""gunicorn around the app: workers of threads, no access log (it would hold addresses and tokens)."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import click
from gunicorn.app.base import BaseApplication

from study_app.app import create_app
from study_app.db import Database, upgrade
from study_app.settings import Settings


class Server(BaseApplication):  # type: ignore[misc]  # gunicorn comes without types
    """Runs the app until it is told to stop."""

    def __init__(self, settings: Settings, host: str, port: int, announce: Callable[[str], None]):
        self.pace_settings = settings
        self.bind = f"{host}:{port}"
        self.announce = announce
        super().__init__()

    def load_config(self) -> None:
        """Hand our settings to gunicorn."""
        options: dict[str, Any] = {
            "bind": self.bind,
            "workers": self.pace_settings.workers,
            "threads": self.pace_settings.threads,
            "worker_class": "gthread",
            "timeout": 60,
            "graceful_timeout": 10,
            "keepalive": 15,
            "accesslog": None,
            "loglevel": "warning",
            "control_socket_disable": True,
            "when_ready": lambda server: self.announce(_address(server)),
        }
        for name, value in options.items():
            if name in self.cfg.settings:
                self.cfg.set(name, value)

    def load(self) -> Any:
        """Each worker opens its own database connections."""
        return create_app(self.pace_settings)


def serve_forever(settings: Settings, host: str, port: int, as_json: bool) -> None:
    """Bring the schema up to date, listen, print the address once, serve until stopped."""
    database = Database(settings.database_url)
    upgrade(database)
    create_app(settings, database)  # makes the keys once, before workers could race for them
    database.close()

    def announce(address: str) -> None:
        click.echo(json.dumps({"url": address}) if as_json else f"Serving studies at {address}")

    Server(settings, host, port, announce).run()


def _address(server: Any) -> str:
    host, port = server.LISTENERS[0].sock.getsockname()[:2]
    return f"http://{'127.0.0.1' if host == '0.0.0.0' else host}:{port}"

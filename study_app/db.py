"""The database: engines for SQLite and PostgreSQL, short read and write transactions, schema upgrade.

Writers on SQLite take the lock at once (`BEGIN IMMEDIATE`): a transaction that reads first and
upgrades later fails with "database is locked" as soon as two meet. PostgreSQL locks rows instead,
see `services.py`.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import sqlalchemy
from sqlalchemy import event
from sqlalchemy.exc import ArgumentError, IntegrityError, OperationalError
from sqlalchemy.orm import Session

from renderer.files import InputError

MIGRATIONS = Path(__file__).resolve().parents[1] / "migrations"
_BUSY_MS = 10_000
_ATTEMPTS = 5
_PATIENCE_S = 10.0
T = TypeVar("T")


class Database:
    """One database and its two kinds of transactions."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.engine = _engine(url)

    @property
    def is_sqlite(self) -> bool:
        """Row locks are neither possible nor needed on SQLite: its writers queue."""
        return self.engine.dialect.name == "sqlite"

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A read-only unit of work."""
        with Session(self.engine) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A unit of work that commits at the end, or leaves no trace."""
        engine = self.engine.execution_options(pace_write=True)
        with Session(engine, expire_on_commit=False) as session, session.begin():
            yield session

    def retry(self, work: Callable[[Session], T]) -> T:
        """Run `work` in a write transaction; repeat it when it lost a race.

        That is: the database was busy, met a deadlock, or a unique key was taken a moment ago by
        another request; the next attempt finds what that one stored. `work` must be safe to run
        again from the start: everything it did was rolled back. Whoever waited ten seconds is told;
        the page sends again by itself.
        """
        began = time.monotonic()
        for attempt in range(1, _ATTEMPTS + 1):
            try:
                with self.write() as session:
                    return work(session)
            except (OperationalError, IntegrityError):
                if attempt == _ATTEMPTS or time.monotonic() - began > _PATIENCE_S:
                    raise
                time.sleep(0.02 * 2**attempt * random.uniform(0.5, 1.5))
        raise AssertionError("unreachable")

    def close(self) -> None:
        """Give back all connections."""
        self.engine.dispose()


def upgrade(database: Database) -> None:
    """Bring the schema to the newest migration; does nothing when it is there already."""
    from alembic import command

    if database.is_sqlite and database.engine.url.database:
        Path(database.engine.url.database).parent.mkdir(parents=True, exist_ok=True)
    with database.engine.execution_options(pace_write=True).connect() as connection:
        command.upgrade(alembic_config(connection), "head")
        connection.commit()


def alembic_config(connection: sqlalchemy.Connection) -> Any:
    """Alembic's configuration over an open connection."""
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    config.attributes["connection"] = connection
    return config


def require_schema(database: Database) -> None:
    """Raise `InputError` where the database holds no studies (a mistyped address, usually)."""
    path = database.engine.url.database
    if database.is_sqlite and path and not Path(path).is_file():
        raise InputError("database", "url", _shown(database), "an existing study database")
    with database.engine.connect() as connection:
        if not sqlalchemy.inspect(connection).has_table("study_version"):
            raise InputError("database", "url", _shown(database), "a database with studies in it")


def _engine(url: str) -> sqlalchemy.Engine:
    try:
        address = sqlalchemy.make_url(url)
    except ArgumentError:
        raise InputError("database", "url", url, "an address such as sqlite:///FILE") from None
    if address.drivername == "postgresql":
        address = address.set(drivername="postgresql+psycopg")
    if address.get_backend_name() == "sqlite":
        # Parameters stay out of error texts: they hold tokens.
        engine = sqlalchemy.create_engine(
            address, connect_args={"timeout": _BUSY_MS / 1000}, hide_parameters=True
        )
        _prepare_sqlite(engine)
        return engine
    if address.drivername != "postgresql+psycopg":
        raise InputError("database", "url", address.drivername, "sqlite or postgresql")
    return sqlalchemy.create_engine(
        address, pool_size=10, max_overflow=20, pool_pre_ping=True, hide_parameters=True
    )


def _prepare_sqlite(engine: sqlalchemy.Engine) -> None:
    @event.listens_for(engine, "connect")
    def _configure(connection: Any, _record: object) -> None:
        connection.isolation_level = None  # the driver must not begin transactions behind our back
        for pragma in (
            f"busy_timeout={_BUSY_MS}",
            "journal_mode=WAL",
            "synchronous=NORMAL",
            "foreign_keys=ON",
        ):
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def _begin(connection: sqlalchemy.Connection) -> None:
        writes = connection.get_execution_options().get("pace_write")
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


def _shown(database: Database) -> str:
    return database.engine.url.render_as_string(hide_password=True)

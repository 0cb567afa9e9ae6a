"""A small stimulus set, databases of both kinds, the app with a clock wound by hand, a real server."""

from __future__ import annotations

import importlib.util
import itertools
import json
import os
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from flask import Flask
from werkzeug.test import TestResponse

from study_app.app import create_app
from study_app.config import read_study
from study_app.db import Database, upgrade
from study_app.settings import Settings
from study_app.simulate import Page, parse_page
from study_app.stimuli import plan_study
from study_app.studies import create_study, open_study

ROOT = Path(__file__).resolve().parents[2]
STUDY = """
study_id = "tiny"
title = "Human motion in rooms"
question = "In which clip does the person look more realistic?"
target = "pace"
baselines = ["paak", "posa_t"]
trials_per_cell = 1
seed = 3
"""


def _helper(name: str) -> Any:
    """A helper module beside this file (test folders are no packages)."""
    path = Path(__file__).with_name(f"{name}.py")
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def still_stimuli(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("still")
    return Path(_helper("stimulus_set").write_still_stimuli(folder))


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[Any]:
    """Gives the address of a cluster without a database name; it can be stopped and started."""
    with _helper("postgres").postgresql_cluster() as address:
        yield address


@pytest.fixture
def own_postgresql() -> Callable[[], Any]:
    """Makes a server that no other test needs meanwhile: `with own_postgresql() as cluster`."""
    return _helper("postgres").postgresql_cluster  # type: ignore[no-any-return]


_numbers = itertools.count()


def _new_postgresql(server: str) -> str:
    import psycopg

    name = f"pace_{next(_numbers)}"
    with psycopg.connect(f"{server}/postgres", autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    return f"{server}/{name}"


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """An empty database; every test that asks for it runs on both kinds."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path}/study.sqlite"
    return _new_postgresql(request.getfixturevalue("postgresql_server"))


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    """A database with the newest schema, on both kinds."""
    database = Database(database_url)
    upgrade(database)
    yield database
    database.close()


@pytest.fixture
def sqlite_url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path}/study.sqlite"


@pytest.fixture
def study_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a study file: the usual one with lines added and words replaced."""

    def write(extra: str = "", *replacements: tuple[str, str]) -> Path:
        text = STUDY
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "study.toml"
        path.write_text(text + extra, encoding="utf-8")
        return path

    return write


@pytest.fixture
def pace() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs `pace-study` as a user would, in a process of its own."""

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "pace_study", *map(str, words)]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)

    return run


@pytest.fixture
def serve() -> Iterator[Callable[[str], str]]:
    """Starts the real server over a database; gives its address when it is ready."""
    processes: list[subprocess.Popen[str]] = []

    def start(url: str, **environment: str) -> str:
        command = [sys.executable, "-m", "pace_study", "serve", "--database", url, "--port", "0"]
        process = subprocess.Popen(
            [*command, "--json"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | environment,
        )
        processes.append(process)
        assert process.stdout is not None
        return str(json.loads(process.stdout.readline())["url"])

    yield start
    for process in processes:
        process.terminate()
        process.wait(20)
        assert process.stdout is not None
        process.stdout.close()


def wait_until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "condition was not met in time"
        time.sleep(0.02)


class Clock:
    """The server's clock, wound by hand."""

    def __init__(self) -> None:
        self.time = datetime(2026, 3, 1, 12, tzinfo=UTC)

    def __call__(self) -> datetime:
        return self.time

    def forward(self, seconds: float) -> None:
        self.time += timedelta(seconds=seconds)


class Visitor:
    """A participant's browser without a screen: follows pages, sends what the page's script sends."""

    def __init__(self, app: Flask, start: str = "/s/tiny") -> None:
        self.client = app.test_client()
        self.received: list[TestResponse] = []
        self.page = self.get(start)

    def fetch(self, url: str, **headers: str) -> TestResponse:
        """One request, read to its end; redirects are not followed."""
        reply = self.client.get(url, headers=headers, buffered=True)
        self.received.append(reply)
        return reply

    def get(self, url: str) -> Page:
        return self._keep(self.client.get(url, follow_redirects=True))

    def post(self, url: str, data: dict[str, str]) -> Page:
        return self._keep(self.client.post(url, data=data, follow_redirects=True))

    def _keep(self, reply: TestResponse) -> Page:
        self.received += [*reply.history, reply]
        self.page = parse_page(reply.request.url, reply.text)
        return self.page

    @property
    def reply(self) -> TestResponse:
        return self.received[-1]

    def go_to_trial(self) -> Page:
        while self.page.main.get("data-page") != "trial" and not self.page.finished:
            assert self.page.action, self.reply.text
            self.post(self.page.action, self.page.fields)
        return self.page

    def call(self, name: str, body: dict[str, Any] | bytes, **headers: str) -> TestResponse:
        url = self.page.main["data-answer-url"].removesuffix("answer") + name
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        headers = {"X-CSRFToken": self.page.csrf} | headers
        reply = self.client.post(url, data=data, headers=headers)
        self.received.append(reply)
        return reply

    def answer(self, chosen: str = "first", **changes: Any) -> TestResponse:
        body = {
            "answer_id": str(uuid.uuid4()), "chosen": chosen, "response_time_ms": 9000,
            "decision_time_ms": 1500, "plays_first": 1, "plays_second": 2, "layout": "side_by_side",
        }  # fmt: skip
        return self.call("answer", body | changes)

    def answer_all(self) -> Page:
        while "data-answer-url" in self.go_to_trial().main:
            assert self.answer().status_code == 200
            self.get("/s/tiny/session")
        return self.page


@dataclass
class Site:
    """The app over one study, with its clock and a way to let visitors in."""

    app: Flask
    database: Database
    clock: Clock
    stimuli: Path

    def visitor(self, start: str = "/s/tiny") -> Visitor:
        return Visitor(self.app, start)

    def do(self, work: Callable[..., Any], *words: Any) -> Any:
        """Operator's work: `work(session, *words)`."""
        return self.database.retry(lambda session: work(session, *words))


@pytest.fixture
def new_site(study_file: Callable[..., Path], still_stimuli: Path) -> Iterator[Callable[..., Site]]:
    """Makes an app over a fresh open study: `new_site(url, extra lines, settings...)`."""
    made: list[Database] = []

    def make(url: str, extra: str = "", *words: tuple[str, str], opened: bool = True,
             **settings: Any) -> Site:  # fmt: skip
        database, clock = Database(url), Clock()
        made.append(database)
        upgrade(database)
        path = study_file(extra, *words)
        plan = plan_study(read_study(path), still_stimuli, path)
        database.retry(lambda session: create_study(session, plan, clock()))
        if opened:
            database.retry(lambda session: open_study(session, "tiny", "live", clock()))
        app = create_app(Settings(database_url=url, **settings), database)
        app.extensions["pace"].now = clock
        return Site(app, database, clock, still_stimuli)

    yield make
    for database in made:
        database.close()


@pytest.fixture
def site(new_site: Callable[..., Site], sqlite_url: str) -> Site:
    return new_site(sqlite_url)

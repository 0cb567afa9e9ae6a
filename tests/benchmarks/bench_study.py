"""Load on the study server: 30 people on SQLite, 200 on PostgreSQL, real server, generator on the same cores.

Load model: each person has one trial per 20 s (exponential waits); a trial is one page, three posts of
reports and one answer. Video bytes are left out: a web server or a content network sends them.
PACE_BENCH_SECONDS sets the measured time of each run (default 90).
"""

from __future__ import annotations

import importlib.util
import json
import os
import platform
import random
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import requests
from sqlalchemy import func, select

from study_app.db import Database
from study_app.doctor import examine
from study_app.models import Response, Trial
from study_app.simulate import Page, parse_page
from study_app.studies import find_study

ROOT = Path(__file__).resolve().parents[2]
SECONDS = float(os.environ.get("PACE_BENCH_SECONDS", "90"))
TRIAL_S = 20.0
RAMP_S = 40.0
"""People arrive over this time, before anything is measured."""
STUDY = """
study_id = "load"
title = "Load"
question = "Which?"
target = "pace"
baselines = ["paak", "posa_t", "synthesis"]
trials_per_cell = 5
"""


def helper(name: str) -> Any:
    """A helper module of the study app's tests."""
    path = ROOT / "tests" / "study_app" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pace(*words: object) -> str:
    """Run a command and return what it prints."""
    command = [sys.executable, "-m", "pace_study", *map(str, words)]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


class Person(threading.Thread):
    """One participant on the loopback line."""

    def __init__(self, url: str, number: int, until: float) -> None:
        super().__init__(daemon=True)
        self.url, self.until, self.rng = url, until, random.Random(number)
        self.since = until - SECONDS
        self.browser = requests.Session()
        self.browser.trust_env = False
        self.times: dict[str, list[float]] = {"page": [], "event": [], "answer": [], "bind": []}
        self.acknowledged: list[str] = []
        self.faults: Counter[str] = Counter()

    def run(self) -> None:
        """Enter, then answer until the time is over."""
        try:
            time.sleep(self.rng.uniform(0, RAMP_S))
            page = self.enter()
            while time.time() < self.until and page.main.get("data-page") == "trial":
                page = self.trial(page)
        except Exception as error:
            self.faults[repr(error)[:120]] += 1

    def enter(self) -> Page:
        page = self.read(self.browser.get(f"{self.url}/s/load", timeout=30))
        while page.main.get("data-page") != "trial":
            page = self.read(self.browser.post(page.action or "", data=page.fields, timeout=30))
        return page

    def read(self, reply: requests.Response) -> Page:
        reply.raise_for_status()
        return parse_page(reply.url, reply.text)

    def trial(self, page: Page) -> Page:
        """Reports and answer of this trial at their times, then the next page."""
        wait = self.rng.expovariate(1 / TRIAL_S)
        for kind in ("painted", "play", "complete"):
            time.sleep(wait / 4)
            event = {"uuid": str(uuid.uuid4()), "kind": kind, "position": None, "detail": {}}
            self.call("event", page, "events", {"events": [event]})
        time.sleep(wait / 4)
        body = {
            "answer_id": str(uuid.uuid4()), "chosen": "first", "response_time_ms": 9000,
            "decision_time_ms": 1000, "plays_first": 1, "plays_second": 1, "layout": "stacked",
        }  # fmt: skip
        self.acknowledged.append(self.call("answer", page, "answer", body)["answer_id"])
        began = time.perf_counter()
        reply = self.browser.get(f"{self.url}/s/load/session", timeout=30)
        self.note("page", began)
        timing = reply.headers.get("Server-Timing", "")
        if timing and time.time() > self.since:
            self.times["bind"].append(float(timing.rpartition("=")[2]))
        return self.read(reply)

    def call(self, name: str, page: Page, what: str, body: dict[str, Any]) -> Any:
        url = self.url + page.main["data-answer-url"].removesuffix("answer") + what
        began = time.perf_counter()
        reply = self.browser.post(url, json=body, headers={"X-CSRFToken": page.csrf}, timeout=30)
        self.note(name, began)
        reply.raise_for_status()
        return reply.json()

    def note(self, name: str, began: float) -> None:
        """Keep a duration, once everybody has arrived."""
        if time.time() > self.since:
            self.times[name].append(1000 * (time.perf_counter() - began))


def measure(
    database_url: str, stimuli: Path, folder: Path, people: int, workers: int
) -> dict[str, Any]:
    """One run against the real server; times in milliseconds of wall time."""
    (folder / "study.toml").write_text(STUDY)
    where = ("--database", database_url)
    pace("study", "create", folder / "study.toml", "--catalogue", stimuli, *where)
    pace("study", "open", "load", *where)
    words = [
        "-m",
        "pace_study",
        "serve",
        "--port",
        "0",
        "--workers",
        str(workers),
        "--json",
        *where,
    ]
    server = subprocess.Popen([sys.executable, *words], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    try:
        url = json.loads(server.stdout.readline())["url"]
        until = time.time() + RAMP_S + 5 + SECONDS
        crowd = [Person(url, number, until) for number in range(people)]
        for person in crowd:
            person.start()
        for person in crowd:
            person.join(max(0.0, until + 60 - time.time()))
        return figures(crowd, database_url)
    finally:
        server.terminate()
        server.wait(20)


def figures(crowd: list[Person], database_url: str) -> dict[str, Any]:
    """Percentiles, and what the database holds against what people were told."""
    times = {name: [t for p in crowd for t in p.times[name]] for name in crowd[0].times}
    told = [answer for person in crowd for answer in person.acknowledged]
    database = Database(database_url)
    with database.read() as session:
        stored = set(session.scalars(select(Response.answer_uuid)))
        per_trial = session.scalars(
            select(func.count(Response.id)).join(Trial).group_by(Response.trial_id)
        ).all()
    now = max(find_now(database))
    findings = database.retry(lambda session: examine(session, "load", now))["findings"]
    database.close()
    return {
        "participants": len(crowd),
        "answers": len(told),
        "lost": len(set(told) - stored) + len(findings),
        "doubled": sum(count > 1 for count in per_trial),
        "faults": sum((person.faults for person in crowd), Counter()),
        **{f"{name}_p50_ms": percentile(values, 50) for name, values in times.items()},
        **{f"{name}_p95_ms": percentile(values, 95) for name, values in times.items()},
    }


def find_now(database: Database) -> list[Any]:
    """The moment of the last answer: leases of people still under way stay alive."""
    with database.read() as session:
        created = find_study(session, "load").created_at
        return [created, *session.scalars(select(Response.answered_at))]


def percentile(values: list[float], share: int) -> float:
    """A percentile by linear interpolation."""
    if len(values) < 2:
        return float("nan")
    return round(statistics.quantiles(values, n=100, method="inclusive")[share - 1], 1)


def main() -> None:
    """Print both runs and one JSON line."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        (folder / "m.mp4").write_bytes(bytes(2048))
        stimuli = helper("stimulus_set").write_stimuli(
            folder / "set", [folder / "m.mp4"], ("s1", "s2", "s3", "s4"),
            tuple(f"m{n:03d}" for n in range(100)), ("pace", "paak", "posa_t", "synthesis"),
        )  # fmt: skip
        server = stack.enter_context(helper("postgres").postgresql_cluster())
        runs = {
            "sqlite": measure(f"sqlite:///{folder}/load.sqlite", stimuli, folder, 30, 1),
            "postgresql": measure(f"{server}/postgres", stimuli, folder, 200, 2),
        }
    keys = [key for key in runs["sqlite"] if key != "faults"]
    print(f"{'':20s}{'sqlite':>12s}{'postgresql':>12s}   {platform.processor() or platform.machine()}, "
          f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, {SECONDS:g} s each")  # fmt: skip
    for key in keys:
        print(f"{key:20s}{runs['sqlite'][key]:>12}{runs['postgresql'][key]:>12}")
    for name, run in runs.items():
        for fault, count in run["faults"].items():
            print(f"fault ({name}): {fault} x {count}")
    print(json.dumps(summary(runs)))


def summary(runs: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The line for scripts."""
    return {
        "area": "study",
        "allocate_p95_ms_sqlite": runs["sqlite"]["bind_p95_ms"],
        "allocate_p95_ms_postgresql": runs["postgresql"]["bind_p95_ms"],
        "page_p95_ms": max(run["page_p95_ms"] for run in runs.values()),
        "participants": sum(run["participants"] for run in runs.values()),
        "answers": sum(run["answers"] for run in runs.values()),
        "lost": sum(run["lost"] for run in runs.values()),
        "doubled": sum(run["doubled"] for run in runs.values()),
    }


if __name__ == "__main__":
    main()

"""Simulated participants over HTTP: they walk the pages as people do and answer by a drawn truth.

The truth (Bradley-Terry worths of opaque clip groups, side bias, lapse rate) comes from the seed
alone. The server never tells a method's name; who holds the database may name the groups afterwards.
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from html.parser import HTMLParser
from random import Random
from typing import Any
from urllib.parse import urljoin

import requests

from renderer.files import InputError

WORTH_SD = 0.8
"""Standard deviation of the log worths: typical preference rates between 30 and 70 %."""
PERSON_SD = 0.3
TIMEOUT_S = 30


@dataclass
class Truth:
    """What simulated participants believe. Worths are drawn as groups are first met."""

    rng: Random
    side_bias: float
    """Added to the log odds of the first position."""
    lapse: float
    """Share of answers given blindly."""
    worths: dict[str, float] = field(default_factory=dict)

    def worth(self, group: str) -> float:
        """Log worth of a clip group."""
        if group not in self.worths:
            self.worths[group] = self.rng.gauss(0.0, WORTH_SD)
        return self.worths[group]


@dataclass
class Simulated:
    """One simulated participant: a browser session without a screen, and a taste of its own."""

    browser: requests.Session
    rng: Random
    tastes: dict[str, float] = field(default_factory=dict)
    page: Page | None = None
    answers: int = 0


@dataclass(frozen=True)
class Page:
    """What a page says to those who act on it."""

    url: str
    main: dict[str, str]
    action: str | None
    fields: dict[str, str]
    csrf: str
    finished: bool


def draw_truth(seed: int) -> Truth:
    """A truth from a seed: a slight side bias, a few per cent of lapses."""
    rng = Random(f"truth|{seed}")
    return Truth(rng, side_bias=rng.gauss(0.0, 0.15), lapse=rng.uniform(0.01, 0.06))


def simulate(
    url: str,
    ticket: str,
    participants: int,
    seed: int,
    progress: Callable[[int], None] = lambda _: None,
) -> dict[str, Any]:
    """Let `participants` answer a whole session each, taking turns trial by trial as crowds do.

    Returns counts and the truth by opaque group. Raises `InputError` if the server refuses.
    """
    truth = draw_truth(seed)
    people = [Simulated(_browser(), Random(f"person|{seed}|{n}")) for n in range(participants)]
    for person in people:
        person.page = _enter(person, url, ticket)
    waiting = list(people)
    while waiting:
        waiting = [person for person in waiting if not _turn(person, truth)]
        progress(sum(person.answers for person in people))
    return {
        "participants": participants,
        "finished": participants,
        "answers": sum(person.answers for person in people),
        "truth": {
            "seed": seed,
            "side_bias": truth.side_bias,
            "lapse": truth.lapse,
            "person_sd": PERSON_SD,
            "groups": dict(sorted(truth.worths.items())),
        },
    }


def preference(worth: float, other: float) -> float:
    """Bradley-Terry: probability that the first is preferred, without side bias and lapse."""
    return 1.0 / (1.0 + math.exp(other - worth))


def _browser() -> requests.Session:
    session = requests.Session()
    session.trust_env = False  # a proxy of the surroundings has no part in a local study
    session.headers["User-Agent"] = "pace-study simulate"
    return session


def _enter(person: Simulated, url: str, ticket: str) -> Page:
    reply = _call(person, "POST", urljoin(url, "/api/simulation"), json={"ticket": ticket})
    return _read(_call(person, "GET", urljoin(url, reply.json()["start"])))


def _turn(person: Simulated, truth: Truth) -> bool:
    """One page further; True when the completion code is there."""
    page = person.page
    assert page is not None
    if page.finished:
        return True
    if page.main.get("data-page") == "trial":
        person.page = _answer(person, page, truth)
    elif page.action:
        person.page = _read(_call(person, "POST", page.action, data=page.fields))
    else:
        raise InputError(page.url, "page", "neither form nor trial", "a page of a running study")
    return False


def _answer(person: Simulated, page: Page, truth: Truth) -> Page:
    answer_url = urljoin(page.url, page.main["data-answer-url"])
    seen = _call(person, "GET", answer_url.removesuffix("/answer") + "/groups").json()
    decision_ms = round(1000 * person.rng.lognormvariate(1.2, 0.5))
    body = {
        "answer_id": str(uuid.UUID(int=person.rng.getrandbits(128), version=4)),
        "chosen": _choose(person, truth, seen),
        "response_time_ms": decision_ms + 8000,
        "decision_time_ms": decision_ms,
        "plays_first": 1 + (person.rng.random() < 0.3),
        "plays_second": 1 + (person.rng.random() < 0.3),
        "layout": page.main["data-layout"],
    }
    reply = _call(person, "POST", answer_url, json=body, headers={"X-CSRFToken": page.csrf})
    person.answers += 1
    return _read(_call(person, "GET", urljoin(page.url, reply.json()["next"])))


def _choose(person: Simulated, truth: Truth, seen: dict[str, Any]) -> str:
    """By worth, personal taste and side; a lapse is a coin; a lifted body is noticed otherwise."""
    if person.rng.random() < truth.lapse:
        return person.rng.choice(("first", "second"))
    if seen["sound"]:
        return str(seen["sound"])
    lead = truth.side_bias
    if seen["first"] != seen["second"]:
        lead += _liking(person, truth, seen["first"]) - _liking(person, truth, seen["second"])
    return "first" if person.rng.random() < 1 / (1 + math.exp(-lead)) else "second"


def _liking(person: Simulated, truth: Truth, group: str) -> float:
    if group not in person.tastes:
        person.tastes[group] = person.rng.gauss(0.0, PERSON_SD)
    return truth.worth(group) + person.tastes[group]


def _call(person: Simulated, method: str, url: str, **options: Any) -> requests.Response:
    try:
        reply = person.browser.request(method, url, timeout=TIMEOUT_S, **options)
    except requests.RequestException as error:
        raise InputError(url, "server", type(error).__name__, "a running study server") from None
    if not reply.ok:
        raise InputError(url, "answer of the server", reply.status_code, "status 200")
    return reply


def _read(reply: requests.Response) -> Page:
    return parse_page(reply.url, reply.text)


def parse_page(url: str, text: str) -> Page:
    """What a page offers: its first form with hidden fields, the data of <main>, the CSRF token."""
    reader = _PageReader()
    reader.feed(text)
    fields = dict(reader.fields)
    for name, values in reader.radios.items():
        fields[name] = "right" if "right" in values else values[0]
    action = urljoin(url, reader.action) if reader.action else None
    return Page(url, reader.main, action, fields, reader.csrf, reader.finished)


class _PageReader(HTMLParser):
    """Collects the first form, the data of <main>, and whether the completion code is shown."""

    def __init__(self) -> None:
        super().__init__()
        self.main: dict[str, str] = {}
        self.fields: dict[str, str] = {}
        self.radios: dict[str, list[str]] = {}
        self.action: str | None = None
        self.csrf = ""
        self.finished = False
        self._in_form = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Called by the parser for every opening tag."""
        values = {name: value or "" for name, value in attrs}
        if tag == "main":
            self.main = values
        if tag == "meta" and values.get("name") == "csrf-token":
            self.csrf = values["content"]
        if tag == "form" and self.action is None:
            self.action, self._in_form = values.get("action", ""), True
        if tag == "input" and self._in_form:
            self._input(values)
        self.finished |= values.get("data-testid") == "completion-code"

    def handle_endtag(self, tag: str) -> None:
        """Called by the parser for every closing tag."""
        if tag == "form":
            self._in_form = False

    def _input(self, values: dict[str, str]) -> None:
        if values.get("type") == "radio":
            self.radios.setdefault(values["name"], []).append(values["value"])
        elif "name" in values:
            self.fields[values["name"]] = values.get("value", "")

"""What goes wrong around a session: the database locked, full or gone; clocks; stale and broken input."""

from __future__ import annotations

import json
import sqlite3
import threading
import time
import uuid
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from sqlalchemy import event, select

from study_app.doctor import examine
from study_app.models import Response
from study_app.viewing import Report, viewing_evidence

NewSite = Callable[..., Any]
HELP = "Nothing of what you answered is lost"


def answers(site: Any) -> list[str]:
    with site.database.read() as session:
        return list(session.scalars(select(Response.answer_uuid)))


def assert_stored_once(site: Any, visitor: Any, answer_id: str) -> None:
    """The same answer sent twice more is stored once, and the counters are right."""
    for _ in range(2):
        assert visitor.answer(answer_id=answer_id).json["answer_id"] == answer_id
    assert answers(site) == [answer_id]
    assert site.do(examine, "tiny", site.clock())["findings"] == []


def test_a_database_that_is_locked_for_a_while_only_delays_the_answer(
    site: Any, sqlite_url: str
) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    lock = sqlite3.connect(sqlite_url.removeprefix("sqlite:///"), check_same_thread=False)
    lock.execute("BEGIN EXCLUSIVE")
    threading.Timer(2.0, lock.rollback).start()
    began, answer_id = time.monotonic(), str(uuid.uuid4())
    assert visitor.answer(answer_id=answer_id).status_code == 200
    assert time.monotonic() - began > 1.5
    lock.close()
    assert_stored_once(site, visitor, answer_id)


def test_a_database_that_stays_locked_is_told_after_ten_seconds_and_nothing_is_lost(
    site: Any, sqlite_url: str
) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    lock = sqlite3.connect(sqlite_url.removeprefix("sqlite:///"))
    lock.execute("BEGIN EXCLUSIVE")
    began, answer_id = time.monotonic(), str(uuid.uuid4())
    reply = visitor.answer(answer_id=answer_id)
    assert reply.status_code == 503 and HELP in reply.json["message"]
    assert 9 < time.monotonic() - began < 15
    lock.close()
    assert_stored_once(site, visitor, answer_id)


def test_a_full_disk_is_told_and_nothing_is_lost(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    pages = []

    def fill(connection: Any, *_: object) -> None:
        size = connection.execute("PRAGMA page_count").fetchone()[0]
        pages.append(connection.execute(f"PRAGMA max_page_count={size}").fetchone())

    event.listen(site.database.engine, "checkout", fill)
    big = {"events": [report(name="x" * 9000) for _ in range(20)]}
    assert visitor.call("events", big).status_code == 503 and pages
    event.remove(site.database.engine, "checkout", fill)
    site.database.close()
    assert visitor.call("events", big).json["stored"] == 20
    assert_stored_once(site, visitor, str(uuid.uuid4()))


def report(**detail: Any) -> dict[str, Any]:
    return {"uuid": str(uuid.uuid4()), "kind": "play", "position": "first", "detail": detail}


def test_a_database_that_is_gone_is_told_on_every_page_and_comes_back(
    new_site: NewSite, own_postgresql: Any
) -> None:
    with own_postgresql() as cluster:
        site = new_site(f"{cluster}/postgres")
        visitor = site.visitor()
        visitor.go_to_trial()
        cluster.stop()
        answer_id = str(uuid.uuid4())
        refused = visitor.answer(answer_id=answer_id)
        assert refused.status_code == 503 and HELP in refused.json["message"]
        for url in ("/s/tiny", "/s/tiny/session", "/s/tiny/withdraw", "/r/none", "/m/none"):
            page = visitor.client.get(url)
            assert page.status_code == 503 and HELP in page.text
        assert visitor.client.get("/healthz").status_code == 503
        cluster.start()
        assert_stored_once(site, visitor, answer_id)


@pytest.mark.parametrize("value", [b"NaN", b"Infinity", b"1e999", rb'"\ud800"', b"[1]"])
def test_values_that_no_database_keeps_are_refused(
    new_site: NewSite, database_url: str, value: bytes
) -> None:
    site = new_site(database_url)
    visitor = site.visitor()
    visitor.go_to_trial()
    one = json.dumps({"events": [report(a=0)]}).encode()
    assert visitor.call("events", one.replace(b'"a": 0', b'"a": ' + value)).status_code == 400
    answer = {"answer_id": str(uuid.uuid4()), "chosen": "first", "response_time_ms": 1,
              "decision_time_ms": 1, "plays_first": 1, "plays_second": 1, "layout": "stacked",
              "screen": {"a": 0}}  # fmt: skip
    body = json.dumps(answer).encode().replace(b'"a": 0', b'"a": ' + value)
    assert visitor.call("answer", body).status_code == 400 and answers(site) == []


@pytest.mark.parametrize("word", ["a%00b", "%ff%fe", "%F0%9F%92%A9", "..%2f..%2fetc", "x" * 5000])
def test_broken_addresses_are_not_found_on_either_database(
    new_site: NewSite, database_url: str, word: str
) -> None:
    visitor = new_site(database_url).visitor()
    visitor.go_to_trial()
    for url in (f"/m/{word}", f"/r/{word}", f"/s/{word}", f"/m/{word}/poster"):
        assert visitor.client.get(url).status_code == 404
    headers = {"X-CSRFToken": visitor.page.csrf}
    call = f"/s/tiny/api/trials/{word}/events"
    reply = visitor.client.post(call, json={"events": [report()]}, headers=headers)
    assert reply.status_code in (400, 404) and reply.is_json


def test_a_form_that_is_not_text_stores_no_answer_and_breaks_nothing(
    new_site: NewSite, database_url: str
) -> None:
    site = new_site(database_url)
    visitor = site.visitor()
    fields = visitor.go_to_trial().fields
    for trial in ("\0", "é" * 3000, fields["trial"] + "\0"):
        form = fields | {"trial": trial, "choice": "first"}
        assert visitor.client.post("/s/tiny/trial", data=form).status_code == 400
    raw = b"choice=first&trial=%ff%fe\xff&csrf_token=" + fields["csrf_token"].encode()
    kind = "application/x-www-form-urlencoded"
    assert visitor.client.post("/s/tiny/trial", data=raw, content_type=kind).status_code == 400
    note = fields | {"text": "a\0b\udcff".encode("utf-8", "surrogateescape")}
    assert visitor.client.post("/s/tiny/step/comments", data=note).status_code == 303
    assert answers(site) == []


def test_a_forged_cookie_is_nobody(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    value = visitor.client.get_cookie("study").value
    middle = len(value) // 3
    other = "A" if value[middle] != "A" else "B"
    visitor.client.set_cookie("study", value[:middle] + other + value[middle + 1 :])
    assert "agree to take part" in visitor.client.get("/s/tiny", follow_redirects=True).text
    assert visitor.answer().status_code == 400 and answers(site) == []


def test_a_page_of_a_person_who_withdrew_in_another_tab_stores_nothing(site: Any) -> None:
    visitor = site.visitor()
    main = visitor.go_to_trial().main
    stale = visitor.client.get_cookie("study").value
    visitor.post("/s/tiny/withdraw", visitor.get("/s/tiny/withdraw").fields)
    visitor.client.set_cookie("study", stale)
    visitor.page.main.update(main)
    reply = visitor.answer()
    assert reply.status_code in (400, 404) and reply.is_json and answers(site) == []
    page = visitor.client.get("/s/tiny/session", follow_redirects=True)
    assert "agree to take part" in page.text


def test_an_answer_of_a_trial_that_was_answered_long_ago_changes_nothing(site: Any) -> None:
    visitor = site.visitor()
    old = visitor.go_to_trial().main["data-answer-url"]
    first = visitor.answer("first").json
    visitor.get("/s/tiny/session")
    new = visitor.page.main["data-answer-url"]
    visitor.page.main["data-answer-url"] = old
    assert old != new and visitor.answer("second").json == first
    assert answers(site) == [first["answer_id"]]


@pytest.mark.parametrize(("seconds", "evidence"), [(-3600, "unknown"), (1, "proven")])
def test_a_servers_clock_that_was_set_back_proves_nothing_against_anybody(
    seconds: int, evidence: str
) -> None:
    begin = datetime(2026, 3, 1, tzinfo=UTC)
    proof = {"view": 1, "covered": 1.0, "rate": 1, "hidden": False, "wall_ms": 1000}
    reports = [Report("play", "first", begin, {"view": 1}),
               Report("complete", "first", begin + timedelta(seconds=seconds), proof)]  # fmt: skip
    assert viewing_evidence(reports, "first", 1.0) == evidence


@pytest.mark.parametrize(
    ("waited_ms", "evidence"), [(0, "unproven"), (50, "unproven"), (150, "unknown")]
)
def test_a_start_that_reached_the_server_late_is_unknown_and_no_failure(
    waited_ms: int, evidence: str
) -> None:
    begin = datetime(2026, 3, 1, tzinfo=UTC)
    proof = {"view": 1, "covered": 1.0, "rate": 1, "hidden": False, "wall_ms": 1000}
    start = {"view": 1, "waited_ms": waited_ms}
    reports = [Report("play", "first", begin, start),
               Report("complete", "first", begin + timedelta(seconds=0.8), proof)]  # fmt: skip
    assert viewing_evidence(reports, "first", 1.0) == evidence


@pytest.mark.parametrize("hours", [-48, 48])
def test_a_jump_of_the_servers_clock_keeps_the_trial_and_the_answer(site: Any, hours: int) -> None:
    visitor = site.visitor()
    trial = visitor.go_to_trial().main["data-trial"]
    site.clock.forward(3600 * hours)
    assert visitor.get("/s/tiny").main["data-trial"] == trial
    assert_stored_once(site, visitor, visitor.answer().json["answer_id"])

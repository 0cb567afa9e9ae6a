"""The trial page's calls: forged, foreign, broken and late requests; evidence of viewing; leases."""

from __future__ import annotations

import uuid
from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import select

from study_app import studies
from study_app.doctor import examine
from study_app.models import PairCount, Participant, Response, Trial, ViewingEvent

NewSite = Callable[..., Any]


def stored(site: Any) -> Response:
    with site.database.read() as session:
        return session.scalars(select(Response)).one()


def event(kind: str, position: str | None = None, **detail: Any) -> dict[str, Any]:
    return {"uuid": str(uuid.uuid4()), "kind": kind, "position": position, "detail": detail}


def watch(site: Any, visitor: Any, position: str, seconds: float, **changes: Any) -> None:
    visitor.call("events", {"events": [event("play", position, view=1)]})
    site.clock.forward(seconds)
    proof = {"view": 1, "covered": 1.0, "rate": 1, "hidden": False, "wall_ms": 1000}
    visitor.call("events", {"events": [event("complete", position, **proof | changes)]})


@pytest.mark.parametrize(
    ("seconds", "changes", "evidence"),
    [
        (1.0, {}, "proven"),
        (0.25, {}, "unproven"),  # the page claims a second, the server's clock saw a quarter
        (1.0, {"covered": 0.5}, "unproven"),
        (1.0, {"rate": 2}, "unproven"),
        (1.0, {"hidden": True}, "unproven"),
        (1.0, {"wall_ms": 200}, "unproven"),
        (0.0, {"queued": True}, "unknown"),  # sent after an offline minute: cannot be timed
    ],
)
def test_viewing_is_judged_by_the_page_and_by_the_servers_clock(
    site: Any, seconds: float, changes: dict[str, Any], evidence: str
) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    watch(site, visitor, "first", seconds, **changes)
    assert visitor.answer().status_code == 200
    assert (stored(site).viewed_first, stored(site).viewed_second) == (evidence, "unproven")


def test_no_claim_of_the_page_makes_an_answer_simulated_or_late(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    assert visitor.answer(mode="simulated").status_code == 400
    assert visitor.answer(late=True).status_code == 400
    assert visitor.answer().status_code == 200


@pytest.mark.parametrize(
    "changes",
    [
        {"chosen": "third"},
        {"response_time_ms": -1},
        {"response_time_ms": 10**12},
        {"response_time_ms": "soon"},
        {"answer_id": "1"},
        {"plays_first": 10**9},
        {"layout": "round"},
        {"screen": {"a": "text"}},
    ],
)
def test_impossible_values_are_refused_and_nothing_is_stored(
    site: Any, changes: dict[str, Any]
) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    reply = visitor.answer(**changes)
    assert reply.status_code == 400 and reply.json["error"] == "bad_request"
    with site.database.read() as session:
        assert session.scalars(select(Response)).all() == []


@pytest.mark.parametrize("body", [b"", b"\xff\xfe\x00", b"[]", b'{"events": []}', b"{" * 5000])
def test_broken_bodies_are_refused(site: Any, body: bytes) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    assert visitor.call("answer", body).status_code == 400
    assert visitor.call("events", body).status_code == 400


def test_a_huge_body_is_refused(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    assert visitor.call("events", b" " * 400_000).status_code == 413


def test_a_call_without_csrf_token_is_refused(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    assert visitor.call("answer", b"{}", **{"X-CSRFToken": ""}).json["error"] == "bad_request"
    assert visitor.client.post("/s/tiny/trial", data={}).status_code == 400


def test_nobody_answers_anothers_trial(site: Any) -> None:
    one, other = site.visitor(), site.visitor()
    one.go_to_trial()
    other.go_to_trial()
    one.page.main["data-answer-url"] = other.page.main["data-answer-url"]
    assert one.answer().status_code == 400
    with site.database.read() as session:
        assert session.scalars(select(Response)).all() == []


def test_an_answer_to_a_trial_that_does_not_exist_is_refused(
    site: Any,
) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    fields = visitor.page.fields | {"trial": "0" * 32, "choice": "first"}
    assert visitor.client.post("/s/tiny/trial", data=fields).status_code == 400


def test_events_are_stored_once_however_often_they_arrive(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    batch = {"events": [event("painted"), event("play", "first", view=1)]}
    assert [visitor.call("events", batch).json["stored"] for _ in range(3)] == [2, 0, 0]
    with site.database.read() as session:
        assert len(session.scalars(select(ViewingEvent)).all()) == 2


def test_a_late_answer_is_kept_marked_and_counted_again(
    new_site: NewSite, database_url: str
) -> None:
    site = new_site(database_url)
    visitor = site.visitor()
    visitor.go_to_trial()
    site.clock.forward(31 * 60)
    assert site.do(examine, "tiny", site.clock())["swept"] == 4
    assert visitor.answer().status_code == 200 and stored(site).late
    with site.database.read() as session:
        counts = session.scalars(select(PairCount).where(PairCount.mode == "live"))
        assert sum(row.target_first + row.target_second for row in counts) == 1
    assert site.do(examine, "tiny", site.clock())["findings"] == []


def test_any_sign_of_life_renews_the_leases(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    for _ in range(3):
        site.clock.forward(20 * 60)
        visitor.call("events", {"events": [event("alive")]})
    visitor.answer()
    assert not stored(site).late


def test_who_comes_back_after_the_lease_gets_the_same_trial_in_time(site: Any) -> None:
    visitor = site.visitor()
    trial = visitor.go_to_trial().main["data-trial"]
    site.clock.forward(3600)
    site.do(examine, "tiny", site.clock())
    assert visitor.get("/s/tiny").main["data-trial"] == trial
    visitor.answer()
    assert not stored(site).late


def test_a_skipped_pair_goes_to_somebody_else(site: Any) -> None:
    visitor = site.visitor()
    trial = visitor.go_to_trial().main["data-trial"]
    assert visitor.call("skip", b"").status_code == 200
    assert visitor.get("/s/tiny").main["data-trial"] != trial
    assert site.do(examine, "tiny", site.clock())["findings"] == []
    assert visitor.answer_all().finished


def test_pilot_preview_and_simulated_views_never_count_as_live(site: Any) -> None:
    from study_app.studies import new_ticket

    for mode in ("preview", "simulated"):
        ticket = site.do(new_ticket, "tiny", mode, site.clock())
        assert site.visitor(f"/s/tiny?ticket={ticket}").answer_all().finished
    site.do(studies.open_study, "tiny", "pilot", site.clock())
    site.visitor().answer_all()
    with site.database.read() as session:
        views = dict.fromkeys(("live", "pilot", "preview", "simulated"), 0)
        for row in session.scalars(select(PairCount)):
            views[row.mode] += row.target_first + row.target_second
        modes = sorted(session.scalars(select(Participant.mode)))
    assert views == {"live": 0, "pilot": 4, "preview": 4, "simulated": 4}
    assert modes == ["pilot", "preview", "simulated"]


def test_an_excluded_persons_pairs_are_topped_up_and_the_answers_stay(site: Any) -> None:
    visitor = site.visitor()
    visitor.answer_all()
    with site.database.read() as session:
        code = session.scalars(select(Participant.code)).one()
    site.do(studies.exclude_participant, "tiny", code, True, site.clock())
    status = site.do(studies.study_status, "tiny", site.clock())
    assert status["views_per_pair"]["max"] == 0 and status["answers"] == 4
    site.do(studies.exclude_participant, "tiny", code, False, site.clock())
    assert site.do(studies.study_status, "tiny", site.clock())["views_per_pair"]["max"] == 1
    assert site.do(examine, "tiny", site.clock())["findings"] == []


def test_doctor_finds_a_counter_that_was_tampered_with_and_a_lost_clip(
    new_site: NewSite, sqlite_url: str
) -> None:
    site = new_site(sqlite_url)
    site.visitor().go_to_trial()

    def tamper(session: Any) -> None:
        session.scalars(select(PairCount)).first().target_first += 5

    site.do(tamper)
    findings = site.do(examine, "tiny", site.clock())["findings"]
    assert len(findings) == 1 and "recount" in findings[0]


def test_no_seat_of_a_session_shows_a_scene_and_motion_twice(
    new_site: NewSite, database_url: str
) -> None:
    site = new_site(database_url, "", ("trials_per_cell = 1", "trials_per_cell = 3"))
    site.visitor().answer_all()
    with site.database.read() as session:
        keys = session.scalars(select(Trial.exposure_key)).all()
    assert len(keys) == 12 == len(set(keys))


@pytest.mark.parametrize(("asked", "views"), [(2, [1, 1]), (3, [1, 2])])
def test_catch_and_practice_pairs_repeat_only_when_none_is_left(
    new_site: NewSite, sqlite_url: str, asked: int, views: list[int]
) -> None:
    site = new_site(sqlite_url, f"[extra_trials]\ncatch = {asked}\npractice = {asked}")
    for _ in range(3):
        assert site.visitor().answer_all().finished
    with site.database.read() as session:
        for person in session.scalars(select(Participant)):
            for kind in ("catch", "practice"):
                met = Counter(one.pair_id for one in person.trials if one.kind == kind)
                assert sorted(met.values()) == views

"""The way through a study: pages in order, resume anywhere, twice is once, withdraw leaves a count."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import func, select

from study_app import studies
from study_app.doctor import examine
from study_app.models import Participant, Response, StudyVersion, Trial

NewSite = Callable[..., Any]


def rows(site: Any, model: type) -> int:
    with site.database.read() as session:
        return int(session.scalar(select(func.count()).select_from(model)))


def code_of(visitor: Any) -> str:
    found = re.search(r'data-testid="completion-code">(\w+)<', visitor.reply.text)
    assert found, visitor.reply.text
    return found[1]


def test_a_whole_session_runs_from_consent_to_the_completion_code(
    new_site: NewSite, database_url: str
) -> None:
    site = new_site(
        database_url,
        "[extra_trials]\ncatch = 1\nidentical = 1\npractice = 2\n"
        "[checks]\ndemographics = true\ncomprehension = true",
    )
    visitor = site.visitor()
    assert visitor.answer_all().finished
    assert rows(site, Response) == 4 + 1 + 1 + 2
    code = code_of(visitor)
    visitor.get("/s/tiny")
    assert code_of(visitor) == code, "coming back shows the same code"
    assert site.do(examine, "tiny", site.clock())["findings"] == []


def test_a_reload_shows_the_same_trial_with_the_same_clips(site: Any) -> None:
    visitor = site.visitor()
    first = visitor.go_to_trial()
    tokens = re.findall(r"/m/[\w-]+", visitor.reply.text)
    again = visitor.get("/s/tiny")
    assert again.main["data-trial"] == first.main["data-trial"]
    assert re.findall(r"/m/[\w-]+", visitor.reply.text) == tokens


def test_the_personal_link_continues_the_session_on_another_device(site: Any) -> None:
    visitor = site.visitor()
    visitor.post(visitor.page.action, visitor.page.fields)
    link = re.search(r"/r/[\w-]+", visitor.reply.text)
    assert link
    trial = visitor.go_to_trial().main["data-trial"]
    assert site.visitor(link[0]).page.main["data-trial"] == trial
    assert rows(site, Participant) == 1


def test_agreeing_twice_enrols_once(site: Any) -> None:
    visitor = site.visitor()
    for _ in range(2):
        visitor.client.post("/s/tiny/consent", data=visitor.page.fields)
    assert rows(site, Participant) == 1


def test_a_repeated_answer_returns_the_stored_one_and_changes_nothing(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    first = visitor.answer("first")
    again = visitor.answer("second")
    assert again.status_code == first.status_code == 200
    assert again.json == first.json and again.json["chosen"] == "first"
    assert rows(site, Response) == 1


def test_the_plain_form_works_without_scripts_and_is_marked_unproven(site: Any) -> None:
    visitor = site.visitor()
    page = visitor.go_to_trial()
    visitor.post("/s/tiny/trial", page.fields | {"choice": "second"})
    with site.database.read() as session:
        stored = session.scalars(select(Response)).one()
        assert (stored.chosen_position, stored.viewed_first) == ("second", "unproven")
        assert stored.response_time_ms is None and stored.layout is None


def test_an_unopened_study_says_so_and_a_closed_one_takes_no_answer(
    new_site: NewSite, sqlite_url: str
) -> None:
    site = new_site(sqlite_url, opened=False)
    assert "has not started yet" in site.visitor().reply.text
    site.do(studies.open_study, "tiny", "live", site.clock())
    visitor = site.visitor()
    visitor.go_to_trial()
    site.do(studies.close_study, "tiny", site.clock())
    assert visitor.answer().status_code == 409 and rows(site, Response) == 0
    assert "is closed" in site.visitor().reply.text


def test_withdrawing_deletes_everything_but_a_count(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    visitor.answer()
    visitor.post("/s/tiny/withdraw", visitor.get("/s/tiny/withdraw").fields)
    assert "were deleted" in visitor.reply.text
    assert rows(site, Participant) == rows(site, Trial) == rows(site, Response) == 0
    with site.database.read() as session:
        assert session.scalars(select(StudyVersion)).one().withdrawn == 1
    assert site.do(examine, "tiny", site.clock())["findings"] == []


def test_a_break_is_offered_every_so_many_trials(new_site: NewSite, sqlite_url: str) -> None:
    site = new_site(sqlite_url, "[checks]\nbreak_every = 2")
    visitor = site.visitor()
    pauses = []
    while not visitor.go_to_trial().finished:
        pauses.append('id="pause"' in visitor.reply.text)
        visitor.answer()
        visitor.get("/s/tiny/session")
    assert pauses == [False, False, True, False]


def test_practice_tells_a_gross_failure_and_main_trials_tell_nothing(
    new_site: NewSite, sqlite_url: str
) -> None:
    site = new_site(sqlite_url, "[extra_trials]\npractice = 1")
    texts = {}
    for chosen in ("first", "second"):
        visitor = site.visitor()
        visitor.go_to_trial()
        assert set(visitor.answer(chosen).json) == {"chosen", "answer_id", "next"}
        visitor.get("/s/tiny/session")
        texts[chosen] = visitor.reply.text
        visitor.answer()
        visitor.get("/s/tiny/session")
        assert "practice-feedback" not in visitor.reply.text
    assert all("practice-feedback" in text for text in texts.values())


def test_a_platform_identity_leaves_the_address_and_brings_the_same_session_back(
    site: Any,
) -> None:
    visitor = site.visitor("/s/tiny?PROLIFIC_PID=secret-person")
    assert visitor.reply.history[0].status_code == 303
    assert "secret-person" not in visitor.reply.request.url
    trial = visitor.go_to_trial().main["data-trial"]
    again = site.visitor("/s/tiny?PROLIFIC_PID=secret-person")
    assert again.go_to_trial().main["data-trial"] == trial
    assert rows(site, Participant) == 1


@pytest.mark.parametrize("url", ["/", "/s/none", "/s/tiny/nothing", "/r/none", "/m/none"])
def test_an_unknown_address_gets_a_helpful_page(site: Any, url: str) -> None:
    reply = site.app.test_client().get(url)
    assert reply.status_code == 404 and "check the link" in reply.text


def test_fixed_completion_codes_and_links_back_come_from_the_study_file(
    new_site: NewSite, sqlite_url: str
) -> None:
    site = new_site(sqlite_url, '[completion]\ncode = "C1X2"\nurl = "https://example.org/back"')
    visitor = site.visitor()
    visitor.answer_all()
    assert code_of(visitor) == "C1X2" and 'href="https://example.org/back"' in visitor.reply.text


def test_own_wording_replaces_the_default_and_cannot_carry_markup(
    new_site: NewSite, sqlite_url: str
) -> None:
    site = new_site(sqlite_url, '[texts]\nconsent_agree = "<b>Ja</b>, ich will"')
    assert "&lt;b&gt;Ja&lt;/b&gt;, ich will" in site.visitor().reply.text

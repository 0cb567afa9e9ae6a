"""Blind and private by construction: what goes out names no method, what is kept names no person."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from study_app.studies import new_ticket, ticket_groups

NewSite = Callable[..., Any]
NAMES = ("pace", "paak", "posa", "lifted", "bedroom", "library", "walk_", "sit_")
EXTRAS = "[extra_trials]\ncatch = 1\nidentical = 1\npractice = 1\n"


def media(visitor: Any) -> list[str]:
    return re.findall(r"/m/[\w-]+(?:/poster)?", visitor.reply.text)


def shown_clips(visitor: Any) -> list[str]:
    return re.findall(r'src="(/m/[\w-]+)"', visitor.reply.text)


def test_nothing_that_a_participant_receives_names_a_method_scene_motion_or_file(
    new_site: NewSite, sqlite_url: str
) -> None:
    site = new_site(sqlite_url, EXTRAS)
    visitor = site.visitor()
    while not visitor.go_to_trial().finished:
        for url in media(visitor):
            visitor.fetch(url)
        visitor.answer()
        visitor.get("/s/tiny/session")
    files = [path.name for path in (site.stimuli / "clips").iterdir()]
    for reply in visitor.received:
        shown = f"{reply.request.url}\n{reply.headers}\n"
        shown += reply.text if "text" in reply.content_type or reply.is_json else ""
        words = [re.escape(name) for name in (*NAMES, *files)]
        assert re.findall(rf"(?<![A-Za-z])(?:{'|'.join(words)})", shown) == []


def test_the_cookie_holds_no_method_either(site: Any) -> None:
    from itsdangerous import base64_decode

    visitor = site.visitor()
    visitor.go_to_trial()
    cookie = visitor.client.get_cookie("study").value
    payload = cookie.lstrip(".").split(".")[0]
    decoded = base64_decode(payload)
    if cookie.startswith("."):
        import zlib

        decoded = zlib.decompress(decoded)
    assert not any(name.encode() in decoded for name in NAMES)


def test_a_clips_headers_are_the_same_for_every_clip_but_for_the_token(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    first, second = (visitor.fetch(url).headers for url in shown_clips(visitor))
    assert {k for k, _ in first} == {k for k, _ in second}
    assert "Last-Modified" not in first and "Content-Disposition" not in first
    assert first["ETag"] != second["ETag"]


def test_byte_ranges_are_served(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    url = shown_clips(visitor)[0]
    whole = visitor.fetch(url)
    part = visitor.fetch(url, Range="bytes=10-19")
    assert part.status_code == 206 and part.data == whole.data[10:20]
    assert part.headers["Content-Range"] == f"bytes 10-19/{len(whole.data)}"
    assert visitor.fetch(url, Range="bytes=99999999-").status_code == 416


def test_a_clips_address_works_for_its_participant_alone_and_until_the_answer(site: Any) -> None:
    visitor, other = site.visitor(), site.visitor()
    visitor.go_to_trial()
    other.go_to_trial()
    url = shown_clips(visitor)[0]
    assert visitor.fetch(url).status_code == 200
    assert other.fetch(url).status_code == 404
    assert site.app.test_client().get(url).status_code == 404
    visitor.answer()
    assert visitor.fetch(url).status_code == 410


def test_the_same_clip_never_has_the_same_address_twice(site: Any) -> None:
    seen: list[str] = []
    for _ in range(4):
        visitor = site.visitor()
        visitor.go_to_trial()
        seen += {url.removesuffix("/poster") for url in media(visitor)}
    assert len(seen) == len(set(seen)) == 4 * 2 * 4


def test_groups_are_told_to_simulated_participants_only_and_can_be_named_by_the_operator_only(
    site: Any,
) -> None:
    visitor = site.visitor()
    url = visitor.go_to_trial().main["data-answer-url"].replace("answer", "groups")
    assert visitor.fetch(url).status_code == 404
    ticket = site.do(new_ticket, "tiny", "simulated", site.clock())
    robot = site.visitor(f"/s/tiny?ticket={ticket}")
    url = robot.go_to_trial().main["data-answer-url"].replace("answer", "groups")
    told = robot.client.get(url).json
    named = site.do(ticket_groups, ticket)
    assert {told["first"], told["second"]} <= set(named.values())
    assert set(named) == {"pace", "paak", "posa_t"} and told["sound"] is None
    other = site.do(new_ticket, "tiny", "simulated", site.clock())
    assert set(site.do(ticket_groups, other).values()).isdisjoint(named.values())


def test_neither_address_nor_user_agent_nor_identity_nor_token_is_stored(
    site: Any, sqlite_url: str
) -> None:
    visitor = site.visitor("/s/tiny?PROLIFIC_PID=5f3e-person")
    visitor.client.post(
        "/s/tiny/consent",
        data=visitor.page.fields,
        headers={"User-Agent": "Mozilla/5.0 (X11) Chrome/141.7.7 Safari"},
        environ_base={"REMOTE_ADDR": "203.0.113.77"},
    )
    visitor.get("/s/tiny")
    link = re.search(r"/r/([\w-]+)", visitor.reply.text)
    assert link
    site.database.close()
    path = Path(sqlite_url.removeprefix("sqlite:///"))
    stored = b"".join(p.read_bytes() for p in path.parent.glob("study.sqlite*"))
    for secret in ("5f3e-person", "203.0.113.77", "141.7.7", link[1]):
        assert secret.encode() not in stored
    assert b"Chrome, desktop" in stored


@pytest.mark.parametrize("url", ["/s/tiny", "/s/none", "/static/study.css", "/healthz"])
def test_every_response_carries_the_security_headers(site: Any, url: str) -> None:
    headers = site.app.test_client().get(url, buffered=True).headers
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["X-Content-Type-Options"] == "nosniff"


def test_no_page_holds_inline_script_or_style(new_site: NewSite, sqlite_url: str) -> None:
    visitor = new_site(sqlite_url, EXTRAS).visitor()
    visitor.answer_all()
    for reply in visitor.received:
        if reply.mimetype == "text/html":
            assert not re.search(r"<script(?![^>]*src=)|<style|\sstyle=|\son\w+=", reply.text)


def test_too_many_requests_of_one_session_are_slowed_down_and_others_are_not(
    new_site: NewSite, sqlite_url: str
) -> None:
    site = new_site(sqlite_url, requests_per_minute=10)
    visitor = site.visitor()
    codes = [visitor.fetch("/s/tiny").status_code for _ in range(12)]
    assert codes[:9] == [200] * 9 and codes[-1] == 429
    assert site.visitor().reply.status_code == 200

"""What the operator can do: prepared lists, forgetting, versions, a database that is away, the documents."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select
from sqlalchemy.exc import OperationalError

from renderer.files import InputError
from study_app import studies
from study_app.config import Checks, StudyConfig, read_study
from study_app.doctor import examine
from study_app.forget import forget
from study_app.lists import read_lists
from study_app.models import AuditEntry, Pair, Participant, StudyVersion, Trial
from study_app.settings import SETTINGS
from study_app.stimuli import plan_study

NewSite = Callable[..., Any]
DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_prepared_lists_are_shown_as_they_were_prepared(
    site: Any, study_file: Callable[..., Path], tmp_path: Path
) -> None:
    rows = [
        {"scene": scene, "motion": f"walk_{n}", "target": "pace", "baseline": base, "first": first}
        for n, (scene, base, first) in enumerate(
            [("library", "paak", "target"), ("bedroom", "paak", "baseline"),
             ("bedroom", "posa_t", "target"), ("library", "posa_t", "baseline")]
        )
    ]  # fmt: skip
    (tmp_path / "lists.json").write_text(json.dumps([rows]))
    config = read_study(study_file('policy = "list"\nlists = "lists.json"'))
    plan = plan_study(config, site.stimuli, "study.toml")
    lists = read_lists(tmp_path / "lists.json", plan)
    site.do(studies.close_study, "tiny", site.clock())
    site.do(lambda session: studies.create_study(session, plan, site.clock(), lists))
    site.do(studies.open_study, "tiny", "live", site.clock())
    site.visitor().answer_all()
    with site.database.read() as session:
        shown = session.execute(
            select(Pair.scene, Pair.motion, Trial.target_first).join(Pair).order_by(Trial.ordinal)
        ).all()
    wanted = [(row["scene"], row["motion"], row["first"] == "target") for row in rows]
    assert [tuple(row) for row in shown] == wanted


def test_forgetting_by_platform_identity_deletes_that_person_alone(site: Any) -> None:
    for name in ("anna", "bert"):
        site.visitor(f"/s/tiny?participant={name}").answer_all()
    told = site.do(forget, "tiny", site.clock(), None, "anna")
    assert told["participants"] == 1
    with pytest.raises(InputError, match="wanted a known participant"):
        site.do(forget, "tiny", site.clock(), None, "anna")
    with site.database.read() as session:
        assert len(session.scalars(select(Participant)).all()) == 1
        actions = session.scalars(select(AuditEntry.action)).all()
        assert actions == ["create", "open", "forget"]
    assert site.do(examine, "tiny", site.clock())["findings"] == []


def test_a_browser_whose_participant_was_forgotten_begins_anew(site: Any) -> None:
    visitor = site.visitor("/s/tiny?participant=anna")
    visitor.go_to_trial()
    site.do(forget, "tiny", site.clock(), None, "anna")
    visitor.get("/s/tiny/session")
    assert "consent-agree" in visitor.reply.text


def test_cutting_the_identities_keeps_the_answers(site: Any) -> None:
    site.visitor("/s/tiny?participant=anna").answer_all()
    assert site.do(forget, "tiny", site.clock())["identities"] == 1
    with site.database.read() as session:
        assert session.scalars(select(Participant.platform_hash)).all() == [None]
    assert site.do(studies.study_status, "tiny", site.clock())["answers"] == 4


def test_a_changed_study_is_a_new_version_and_the_old_one_must_be_closed_first(
    site: Any, study_file: Callable[..., Path]
) -> None:
    path = study_file("", ("seed = 3", "seed = 4"))
    plan = plan_study(read_study(path), site.stimuli, path)
    site.do(studies.create_study, plan, site.clock())
    with pytest.raises(InputError, match="wanted it to be closed first"):
        site.do(studies.open_study, "tiny", "live", site.clock())
    site.do(studies.close_study, "tiny", site.clock())
    site.do(studies.open_study, "tiny", "live", site.clock())
    with site.database.read() as session:
        states = session.scalars(select(StudyVersion.state).order_by(StudyVersion.id)).all()
    assert states == ["closed", "open"]


def test_a_closed_study_cannot_be_opened_again(site: Any) -> None:
    site.do(studies.close_study, "tiny", site.clock())
    with pytest.raises(InputError, match="its data are frozen"):
        site.do(studies.open_study, "tiny", "live", site.clock())


def test_a_database_that_is_away_gets_a_helpful_page_and_the_answer_can_be_sent_again(
    site: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()

    def away(*_: object) -> None:
        raise OperationalError("SELECT 1", {}, Exception("gone"))

    with monkeypatch.context() as patch:
        patch.setattr(site.database, "retry", away)
        assert visitor.answer().status_code == 503
        page = visitor.client.get("/s/tiny/session")
        assert page.status_code == 503 and "Nothing of what you answered is lost" in page.text
    assert visitor.answer().status_code == 200


def test_every_setting_and_every_key_of_the_study_file_is_documented() -> None:
    text = (DOCS / "reference" / "study.md").read_text()
    for row in SETTINGS:
        assert f"`{row.variable}`" in text and row.prose in text
    for key in (*StudyConfig.model_fields, *Checks.model_fields):
        assert key == "schema_version" or key in text

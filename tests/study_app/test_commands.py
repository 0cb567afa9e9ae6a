"""The commands as an operator types them, over the real server and the real database."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from analysis.columns import COLUMN_NAMES
from analysis.responses import read_responses

Pace = Callable[..., Any]
EXTRAS = "[extra_trials]\ncatch = 1\nidentical = 1\npractice = 1\n[exclusions]\ndrop_late = true\n"


@pytest.fixture
def created(
    pace: Pace, study_file: Callable[..., Path], still_stimuli: Path, database_url: str
) -> str:
    """A study that was created and opened by commands; gives the database."""
    where = ("--database", database_url, "--json")
    made = pace("study", "create", study_file(EXTRAS), "--catalogue", still_stimuli, *where)
    assert json.loads(made.stdout).items() >= {"study_id": "tiny", "pairs": 24, "cells": 4}.items()
    opened = json.loads(pace("study", "open", "tiny", *where).stdout)
    assert opened["participant_url"] == "http://127.0.0.1:8000/s/tiny"
    return database_url


def test_simulated_participants_answer_over_http_and_the_export_tells_it_all(
    created: str, pace: Pace, serve: Callable[..., str], tmp_path: Path
) -> None:
    where = ("--database", created, "--json")
    ticket = json.loads(pace("study", "ticket", "tiny", *where).stdout)["ticket"]
    run = pace("simulate", "--url", serve(created), "--ticket", ticket, "--participants", 4, *where)
    told = json.loads(run.stdout)
    assert told["answers"] == 4 * 7 and set(told["truth"]["methods"]) == {"pace", "paak", "posa_t"}
    status = json.loads(pace("study", "status", "tiny", *where).stdout)
    assert status["participants"] == {"enrolled": 4, "finished": 4, "left": 0}
    assert json.loads(pace("study", "doctor", "tiny", *where).stdout)["findings"] == []
    assert json.loads(pace("study", "close", "tiny", *where).stdout)["state"] == "closed"
    pace("study", "export", "tiny", "--out", tmp_path / "out", *where)
    check_export(tmp_path / "out")


def check_export(folder: Path) -> None:
    with (folder / "responses.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert tuple(rows[0]) == COLUMN_NAMES and len(rows) == 28
    kinds = Counter(row["trial_kind"] for row in rows)
    assert kinds == {"main": 16, "catch": 4, "identical": 4, "practice": 4}
    assert {(row["mode"], row["viewed_first"]) for row in rows} == {("simulated", "unknown")}
    for row in rows:
        assert row["chosen_method"] == row[f"{row['chosen_position']}_method"]
    assert len(read_responses(folder / "responses.csv")) == 28, "the analysis accepts every row"
    codebook = json.loads((folder / "codebook.json").read_text())
    assert codebook["study_state"] == "closed" and codebook["exclusions"] == {"drop_late": 1.0}
    assert [column["name"] for column in codebook["columns"]] == list(COLUMN_NAMES)


def test_creating_the_same_study_again_changes_nothing(
    pace: Pace, study_file: Callable[..., Path], still_stimuli: Path, sqlite_url: str
) -> None:
    words = (
        "study",
        "create",
        study_file(),
        "--catalogue",
        still_stimuli,
        "--database",
        sqlite_url,
    )
    first, again = (pace(*words, "--json").stdout for _ in range(2))
    assert first == again
    study_file("", ("seed = 3", "seed = 4"))
    assert json.loads(pace(*words, "--json").stdout)["version"] != json.loads(first)["version"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("study", "status", "none"), "study_id: got 'none', wanted one of tiny"),
        (("study", "export", "none", "--out", "x"), "study_id: got 'none'"),
        (("study", "forget", "tiny", "--participant", "X"), "wanted a known participant"),
        (("study", "exclude", "tiny", "X"), "wanted the code of a participant"),
    ],
)
def test_bad_requests_get_one_line_and_status_one(
    pace: Pace, study_file: Callable[..., Path], still_stimuli: Path, sqlite_url: str,
    words: tuple[str, ...], message: str,
) -> None:  # fmt: skip
    where = ("--database", sqlite_url)
    pace("study", "create", study_file(), "--catalogue", still_stimuli, *where)
    reply = pace(*words, *where)
    assert reply.returncode == 1 and reply.stdout == ""
    assert message in reply.stderr and reply.stderr.count("\n") == 1


def test_a_mistyped_database_is_named_and_not_made(pace: Pace, tmp_path: Path) -> None:
    reply = pace("study", "status", "tiny", "--database", f"sqlite:///{tmp_path}/none.sqlite")
    assert reply.returncode == 1 and "wanted an existing study database" in reply.stderr
    assert list(tmp_path.iterdir()) == []
    reply = pace("study", "status", "tiny", "--database", "mysql://x/y")
    assert reply.returncode == 1 and reply.stderr.count("\n") == 1


def test_a_misspelt_study_file_leaves_no_database_behind(
    pace: Pace, study_file: Callable[..., Path], still_stimuli: Path, tmp_path: Path
) -> None:
    path = study_file('layuot = "auto"')
    words = ("study", "create", path, "--catalogue", still_stimuli)
    reply = pace(*words, "--database", f"sqlite:///{tmp_path}/new.sqlite")
    assert reply.returncode == 1 and "nearest is 'layout'" in reply.stderr
    assert not (tmp_path / "new.sqlite").exists()


def test_the_balance_certificate_needs_no_database_and_prints_both_policies(pace: Pace) -> None:
    reply = pace("study", "balance", "--participants", 12, "--dropout", 0.2, "--seed", 5, "--json")
    told = json.loads(reply.stdout)
    keys = {"views_per_pair", "unseen_pairs", "side_difference_max", "first_per_person"}
    assert keys <= set(told) and keys <= set(told["random"])


def test_a_simulation_without_a_server_or_with_a_wrong_ticket_says_so(
    created: str, pace: Pace, serve: Callable[..., str]
) -> None:
    reply = pace("simulate", "--url", "http://127.0.0.1:9", "--ticket", "x" * 20)
    assert reply.returncode == 1 and "wanted a running study server" in reply.stderr
    reply = pace("simulate", "--url", serve(created), "--ticket", "x" * 20)
    assert reply.returncode == 1 and "got 404" in reply.stderr


def test_too_few_extra_pairs_are_told_when_the_study_is_created(
    pace: Pace, study_file: Callable[..., Path], still_stimuli: Path, sqlite_url: str
) -> None:
    study = study_file("[extra_trials]\ncatch = 3\npractice = 2\nidentical = 13")
    where = ("--catalogue", still_stimuli, "--database", sqlite_url, "--json")
    made = pace("study", "create", study, *where)
    assert json.loads(made.stdout)["notes"] == [
        "3 catch trials a person from 2 catch pairs: some are shown again",
        "13 identical trials a person from 12 identical pairs: some are shown again",
    ]
    assert made.stderr.count("note: ") == 2

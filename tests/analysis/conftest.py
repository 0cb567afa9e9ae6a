"""Answer files for the tests of the analysis, made row by row."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.cells import Cells, count_cells
from analysis.columns import COLUMN_NAMES

Row = dict[str, Any]
PAPER_WINS = {"POSA-T": 570, "Motion Synthesis": 682, "PAAK": 498}


def answer(**changes: Any) -> Row:
    """One valid answer: PACE stood first and was chosen; `won=False` makes the baseline chosen."""
    row: Row = {
        "study_id": "study", "study_version": "v1", "mode": "live", "participant": "P01",
        "trial_index": 1, "block": 1, "trial_kind": "main", "pair_id": "pair", "scene": "library",
        "motion": "walk", "target": "PACE", "baseline": "PAAK", "expected_method": "",
        "repeat_of": "", "layout": "stacked", "response_time_ms": 9000, "decision_time_ms": 2000,
        "plays_first": 1, "plays_second": 2, "viewed_first": "proven", "viewed_second": "unknown",
        "started_at": "2026-03-01T10:00:00Z", "answered_at": "2026-03-01T10:00:09Z", "late": "false",
    }  # fmt: skip
    won, target_first = changes.pop("won", True), changes.pop("target_first", True)
    row |= changes
    shown = (row["target"], row["baseline"]) if target_first else (row["baseline"], row["target"])
    chosen = row["target"] if won else row["baseline"]
    made = {"first_method": shown[0], "second_method": shown[1], "chosen_method": chosen}
    made["chosen_position"] = "first" if chosen == shown[0] else "second"
    return row | made | {name: value for name, value in changes.items() if name in made}


def write_answers(path: Path, rows: Iterable[Row], **codebook: Any) -> Path:
    """A `responses.csv`; with keyword arguments a closed study's `codebook.json` beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, COLUMN_NAMES)
        writer.writeheader()
        writer.writerows(rows)
    if codebook:
        content = {"schema_version": 1, "study_state": "closed"} | codebook
        (path.parent / "codebook.json").write_text(json.dumps(content))
    return path


def study_rows(
    wins: dict[str, int], participants: int = 42, scenes: int = 4, clips: int = 5, seed: int = 1,
    **changes: Any,
) -> list[Row]:  # fmt: skip
    """A balanced study with exactly `wins` choices of PACE against each baseline."""
    rng = np.random.default_rng(seed)
    rows, stimuli = [], [(s, c) for s in range(scenes) for c in range(clips)]
    for number, (baseline, count) in enumerate(wins.items()):
        won = np.arange(participants * len(stimuli)) < count
        rng.shuffle(won)
        for person in range(participants):
            for place, (scene, clip) in enumerate(stimuli):
                rows.append(answer(
                    participant=f"P{person:02d}", baseline=baseline, scene=f"scene{scene}",
                    motion=f"clip{clip}", trial_index=1 + number * len(stimuli) + place,
                    won=bool(won[person * len(stimuli) + place]),
                    target_first=(person + place + number) % 2 == 0,
                    response_time_ms=int(rng.gamma(5, 2000)), **changes,
                ))  # fmt: skip
    return rows


@pytest.fixture(scope="session")
def make_answers() -> Callable[..., Path]:
    """`write_answers`, for test files that cannot import one another."""
    return write_answers


@pytest.fixture(scope="session")
def make_row() -> Callable[..., Row]:
    return answer


@pytest.fixture(scope="session")
def make_study() -> Callable[..., list[Row]]:
    return study_rows


@pytest.fixture(scope="session")
def paper_answers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's design (42 x 60) with the only counts that print its table: 570, 682, 498 of 840."""
    folder = tmp_path_factory.mktemp("paper")
    return write_answers(folder / "responses.csv", study_rows(PAPER_WINS))


@pytest.fixture(scope="session")
def random_cells() -> Callable[..., Cells]:
    """Simulated crossed answers: participants x stimuli, logistic, normal effects."""

    def make(
        seed: int, people: int = 12, stimuli: int = 15, sd: float = 0.6, drop: float = 0.3
    ) -> Cells:
        rng = np.random.default_rng(seed)
        person, stimulus = np.divmod(np.arange(2 * people * stimuli), 2 * stimuli)
        stimulus //= 2
        logit = 0.4 + rng.normal(0, sd, people)[person] + rng.normal(0, sd, stimuli)[stimulus]
        keep = rng.random(len(person)) > drop
        won = rng.random(len(person)) < 1 / (1 + np.exp(-logit))
        return count_cells(person[keep], stimulus[keep], won[keep])

    return make

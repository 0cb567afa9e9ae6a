"""Policy `list`: sessions prepared by the experimenter, one after another, round and round.

A JSON list of sessions; each session is a list of rows `{scene, motion, target, baseline, first}`,
`first` being "target" or "baseline". Every session has one row per main trial.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from renderer.files import InputError, read_json
from study_app.stimuli import StudyPlan

KEYS = ("scene", "motion", "target", "baseline", "first")


def read_lists(path: Path, plan: StudyPlan) -> list[list[dict[str, str]]]:
    """Read and check prepared sessions against the study. Raises `InputError` naming the row."""
    content = read_json(path)
    if not isinstance(content, list) or not content:
        raise InputError(path, "content", type(content).__name__, "a list of sessions")
    length = len(plan.cells) * plan.config.trials_per_cell
    known: set[tuple[str, ...]] = {
        (pair.target.scene, pair.target.motion, pair.target.method, pair.baseline.method)
        for pair in plan.pairs
        if pair.kind == "main"
    }
    for index, rows in enumerate(content):
        if not isinstance(rows, list) or len(rows) != length:
            count = len(rows) if isinstance(rows, list) else type(rows).__name__
            raise InputError(path, f"session {index + 1}", count, f"{length} rows")
        for number, row in enumerate(rows, start=1):
            _check_row(path, f"session {index + 1}, row {number}", row, known)
        if not plan.config.repeat_scene_motion:
            _check_distinct(path, f"session {index + 1}", rows)
    return content


def _check_row(path: Path, where: str, row: Any, known: set[tuple[str, ...]]) -> None:
    if not isinstance(row, dict) or set(row) != set(KEYS):
        raise InputError(path, where, row, "an object with " + ", ".join(KEYS))
    if row["first"] not in ("target", "baseline"):
        raise InputError(path, f"{where}, first", row["first"], "target or baseline")
    if tuple(row[key] for key in KEYS[:4]) not in known:
        raise InputError(path, where, row, "a pair of this study")


def _check_distinct(path: Path, where: str, rows: list[dict[str, str]]) -> None:
    seen: set[tuple[str, str]] = set()
    for row in rows:
        stimulus = (row["scene"], row["motion"])
        if stimulus in seen:
            raise InputError(path, where, "|".join(stimulus), "each (scene, motion) once a session")
        seen.add(stimulus)

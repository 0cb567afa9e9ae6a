"""The comparison table over methods: plausibility scores of every placement, means by method."""

from __future__ import annotations

import dataclasses
import textwrap
from pathlib import Path
from typing import Any

from experiments.config import StimulusSetConfig
from experiments.methods import METHODS
from experiments.records import SetFolder
from renderer.files import InputError, read_json, write_json

SCHEMA_VERSION = 1
FILE_NAME = "evaluation.json"

COLUMNS: tuple[tuple[str, str, int], ...] = (
    ("non_collision", "non-coll.", 3),
    ("contact", "contact", 3),
    ("contact_1cm", "at 1 cm", 3),
    ("cv2", "cv2", 2),
    ("contact_beyond_floor", "not floor", 2),
    ("depth_max_m", "depth m", 3),
    ("semantic_match", "class", 2),
    ("angle_mean_deg", "mean deg", 2),
    ("angle_max_deg", "max deg", 1),
    ("jerk_change_mm", "jerk +mm", 2),
)
"""Score, heading, decimals. Scores that a placement does not have print as a dash."""


def write_evaluation(config: StimulusSetConfig, folder: SetFolder) -> dict[str, Any]:
    """Write `evaluation.json` (every placement and the means) and return it."""
    rows = [record for record in folder.placement_records() if not record["extra"]]
    evaluation = {
        "schema_version": SCHEMA_VERSION,
        "set_id": config.set_id,
        "placement": dataclasses.asdict(config.placement),
        "rows": [
            {key: row[key] for key in ("scene", "motion", "method", "scores", "failure")}
            for row in rows
        ],
        "methods": method_means(rows, config.methods),
    }
    write_json(folder.path / FILE_NAME, evaluation)
    return evaluation


def method_means(rows: list[dict[str, Any]], methods: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Per method: number of clips, failures, and every score's mean over clips.

    The mean runs over frames within a clip first, then over clips (PACE, section on metrics).
    """
    means: dict[str, dict[str, Any]] = {}
    for method in methods:
        own = [row for row in rows if row["method"] == method]
        scored = [row["scores"] for row in own if not row["failure"]]
        names = sorted({name for scores in scored for name in scores})
        columns = {name: [scores[name] for scores in scored if name in scores] for name in names}
        means[method] = {
            "clips": len(scored),
            "failures": len(own) - len(scored),
            **{name: sum(values) / len(values) for name, values in columns.items()},
        }
    return means


def read_evaluation(folder: Path) -> dict[str, Any]:
    """Read `evaluation.json` of a set folder."""
    path = folder / FILE_NAME
    record = read_json(path)
    if not isinstance(record, dict) or record.get("schema_version") != SCHEMA_VERSION:
        raise InputError(path, "schema_version", "another", f"the number {SCHEMA_VERSION}")
    return record


LEGEND = (
    "non-coll., contact: strict scores of the literature on the full mesh; at 1 cm: contact within 1 cm; "
    "cv2: predicted contact vertices within 2 cm; not floor: contact with anything but floor; "
    "depth: deepest vertex; class: predicted contacts nearest to their class; deg: change of joint "
    "angles; jerk +: added jerk in mm per frame cubed."
)


def plausibility_table(evaluation: dict[str, Any]) -> str:
    """The table as plain text, one line a method; scores are means over clips.

    Methods placed for fewer motions than others are not comparable row by row: the number of
    clips stands first for that reason.
    """
    heads = ["method", "clips", *(head for _, head, _ in COLUMNS)]
    lines = []
    for name, means in evaluation["methods"].items():
        cells = [METHODS[name].display_name, str(means["clips"])]
        for score, _, decimals in COLUMNS:
            cells.append(_shown(means[score], decimals) if score in means else "-")
        lines.append(cells)
    widths = [max(len(row[i]) for row in [heads, *lines]) for i in range(len(heads))]
    body = "\n".join(
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in [heads, ["-" * width for width in widths], *lines]
    )
    return body + "\n" + textwrap.fill(LEGEND, 110)


def _shown(value: float, decimals: int) -> str:
    # Adding zero turns the minus zero of a rounded tiny number into a plain zero.
    return f"{round(value, decimals) + 0.0:.{decimals}f}"

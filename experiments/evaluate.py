"""The comparison of methods over a stimulus set: `evaluation.json`, `table.md`, the printed table."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from experiments.comparison import compare, kept_rows
from experiments.comparison_table import comparison_markdown
from experiments.config import PlacementConfig, StimulusSetConfig
from experiments.methods import METHODS
from experiments.placement.settings import PRESETS
from experiments.records import SetFolder
from renderer.files import InputError, atomic_path, read_json, write_json

SCHEMA_VERSION = 1
FILE_NAME = "evaluation.json"
TABLE_NAME = "table.md"
FULL_FOLDER = "full"
"""Where the placements with the fuller preset lie, inside the folder of the set."""

Progress = Callable[[str, int, int], None]

COLUMNS: tuple[tuple[str, str, int], ...] = (
    ("non_collision", "non-coll.", 3),
    ("contact", "contact", 3),
    ("contact_1cm", "at 1 cm", 3),
    ("cv2", "cv2", 2),
    ("contact_beyond_floor", "not floor", 2),
    ("deeper_1cm", "deep", 4),
    ("depth_max_m", "depth m", 3),
    ("semantic_match", "class", 2),
    ("angle_mean_deg", "mean deg", 2),
    ("angle_max_deg", "max deg", 1),
    ("jerk_change_mm", "jerk +mm", 2),
)
"""Score, heading, decimals. Scores that a placement does not have print as a dash."""


def evaluate_set(
    config: StimulusSetConfig,
    out: Path,
    jobs: int = 2,
    progress: Progress = lambda *_: None,
    device: str = "cpu",
) -> dict[str, Any]:
    """Place and score everything a configuration asks for, and compare; goes on where it stopped.

    Leaves `evaluation.json` and `table.md` in `out`. With `placement.full_motions` the first so
    many motions are placed with `placement.full_preset` as well, compared apart.
    """
    from experiments.pipeline import place_set

    fuller = full_config(config)
    folder = place_set(config, out, jobs, progress, device)
    if fuller is not None:
        place_set(
            fuller,
            out / FULL_FOLDER,
            jobs,
            lambda s, d, n: progress(f"{s} (full)", d, n),
            device,
        )
    evaluation = write_evaluation(config, folder)
    with atomic_path(out / TABLE_NAME) as temporary:
        temporary.write_text(comparison_markdown(evaluation), encoding="utf-8")
    return evaluation


def full_config(config: StimulusSetConfig) -> StimulusSetConfig | None:
    """The part of a set that is placed with the fuller preset as well; None without any."""
    placement = config.placement
    if not placement.full_motions:
        return None
    if not config.motions:
        raise InputError(config.set_id, "placement.full_motions", placement.full_motions, "motions")
    return dataclasses.replace(
        config,
        set_id=f"{config.set_id}-full",
        motions=config.motions[: placement.full_motions],
        placement=PlacementConfig(preset=placement.full_preset),
        extras=dataclasses.replace(config.extras, catch=0, practice=0),
    )


def write_evaluation(config: StimulusSetConfig, folder: SetFolder) -> dict[str, Any]:
    """Write `evaluation.json`: every placement, the comparison, what was dropped; return it."""
    evaluation = compared(config, folder)
    fuller = full_config(config)
    if fuller is not None and (folder.path / FULL_FOLDER / "records").is_dir():
        evaluation["full"] = compared(fuller, SetFolder(folder.path / FULL_FOLDER))
    write_json(folder.path / FILE_NAME, evaluation)
    return evaluation


def compared(config: StimulusSetConfig, folder: SetFolder) -> dict[str, Any]:
    """The evaluation of one set folder."""
    rows = [record for record in folder.placement_records() if not record["extra"]]
    kept = kept_rows(rows)
    settings = PRESETS[config.placement.preset]
    cells = sorted({row["sdf_cell_m"] for row in rows if "sdf_cell_m" in row})
    return {
        "schema_version": SCHEMA_VERSION,
        "set_id": config.set_id,
        "seed": config.seed,
        "placement": dataclasses.asdict(config.placement),
        "conditions": {
            "scenes": list(config.scenes),
            "motions": list(folder.motion_ids(config)),
            "cut_seconds": config.cut_seconds,
            "body": config.body,
            "interaction": settings.interaction,
            "weighting": settings.weighting,
            "contact_tolerance_m": settings.contact_tolerance,
            "sdf_cell_m": cells,
            "semantics_off": _semantics_off(rows),
        },
        "rows": [
            {key: row.get(key) for key in ("scene", "motion", "method", "scores", "failure")}
            for row in rows
        ],
        "cases": {
            "all": len({(row["scene"], row["motion"]) for row in rows}),
            "kept": len({(row["scene"], row["motion"]) for row in kept}),
        },
        "dropped": [
            {key: row[key] for key in ("scene", "motion", "method", "failure")}
            for row in rows
            if row["failure"]
        ],
        "methods": compare(kept, config.methods, config.seed),
    }


def _semantics_off(rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Scenes in which classes did not count, and why."""
    told = [(row["scene"], row.get("info", {}).get("semantics_off", "")) for row in rows]
    return {scene: reason for scene, reason in sorted(told) if reason}


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
    "deep: share of vertices deeper than 1 cm; depth: deepest vertex; class: predicted contacts nearest "
    "to their class; deg: change of joint angles; jerk +: added jerk in mm per frame cubed."
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
    return "\n".join([body, *_cell_line(evaluation), textwrap.fill(LEGEND, 110)])


def _cell_line(evaluation: dict[str, Any]) -> list[str]:
    cells = evaluation.get("conditions", {}).get("sdf_cell_m", [])
    sizes = ", ".join(f"{100 * cell:.1f} cm" for cell in cells)
    return [f"Signed distance read from cells of {sizes}."] if sizes else []


def _shown(value: float, decimals: int) -> str:
    # Adding zero turns the minus zero of a rounded tiny number into a plain zero.
    return f"{round(value, decimals) + 0.0:.{decimals}f}"

"""Sweeps over placement settings on the training rooms: where the weights of this project come from.

`python -m experiments.sweep weights --out DIR` writes one row a (setting, motion, room) as CSV and
the means by setting as Markdown. `plus` does so for the terms of PACE+, `collapse` for the
ablations with and without a change of variables and a rounded penalty.
"""

from __future__ import annotations

import csv
import dataclasses
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import torch
from rich.console import Console
from rich.progress import track

from experiments.body.embedded import load_body
from experiments.methods.ablations import place_variant
from experiments.methods.pace import place_altered
from experiments.methods.preparation import prepare
from experiments.methods.rigid import rigid_fits
from experiments.metrics import plausibility
from experiments.motion.library import load_motion, trim
from experiments.placement.errors import PlacementError
from experiments.placement.placement import Placement
from experiments.placement.problem import Problem
from experiments.placement.settings import PRESETS, PlacementSettings
from experiments.placement.solver import Fit
from experiments.scene.baking import load_room
from renderer.files import InputError, atomic_path

CASES: tuple[tuple[str, str], ...] = (
    ("walk_turn_right", "office"),
    ("sit_stay_stand", "office"),
    ("sit_stay_stand", "dining"),
    ("lean_table", "dining"),
)
"""(motion, training room)."""
SECONDS = 4.0

Setting = tuple[str, str, Mapping[str, Any]]
"""(name, method, changed fields of `PlacementSettings`)."""


def _weights(pose: float, motion: float, translation: float) -> Setting:
    changes = {"lambda_pose": pose, "lambda_mot": motion, "lambda_tau": translation}
    return f"{pose:g} / {motion:g} / {translation:g}", "pace", changes


SWEEPS: dict[str, tuple[Setting, ...]] = {
    "weights": (
        _weights(0.1, 10, 50),
        _weights(0.1, 10, 5),
        _weights(0.1, 10, 500),
        _weights(0.1, 1, 500),
        _weights(0.1, 100, 5),
        _weights(0.02, 2, 50),
        _weights(0.5, 50, 10),
        _weights(1.6, 10, 0.5),
    ),
    "plus": (
        ("none (PACE)", "pace", {}),
        ("3 mm rule", "pace", {"contact_tolerance": 0.003}),
        *(
            (f"3 mm rule, slide {slide:g}, bend {bend:g}", "pace",
             {"contact_tolerance": 0.003, "slide_weight": slide, "bend_weight": bend})
            for slide, bend in ((0, 300), (5000, 0), (500, 300), (2000, 300), (5000, 300), (5000, 1000))
        ),
    ),
    "collapse": tuple(
        (f"{name}, {kind}", method, changes)
        for kind, changes in (
            ("whitened, rounded", {"rescue": False}),
            ("whitened, printed kink", {"rescue": False, "huber_widths": (0.0,)}),
            ("raw, printed kink",
             {"rescue": False, "huber_widths": (0.0,), "parameterisation": "raw"}),
        )
        for name, method in (
            ("full", "pace"), ("without pose", "pace_no_pose"), ("without motion", "pace_no_motion")
        )
    ),
}  # fmt: skip
"""What each sweep tries; the first setting is the one in use."""

_SCORES = (
    "non_collision", "contact", "contact_1cm", "cv2", "frames_with_prediction",
    "angle_mean_deg", "angle_max_deg", "jerk_change_mm", "step_change_max_mm",
    "foot_skate_cm_s", "foot_skate_before_cm_s",
)  # fmt: skip
_TERMS = (
    "total", "contact", "penetration", "semantics", "pose", "motion", "translation", "slide",
    "bend",
)  # fmt: skip


_SCENE_FIELDS = ("contact_tolerance", "huber_widths", "contact_threshold")
"""Settings that the rigid fits depend on; all others share them."""


def sweep_rows(
    settings: Sequence[Setting], cases: Sequence[tuple[str, str]], base: Mapping[str, Any]
) -> Iterator[dict[str, Any]]:
    """One row a (case, setting): the final energy by terms and the scores, or why there is none.

    `base` changes every setting alike.
    """
    for motion_id, room in cases:
        case = _Case(motion_id, room)
        for name, method, changes in settings:
            row = {"setting": name, "motion": motion_id, "room": room, "failure": ""}
            yield row | case.result(method, {**base, **changes})


class _Case:
    """One motion in one room; the rigid fits that settings share are found once."""

    def __init__(self, motion_id: str, room: str) -> None:
        self._motion, self._scene = trim(load_motion(motion_id), SECONDS), load_room(room)
        self._body = load_body("male_slim")
        self._begun: dict[tuple[Any, ...], tuple[Problem, list[Fit]]] = {}

    def result(self, method: str, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Energy, scores and effort of one setting; the reason if there is no placement."""
        settings = dataclasses.replace(PRESETS["fast"], **changes)
        try:
            placement = self._place(method, settings)
        except PlacementError as error:
            return {"failure": error.reason}
        scores = plausibility(
            placement.motion, self._motion, self._scene, self._body, settings
        ).as_dict()
        chosen = placement.info["chosen_start"]
        return {
            **{f"E_{name}": placement.terms.get(name, 0.0) for name in _TERMS},
            **{name: scores[name] for name in _SCORES if name in scores},
            "E_rigid": placement.info["rigid_energies"][chosen],
            "evaluations": placement.info["evaluations"],
            "optimiser": placement.info.get("optimiser", "reached"),
        }

    def _place(self, method: str, settings: PlacementSettings) -> Placement:
        key = (settings.interaction, *(getattr(settings, name) for name in _SCENE_FIELDS))
        if key not in self._begun:
            problem = prepare(self._motion, self._scene, self._body, settings, 0)
            self._begun[key] = problem, rigid_fits(problem)
        problem, rigid = self._begun[key]
        problem = dataclasses.replace(problem, settings=settings)
        if method == "pace":
            return place_altered(problem, rigid, method, 0)
        return place_variant(
            problem, rigid, "lambda_pose" if method == "pace_no_pose" else "lambda_mot", 0
        )


_SHOWN: tuple[tuple[str, str, int], ...] = (
    ("E_total", "E", 2), ("E_contact", "contact term", 2), ("E_penetration", "penetration", 2),
    ("E_pose", "pose", 3), ("E_motion", "motion", 3), ("E_translation", "translation", 3),
    ("cv2", "cv2", 2), ("contact", "contact", 3), ("contact_1cm", "at 1 cm", 3),
    ("non_collision", "non-coll.", 3), ("angle_mean_deg", "mean deg", 2),
    ("angle_max_deg", "max deg", 1), ("jerk_change_mm", "jerk +mm", 3),
    ("step_change_max_mm", "step mm", 1), ("foot_skate_cm_s", "skate cm/s", 1),
    ("frames_with_prediction", "frames with contact", 2),
)  # fmt: skip


def means_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Means by setting over the cases that every setting placed, as a Markdown table."""
    failed = {(row["motion"], row["room"]) for row in rows if row["failure"]}
    names = list(dict.fromkeys(row["setting"] for row in rows))
    heads = ["setting", *(head for _, head, _ in _SHOWN), "optimiser failed"]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for name in names:
        own = [
            row
            for row in rows
            if row["setting"] == name and (row["motion"], row["room"]) not in failed
        ]
        if not own:
            continue
        cells = [_mean(own, key, decimals) for key, _, decimals in _SHOWN]
        stalled = sum(row["optimiser"] == "failed" for row in own)
        lines.append("| " + " | ".join([name, *cells, f"{stalled} of {len(own)}"]) + " |")
    return "\n".join(lines) + "\n"


def _mean(rows: Sequence[Mapping[str, Any]], key: str, decimals: int) -> str:
    values = [row[key] for row in rows if key in row]
    return f"{sum(values) / len(values):.{decimals}f}" if values else "-"


@click.command()
@click.argument("sweep", type=click.Choice(list(SWEEPS)))
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, help="Folder for both files."
)
@click.option("--interaction", default=None, help="Interaction model; the default's otherwise.")
@click.option("--case", "cases", multiple=True, help="MOTION:ROOM, may be repeated.")
def main(sweep: str, out: Path, interaction: str | None, cases: Sequence[str]) -> None:
    """Run SWEEP on the training rooms and write SWEEP.csv and SWEEP.md."""
    torch.set_num_threads(1)
    chosen = [_case(text) for text in cases] or list(CASES)
    base = {"interaction": interaction} if interaction else {}
    found = sweep_rows(SWEEPS[sweep], chosen, base)
    total = len(SWEEPS[sweep]) * len(chosen)
    rows = list(track(found, sweep, total=total, console=Console(stderr=True)))
    fields = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, fields, lineterminator="\n")
    writer.writeheader()
    writer.writerows([{key: _rounded(value) for key, value in row.items()} for row in rows])
    for suffix, content in (("csv", text.getvalue()), ("md", means_table(rows))):
        with atomic_path(out / f"{sweep}.{suffix}") as temporary:
            temporary.write_text(content)


def _case(text: str) -> tuple[str, str]:
    motion, found, room = text.partition(":")
    if not found:
        raise InputError("command line", "case", text, "MOTION:ROOM")
    return motion, room


def _rounded(value: Any) -> Any:
    return float(f"{value:.6g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main()

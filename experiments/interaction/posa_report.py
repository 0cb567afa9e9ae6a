"""The report of `pace-study train posa --report`: trained networks beside every baseline."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.interaction.contact_report import (
    ReportRow,
    TestSets,
    report,
    report_records,
    report_table,
    score,
)
from experiments.interaction.held_out import Show, held_out_sets
from experiments.interaction.learned import SHIPPED, WEIGHTS_FOLDER
from experiments.interaction.trained_model import TrainedModel
from experiments.interaction.weights_file import load_weights
from renderer.files import write_bytes, write_json


def report_folder(folder: Path, data_seed: int, show: Show) -> tuple[dict[str, Any], str]:
    """Score the shipped networks and those in `folder`; write `report.json` and `report.md` there.

    A network in the folder is any `model.safetensors` in it or one level down. Each is scored with
    the labels it was trained on. Returns the record and the tables.
    """
    models = {name: WEIGHTS_FOLDER / file for name, (file, _) in SHIPPED.items()}
    for path in sorted((*folder.glob("model.safetensors"), *folder.glob("*/model.safetensors"))):
        models[path.parent.name] = path
    sets = held_out_sets(data_seed, show)
    rows = report_rows(models, sets, show)
    record = {"rows": report_records(rows)}
    write_json(folder / "report.json", record)
    write_bytes(folder / "report.md", report_table(rows).encode())
    return record, report_table(rows)


def report_rows(models: dict[str, Path], sets: TestSets, show: Show) -> list[ReportRow]:
    """Rows of all models and baselines, thickness by thickness; each model also as placement uses it."""
    loaded = {name: load_weights(path) for name, path in models.items()}
    thicknesses = sorted({note.thickness_m for _, note in loaded.values()})
    rows: list[ReportRow] = []
    for index, thickness_m in enumerate(thicknesses):
        show("report", index, len(thicknesses))
        here = [
            TrainedModel(name, network)
            for name, (network, note) in loaded.items()
            if note.thickness_m == thickness_m
        ]
        found = report(here, sets, thickness_m)
        rows += _with_maps_as_used(found, here, sets, thickness_m)
    show("report", len(thicknesses), len(thicknesses))
    return rows


def _with_maps_as_used(
    rows: list[ReportRow], models: list[TrainedModel], sets: TestSets, thickness_m: float
) -> list[ReportRow]:
    data_of = {"fitted": sets.fitted, "free": sets.free}
    used = {
        (name, model.name): model.as_used(data)
        for name, data in data_of.items()
        for model in models
    }
    added = list(rows)
    for row in rows:
        for model in models:
            if row.method == f"{model.name}, z = 0":
                data = data_of[row.test_set]
                whole = row.kind == "all"
                chosen = np.ones(len(data.clip), bool) if whole else data.bodies_of(kind=row.kind)
                prediction = used[row.test_set, model.name]
                added.append(score(prediction, data, thickness_m, chosen, _emptied(row)))
    return added


def _emptied(row: ReportRow) -> ReportRow:
    """The row with the scores that only a whole model has taken out."""
    none = float("nan")
    return replace(
        row,
        f1_samples=none,
        f1_best_sample=none,
        f1_posterior=none,
        gap=none,
        diversity=none,
        active_units=none,
    )

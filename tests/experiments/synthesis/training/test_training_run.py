"""A run as the command line starts it: result, report, amounts of capture, bad input."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from experiments.synthesis import training_run
from experiments.synthesis.learning_curve import restricted
from experiments.synthesis.placed_windows import DataSettings, PlacedWindows
from experiments.synthesis.training import Plan
from experiments.synthesis.training_run import data_record, report_text, run_training, summary
from experiments.synthesis.weights import KINDS, weights_file


def test_less_capture_leaves_made_clips_and_held_out_clips_alone(windows: PlacedWindows) -> None:
    part = restricted(windows, 0.0, seed=0)
    assert part.shares()["captured"] == 0.0
    assert part.capture_minutes() < windows.capture_minutes()
    assert len(part.placed("held_out")) == len(windows.placed("held_out"))
    assert part.capture_minutes("held_out") == windows.capture_minutes("held_out")
    kinds = {part.clips[clip].kind for clip in part.clip[part.window[part.placed("train")]]}
    assert kinds == {"composed", "authored"}


def test_all_of_the_capture_is_all_of_the_data(windows: PlacedWindows) -> None:
    part = restricted(windows, 1.0, seed=0)
    assert np.array_equal(part.window, windows.window)
    assert part.clips == windows.clips


def test_the_report_has_a_row_for_every_group_and_method() -> None:
    scores = {"position_cm": 1.234, "heading_deg": 5.0}
    record = {
        "held_out": {"route": {"all": {"network": scores, "straight line": scores}}},
        "amounts": [{"capture_minutes": 0.5, "route_cm": 20.0, "pose_deg": 10.0}],
    }
    lines = report_text(record).splitlines()
    assert "| all | network | 1.23 | 5.00 |" in lines
    assert "| all | straight line | 1.23 | 5.00 |" in lines
    assert lines[-1] == "| 0.50 | 20.00 | 10.00 |"


def test_the_summary_says_what_was_not_read(windows: PlacedWindows) -> None:
    row = {"step": 5, "epoch": 1.0, "train": 0.5, "held_out": 0.25}
    record = {"data": data_record(windows), "curves": {"route": row}, "weights": {"route": "r"}}
    text = summary(record)
    assert "not read: shape:" in text
    assert "route    step 5: train 0.5000, held out 0.2500" in text


@pytest.mark.slow
def test_a_run_with_report_leaves_weights_curves_scores_and_pictures(
    settings: DataSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training_run, "CURVE_STEPS", 2)
    stages: set[str] = set()
    record = run_training(
        settings,
        Plan(epochs=(1, 1, 1), batch=32),
        tmp_path,
        False,
        True,
        lambda stage, done, of: stages.add(stage),
    )
    assert stages == {"networks", "amounts of capture"}
    assert set(record["held_out"]) == {"route", "pose", "subgoal"}
    assert len(record["amounts"]) == 3
    assert json.loads((tmp_path / "run.json").read_text()) == json.loads(json.dumps(record))
    for name in ("curves.png", "routes.png", "poses.png", "bodies.png", "report.md"):
        assert (tmp_path / name).stat().st_size > 500
    assert all(weights_file(kind, tmp_path).is_file() for kind in KINDS)


def test_a_folder_without_motions_is_one_line_on_the_command_line(tmp_path: Path) -> None:
    out, empty = tmp_path / "run", tmp_path / "empty"
    empty.mkdir()
    command = [sys.executable, "-m", "pace_study", "train", "synthesis", "--out", str(out)]
    done = subprocess.run([*command, "--motions", str(empty)], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stdout == ""
    assert "no motion file" in done.stderr.strip().splitlines()[-1]
    assert not out.exists()

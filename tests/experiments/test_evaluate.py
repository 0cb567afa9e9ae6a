"""The comparison table: means over clips, with the number of clips beside them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from experiments.evaluate import method_means, plausibility_table, read_evaluation
from renderer.files import InputError, write_json


def _row(method: str, failure: str = "", **scores: float) -> dict[str, Any]:
    return {"method": method, "failure": failure, "scores": scores}


def test_means_run_over_clips_and_leave_failures_out() -> None:
    rows = [_row("pace", contact=1.0), _row("pace", contact=0.5), _row("pace", failure="too long")]
    means = method_means(rows, ("pace",))["pace"]
    assert means == {"clips": 2, "failures": 1, "contact": 0.75}


def test_a_score_that_some_clips_lack_is_the_mean_of_the_others() -> None:
    rows = [_row("pace", cv2=0.4), _row("pace")]
    assert method_means(rows, ("pace",))["pace"]["cv2"] == 0.4


def test_a_method_without_any_clip_prints_dashes_and_no_nan() -> None:
    means = method_means([_row("posa_t", failure="no place")], ("posa_t",))
    table = plausibility_table({"methods": means})
    line = next(row for row in table.splitlines() if row.startswith("POSA-T"))
    assert line.split()[:2] == ["POSA-T", "0"]
    assert set(line.split()[2:]) == {"-"}


def test_another_schema_version_is_refused(tmp_path: Path) -> None:
    write_json(tmp_path / "evaluation.json", {"schema_version": 99})
    with pytest.raises(InputError, match="schema_version"):
        read_evaluation(tmp_path)

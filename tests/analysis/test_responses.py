from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.columns import COLUMN_NAMES
from analysis.responses import read_responses
from renderer.files import InputError


def test_a_valid_file_keeps_every_row_and_its_number(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rows = [make_row(trial_index=i, participant=p) for p in ("01", "1") for i in range(1, 4)]
    read = read_responses(make_answers(tmp_path / "r.csv", rows))
    assert read.labels["participant"] == ("01", "1")  # never one participant of "01" and "1"
    assert read.rows.tolist() == [2, 3, 4, 5, 6, 7]
    assert read.numbers["response_time_ms"].tolist() == [9000.0] * 6
    assert read.labels["target"] == read.labels["chosen_method"] == ("PAAK", "PACE")


def test_the_order_of_rows_changes_no_code(
    tmp_path: Path, make_answers: Callable, make_study: Callable
) -> None:
    rows = make_study({"PAAK": 20, "POSA-T": 30}, participants=2)
    forward = read_responses(make_answers(tmp_path / "a.csv", rows))
    backward = read_responses(make_answers(tmp_path / "b.csv", rows[::-1]))
    assert forward.labels == backward.labels
    for name in forward.codes:
        np.testing.assert_array_equal(forward.codes[name], backward.codes[name][::-1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mode": "Live"}, "row 3, mode: got 'Live', wanted live or pilot or preview or simulated"),
        ({"trial_index": "2.5"}, "row 3, trial_index: got '2.5', wanted a whole number from 0"),
        ({"participant": ""}, "row 3, participant: got '', wanted a name"),
        ({"late": "yes"}, "row 3, late: got 'yes', wanted true or false or unknown"),
        ({"chosen_position": ""}, "row 3, chosen_position: got '', wanted first or second"),
        ({"response_time_ms": "-4"}, "row 3, response_time_ms: got '-4', wanted milliseconds"),
        ({"started_at": "2026-03-01T10:00:00"}, "row 3, started_at: got '2026-03-01T10:00:00'"),
        ({"trial_index": 1}, "row 3, trial_index: got 'P01, trial 1', wanted one answer a trial; see row 2"),
        ({"chosen_method": "PAAK"}, "row 3, chosen_method: got 'PAAK', wanted PACE, which stood"),
        ({"first_method": "ghost"}, "row 3, chosen_method: got 'PACE', wanted ghost"),
        ({"first_method": "ghost", "chosen_method": "ghost"}, "row 3, first_method, second_method: got"),
        ({"baseline": "PACE"}, "wanted two methods, PACE and PACE"),
        ({"study_version": "v2"}, "row 3, study_version: got 'v2', wanted v1"),
        ({"study_id": "other"}, "row 3, study_id: got 'other', wanted one study a file"),
        ({"trial_kind": "catch"}, "row 3, expected_method: got '', wanted one of the two methods"),
        ({"trial_kind": "repeat"}, "row 3, repeat_of: got '', wanted the trial_index"),
    ],
)  # fmt: skip
def test_a_wrong_row_is_named_by_number(
    tmp_path: Path, make_answers: Callable, make_row: Callable, changes: dict, message: str
) -> None:
    rows = [make_row(), make_row(**({"trial_index": 2} | changes))]
    with pytest.raises(InputError) as caught:
        read_responses(make_answers(tmp_path / "r.csv", rows))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (",".join(COLUMN_NAMES) + ",mood", "column: got 'mood'"),
        (",".join(COLUMN_NAMES[:-1]), "wanted a column late"),
        (",".join(COLUMN_NAMES) + ",mode", "wanted every column once"),
        (",".join(COLUMN_NAMES), "rows: got 0, wanted at least one answer"),
        ("", "wanted a column study_id"),
    ],
)
def test_a_wrong_header_or_an_empty_file_is_refused(
    tmp_path: Path, header: str, message: str
) -> None:
    path = tmp_path / "r.csv"
    path.write_text(header + "\n" if header else "")
    with pytest.raises(InputError, match=message):
        read_responses(path)


def test_a_broken_last_line_is_named(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    path = make_answers(tmp_path / "r.csv", [make_row(trial_index=i) for i in range(1, 9)])
    whole = path.read_text()
    body = whole[: whole.rindex("2026-03-01T10:00:09Z") + 8]
    path.write_text(body)
    with pytest.raises(InputError, match="row 9, answered_at"):
        read_responses(path)
    path.write_text(whole.replace("\r\n", "\n").rstrip("\n") + ",more\n")
    with pytest.raises(InputError, match="row 9: got '29 cells', wanted 28"):
        read_responses(path)
    path.write_text(whole + 'study,"v1')
    with pytest.raises(InputError, match=r"row 10: .*quotes closed"):
        read_responses(path)
    path.write_bytes(whole.replace("\r\n", "\n").encode() + "sé".encode("latin-1"))
    with pytest.raises(InputError, match="row 10: got 'byte 0xe9', wanted 28 cells in UTF-8"):
        read_responses(path)


def test_every_truncation_of_the_last_line_is_refused_or_whole(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    path = make_answers(tmp_path / "r.csv", [make_row(), make_row(trial_index=2)])
    text = path.read_text().rstrip("\r\n")
    start = text.rindex("\n") + 1
    for end in range(start + 1, len(text)):
        path.write_text(text[:end])
        with pytest.raises(InputError, match="row 3, "):
            read_responses(path)
    path.write_text(text)
    assert len(read_responses(path)) == 2


def test_bytes_that_are_not_utf8_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_bytes(",".join(COLUMN_NAMES).encode() + b"\n" + b"\xff" * 30 + b"\n")
    with pytest.raises(InputError, match="UTF-8"):
        read_responses(path)
    with pytest.raises(InputError, match="missing"):
        read_responses(tmp_path / "none.csv")


def test_chunks_are_seamless(
    tmp_path: Path, make_answers: Callable, make_study: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = make_study({"PAAK": 50, "POSA-T": 30}, participants=4)
    path = make_answers(tmp_path / "r.csv", rows)
    whole = read_responses(path)
    monkeypatch.setattr("analysis.responses.CHUNK_ROWS", 7)
    pieces = read_responses(path)
    assert whole.labels == pieces.labels and whole.started == pieces.started
    for name in whole.codes:
        np.testing.assert_array_equal(whole.codes[name], pieces.codes[name])
    rows[33]["late"] = "no"
    with pytest.raises(InputError, match="row 35, late"):
        read_responses(make_answers(path, rows))

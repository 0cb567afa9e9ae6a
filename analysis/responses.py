"""Reading `responses.csv`: one row an answer, checked column by column, wrong rows named by number.

Rows are numbered as a spreadsheet shows them: the header is row 1. Nothing is dropped here; what is
later left out of an estimate is counted by `analysis.exclusions`.
"""

from __future__ import annotations

import csv
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from analysis.columns import COLUMN_NAMES, COLUMNS, UNKNOWN, Column
from renderer.files import InputError, file_sha256

CHUNK_ROWS = 50_000
METHOD_COLUMNS = (
    "target", "baseline", "first_method", "second_method", "expected_method", "chosen_method",
)  # fmt: skip
_BY_NAME = {column.name: column for column in COLUMNS}
_NUMERIC = ("count", "milliseconds")


@dataclass(frozen=True)
class Responses:
    """Checked answers. Text is coded, because a million answers hold few different words."""

    source: str
    sha256: str
    codes: dict[str, Int[np.ndarray, "N"]]
    """Per text column, index into `labels`; -1 where the cell is empty."""
    labels: dict[str, tuple[str, ...]]
    """Sorted values of each text column; all method columns share one list."""
    numbers: dict[str, Float[np.ndarray, "N"]]
    """Counts and milliseconds; not-a-number where the cell is empty or `unknown`."""
    rows: Int[np.ndarray, "N"]
    """Row number in the file, from 2."""
    started: tuple[str, str] | None
    """First and last `started_at` of the file, if any was measured."""

    def __len__(self) -> int:
        return len(self.rows)

    def equals(self, column: str, value: str) -> Bool[np.ndarray, "N"]:
        """Rows whose text column holds exactly `value`."""
        labels = self.labels[column]
        wanted = labels.index(value) if value in labels else -2
        return np.asarray(self.codes[column] == wanted)

    def take(self, keep: Bool[np.ndarray, "N"]) -> Responses:
        """The same answers with only the rows in `keep`; labels stay, so codes stay comparable."""
        if keep.all():
            return self
        return replace(
            self,
            codes={name: values[keep] for name, values in self.codes.items()},
            numbers={name: values[keep] for name, values in self.numbers.items()},
            rows=self.rows[keep],
        )


def read_responses(source: Path) -> Responses:
    """Read and check a `responses.csv`.

    Raises `InputError` with the row number on an unknown or missing column, a value outside its
    column's declaration, a duplicate (participant, trial_index), a `chosen_method` that contradicts
    `chosen_position`, a participant with mixed study versions, a broken line, or a file without rows.
    """
    _check_header(source)
    reader = _Columns(source)
    for chunk in _chunks(source):
        reader.add(chunk)
    if not reader.count:
        raise InputError(source, "rows", 0, "at least one answer")
    responses = reader.finish()
    for check in (_check_duplicates, _check_choices, _check_designs, _check_versions):
        check(responses)
    return responses


def _check_header(source: Path) -> None:
    try:
        with source.open(newline="", encoding="utf-8-sig") as stream:
            header = next(csv.reader(stream), [])
    except FileNotFoundError:
        raise InputError(source, "file", "missing", "an existing responses.csv") from None
    except UnicodeDecodeError as error:
        raise _broken(source, str(error)) from None
    except (OSError, csv.Error) as error:
        raise InputError(source, "row 1", str(error), "a header") from None
    for name in header:
        if name not in _BY_NAME:
            raise InputError(source, "row 1, column", name, "only the columns of responses.csv")
        if header.count(name) > 1:
            raise InputError(source, "row 1, column", name, "every column once")
    for name in COLUMN_NAMES:
        if name not in header:
            raise InputError(source, "row 1, column", "missing", f"a column {name}")


def _chunks(source: Path) -> Iterator[pd.DataFrame]:
    try:
        with warnings.catch_warnings():
            # A row with too many cells is only warned about by the parser, and then cut. Cells stay
            # strings: the parser's own categories would make one participant of "1" and "01".
            warnings.simplefilter("error", pd.errors.ParserWarning)
            yield from pd.read_csv(
                source, dtype=object, na_filter=False, skip_blank_lines=False, index_col=False,
                chunksize=CHUNK_ROWS, encoding="utf-8-sig",
            )  # fmt: skip
    except pd.errors.EmptyDataError:
        return
    except (pd.errors.ParserWarning, pd.errors.ParserError, UnicodeDecodeError) as error:
        raise _broken(source, str(error)) from None


def _broken(source: Path, message: str) -> InputError:
    """Names the first row that cannot be read, which the fast parser's own message does not."""
    wanted = f"{len(COLUMNS)} cells in UTF-8, quotes closed"
    with source.open("rb") as stream:
        for number, line in enumerate(stream, 1):
            try:
                line.decode("utf-8-sig")
            except UnicodeDecodeError as error:
                byte = f"byte 0x{line[error.start]:02x}"
                return InputError(source, f"row {number}", byte, wanted)
    with source.open(newline="", encoding="utf-8-sig") as text:
        last = 0
        try:
            for last, cells in enumerate(csv.reader(text, strict=True), 1):
                if len(cells) != len(COLUMNS):
                    return InputError(source, f"row {last}", f"{len(cells)} cells", wanted)
        except csv.Error as error:
            return InputError(source, f"row {last + 1}", str(error), wanted)
    return InputError(source, "rows", message, wanted)


class _Columns:
    """Collects chunks: checks every distinct value once and keeps codes instead of strings."""

    def __init__(self, source: Path) -> None:
        self.source = source
        self.count = 0
        self._vocabulary: dict[str, dict[str, int]] = {}
        self._parts: dict[str, list[np.ndarray]] = {c.name: [] for c in COLUMNS}
        self._times: list[str] = []

    def add(self, chunk: pd.DataFrame) -> None:
        """Check and keep one chunk of rows."""
        for column in COLUMNS:
            if column.kind == "time":
                self._add_times(column, chunk[column.name].tolist())
            else:
                self._add_values(column, chunk[column.name])
        self.count += len(chunk)

    def _add_times(self, column: Column, cells: list[str]) -> None:
        for index, cell in enumerate(cells):
            if cell != UNKNOWN and not _is_utc(cell):
                self._refuse(column, index, cell)
        if column.name == "started_at":
            known = [cell for cell in cells if cell != UNKNOWN]
            self._times += [min(known), max(known)] if known else []

    def _add_values(self, column: Column, cells: pd.Series[str]) -> None:
        codes, distinct = pd.factorize(cells.to_numpy(dtype=object))
        values = [str(value) for value in distinct]
        accept = _NUMBERS.get(column.kind, _is_choice if column.choices else _is_text)
        wrong = [i for i, value in enumerate(values) if not _allowed(column, value, accept)]
        if wrong:
            index = int(np.isin(codes, wrong).argmax())
            self._refuse(column, index, values[codes[index]])
        if column.kind in _NUMERIC:
            numbers = np.array([_number(value) for value in values] or [0.0])
            self._parts[column.name].append(numbers[codes])
            return
        shared = "methods" if column.name in METHOD_COLUMNS else column.name
        known = self._vocabulary.setdefault(shared, {})
        lookup = [known.setdefault(value, len(known)) if value else -1 for value in values]
        self._parts[column.name].append(np.array(lookup or [0], dtype=np.int32)[codes])

    def _refuse(self, column: Column, index: int, value: str) -> None:
        row = self.count + index + 2
        raise InputError(self.source, f"row {row}, {column.name}", value, _wanted(column))

    def finish(self) -> Responses:
        """Everything as whole columns, labels sorted so that the order of rows changes nothing."""
        codes, labels, numbers = {}, {}, {}
        for column in COLUMNS:
            parts = self._parts.pop(column.name)
            if column.kind in _NUMERIC:
                numbers[column.name] = np.concatenate(parts)
            elif column.kind != "time":
                shared = "methods" if column.name in METHOD_COLUMNS else column.name
                labels[column.name], order = _sorted_labels(self._vocabulary[shared])
                codes[column.name] = order[np.concatenate(parts)]
        return Responses(
            source=str(self.source), sha256=file_sha256(self.source), codes=codes, labels=labels,
            numbers=numbers, rows=np.arange(2, self.count + 2),
            started=(min(self._times), max(self._times)) if self._times else None,
        )  # fmt: skip


def _sorted_labels(known: dict[str, int]) -> tuple[tuple[str, ...], Int[np.ndarray, "L"]]:
    labels = tuple(sorted(known))
    order = np.full(len(known) + 1, -1, dtype=np.int32)  # the last entry serves code -1
    for rank, label in enumerate(labels):
        order[known[label]] = rank
    return labels, order


def _allowed(column: Column, value: str, accept: Callable[[Column, str], bool]) -> bool:
    if value == "":
        return column.may_be_empty
    if value == UNKNOWN and (column.may_be_unknown or UNKNOWN in column.choices):
        return True
    return accept(column, value)


def _is_choice(column: Column, value: str) -> bool:
    return value in column.choices


def _is_text(column: Column, value: str) -> bool:
    return len(value) <= 300 and value.isprintable() and value == value.strip()


def _is_count(column: Column, value: str) -> bool:
    return value.isascii() and value.isdigit() and len(value) <= 12


def _is_milliseconds(column: Column, value: str) -> bool:
    whole, _, rest = value.partition(".")
    return _is_count(column, whole) and (not rest or _is_count(column, rest))


_NUMBERS = {"count": _is_count, "milliseconds": _is_milliseconds}


def _number(value: str) -> float:
    return float("nan") if value in ("", UNKNOWN) else float(value)


def _is_utc(value: str) -> bool:
    try:
        return datetime.fromisoformat(value).utcoffset() == timedelta(0)
    except ValueError:
        return False


def _wanted(column: Column) -> str:
    kinds = {
        "text": "a name of at most 300 printable characters", "count": "a whole number from 0",
        "milliseconds": "milliseconds from 0", "time": "an ISO 8601 time in UTC",
    }  # fmt: skip
    wanted = " or ".join(column.choices) or kinds.get(column.kind, column.kind)
    wanted += f" or {UNKNOWN}" if column.may_be_unknown and UNKNOWN not in column.choices else ""
    return wanted + (" or an empty cell" if column.may_be_empty else "")


def _fail(responses: Responses, index: int, column: str, value: object, wanted: str) -> None:
    raise InputError(responses.source, f"row {responses.rows[index]}, {column}", value, wanted)


def _check_duplicates(responses: Responses) -> None:
    """(participant, trial_index) names one answer."""
    trials = responses.numbers["trial_index"].astype(np.int64)
    people = responses.codes["participant"].astype(np.int64)
    order = np.lexsort((responses.rows, trials, people))
    same = (np.diff(people[order]) == 0) & (np.diff(trials[order]) == 0)
    if same.any():
        again = order[1:][same]
        index = int(again[np.argmin(responses.rows[again])])
        mine = (people == people[index]) & (trials == trials[index])
        first = int(responses.rows[mine].min())
        who = responses.labels["participant"][people[index]]
        value = f"{who}, trial {trials[index]}"
        _fail(responses, index, "trial_index", value, f"one answer a trial; see row {first}")


def _check_choices(responses: Responses) -> None:
    """The chosen method is the method that stood in the chosen position."""
    codes, methods = responses.codes, responses.labels["chosen_method"]
    first = responses.equals("chosen_position", "first")
    derived = np.where(first, codes["first_method"], codes["second_method"])
    wrong = derived != codes["chosen_method"]
    if wrong.any():
        index = int(wrong.argmax())
        position = "first" if first[index] else "second"
        wanted = f"{methods[derived[index]]}, which stood in the {position} position"
        value = methods[codes["chosen_method"][index]]
        _fail(responses, index, "chosen_method", value, wanted)


def _check_designs(responses: Responses) -> None:
    """Main and repeat trials show target and baseline; catch trials show the expected method."""
    codes, methods = responses.codes, responses.labels["target"]
    pair = responses.equals("trial_kind", "main") | responses.equals("trial_kind", "repeat")
    first, second = codes["first_method"], codes["second_method"]
    target, baseline = codes["target"], codes["baseline"]
    fits = ((first == target) & (second == baseline)) | ((first == baseline) & (second == target))
    wrong = pair & (~fits | (target == baseline))
    if wrong.any():
        index = int(wrong.argmax())
        shown = f"{methods[first[index]]} and {methods[second[index]]}"
        wanted = f"two methods, {methods[target[index]]} and {methods[baseline[index]]}"
        _fail(responses, index, "first_method, second_method", shown, wanted)
    expected = codes["expected_method"]
    wrong = responses.equals("trial_kind", "catch") & (expected != first) & (expected != second)
    if wrong.any():
        index = int(wrong.argmax())
        value = methods[expected[index]] if expected[index] >= 0 else ""
        _fail(responses, index, "expected_method", value, "one of the two methods shown")
    wrong = responses.equals("trial_kind", "repeat") & np.isnan(responses.numbers["repeat_of"])
    if wrong.any():
        _fail(responses, int(wrong.argmax()), "repeat_of", "", "the trial_index that is repeated")


def _check_versions(responses: Responses) -> None:
    """One study a file, one study version a participant."""
    if len(responses.labels["study_id"]) > 1:
        index = int((responses.codes["study_id"] != responses.codes["study_id"][0]).argmax())
        value = responses.labels["study_id"][responses.codes["study_id"][index]]
        _fail(responses, index, "study_id", value, "one study a file")
    people, versions = responses.codes["participant"], responses.codes["study_version"]
    first = np.full(len(responses.labels["participant"]), -1)
    first[people[::-1]] = versions[::-1]
    wrong = first[people] != versions
    if wrong.any():
        index = int(wrong.argmax())
        known = responses.labels["study_version"]
        wanted = f"{known[first[people[index]]]}, the version of this participant's other answers"
        _fail(responses, index, "study_version", known[versions[index]], wanted)

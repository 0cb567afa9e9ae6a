"""The columns of `responses.csv`, declared once.

The export writes by this table, the reader validates by it, and the codebook and the reference page
are printed from it. Standard library only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

SCHEMA_VERSION = 1
UNKNOWN = "unknown"

Kind = Literal["text", "count", "milliseconds", "choice", "time", "flag"]


@dataclass(frozen=True)
class Column:
    """One column: its name, what its cells hold, and prose for the codebook."""

    name: str
    kind: Kind
    prose: str
    choices: tuple[str, ...] = ()
    may_be_empty: bool = False
    """Empty means: does not apply to this row."""
    may_be_unknown: bool = False
    """`unknown` means: applies, but was not measured."""


_POSITIONS = ("first", "second")
_EVIDENCE = ("proven", "unproven", UNKNOWN)

COLUMNS: tuple[Column, ...] = (
    Column("study_id", "text", "Identifier of the study."),
    Column("study_version", "text", "Hash of the frozen study design that served the trial."),
    Column("mode", "choice", "What kind of run the answer comes from; modes never mix.",
           ("live", "pilot", "preview", "simulated")),
    Column("participant", "text", "Pseudonymous participant code, random, unique in the study."),
    Column("trial_index", "count", "Ordinal of the trial within the participant's session, from 1."),
    Column("block", "count", "Block of the session, from 1; 0 for practice."),
    Column("trial_kind", "choice", "What the trial is for.",
           ("main", "catch", "identical", "repeat", "practice")),
    Column("pair_id", "text", "Identifier of the clip pair."),
    Column("scene", "text", "Scene of both clips."),
    Column("motion", "text", "Motion slot of both clips; with `scene` it names the stimulus."),
    Column("target", "text", "Method under study in this pair."),
    Column("baseline", "text", "Method that the target is compared with."),
    Column("first_method", "text", "Method of the clip in the first position (above or left)."),
    Column("second_method", "text", "Method of the clip in the second position (below or right)."),
    Column("expected_method", "text", "Catch and practice trials: the method of the sound clip.",
           may_be_empty=True),
    Column("repeat_of", "count", "Repeat trials: trial_index of the trial that is repeated.",
           may_be_empty=True),
    Column("layout", "choice", "How the two clips were laid out.",
           ("stacked", "side_by_side"), may_be_unknown=True),
    Column("chosen_position", "choice", "Position of the clip that was chosen.", _POSITIONS),
    Column("chosen_method", "text", "Method of the clip that was chosen."),
    Column("response_time_ms", "milliseconds", "From the first paint of the trial to the answer.",
           may_be_unknown=True),
    Column("decision_time_ms", "milliseconds", "From the moment choosing is allowed to the answer.",
           may_be_unknown=True),
    Column("plays_first", "count", "How often the first clip was started.", may_be_unknown=True),
    Column("plays_second", "count", "How often the second clip was started.", may_be_unknown=True),
    Column("viewed_first", "choice", "Was the first clip seen in full?", _EVIDENCE),
    Column("viewed_second", "choice", "Was the second clip seen in full?", _EVIDENCE),
    Column("started_at", "time", "When the trial was first shown, ISO 8601 in UTC.",
           may_be_unknown=True),
    Column("answered_at", "time", "When the server stored the answer, ISO 8601 in UTC.",
           may_be_unknown=True),
    Column("late", "flag", "true if the answer came after its lease had expired.",
           ("true", "false"), may_be_unknown=True),
)  # fmt: skip

COLUMN_NAMES: tuple[str, ...] = tuple(column.name for column in COLUMNS)

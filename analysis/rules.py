"""Exclusion rules of a study, declared once: `[exclusions]` of `study.toml` and of `codebook.json`.

The study app validates by this table and the analysis applies it. Standard library only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from renderer.files import InputError, value_sha256

Rules = dict[str, float]
"""Rule name -> threshold; flags are stored as 1.0 (on). A rule that is absent does nothing."""


@dataclass(frozen=True)
class Rule:
    """One rule: what it removes, what its threshold means, and which thresholds make sense."""

    name: str
    removes: Literal["participant", "answer"]
    prose: str
    low: float
    high: float
    default: float


RULES: tuple[Rule, ...] = (
    Rule("max_catch_failures", "participant",
         "Participants who failed more catch trials than this.", 0, 1000, 1),
    Rule("min_median_response_s", "participant",
         "Participants whose median response time over main trials is below this many seconds.",
         0, 600, 2),
    Rule("max_same_side_share", "participant",
         "Participants who chose one position in at least this share of their main trials.",
         0.5, 1, 0.95),
    Rule("max_same_side_run", "participant",
         "Participants who chose one position at least this many times in a row.", 2, 1000, 20),
    Rule("min_answered_share", "participant",
         "Participants who answered less than this share of the main trials of a full session.",
         0, 1, 0.5),
    Rule("min_repeat_agreement", "participant",
         "Participants whose repeated trials agree with their first answers less often than this.",
         0, 1, 0.5),
    Rule("drop_late", "answer", "Answers that came after their lease had expired.", 0, 1, 1),
    Rule("drop_unviewed", "answer",
         "Answers for which a clip was not proven to be seen in full (`unknown` is kept).", 0, 1, 1),
)  # fmt: skip

RULE_NAMES: tuple[str, ...] = tuple(rule.name for rule in RULES)
_MANUFACTURING = ("majority", "consensus", "outlier", "agreement_with")


def parse_rules(source: object, declared: Mapping[str, Any]) -> Rules:
    """Check a table of exclusion rules; raises `InputError` on an unknown name or a senseless threshold.

    A rule that removes people for disagreeing with the others is refused by name: it manufactures
    the agreement that the study then reports.
    """
    return {name: _threshold(source, name, declared[name]) for name in sorted(declared)}


def rules_sha256(rules: Rules) -> str:
    """Hash of the rules in canonical form; the same in study, codebook and results."""
    return value_sha256({name: float(value) for name, value in rules.items()})


def _threshold(source: object, name: str, value: Any) -> float:
    field = f"exclusions.{name}"
    if any(word in name for word in _MANUFACTURING):
        raise InputError(source, field, value, "no exclusion by agreement with other participants")
    if name not in RULE_NAMES:
        raise InputError(source, field, value, f"one of the rules {', '.join(RULE_NAMES)}")
    rule = RULES[RULE_NAMES.index(name)]
    on_off = isinstance(value, bool) and rule.removes == "participant"
    if on_off or not isinstance(value, (int, float)) or not rule.low <= value <= rule.high:
        raise InputError(source, field, value, f"a number from {rule.low:g} to {rule.high:g}")
    return float(value)

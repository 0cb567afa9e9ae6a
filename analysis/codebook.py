"""The `codebook.json` beside `responses.csv`: is the study closed, and which exclusion rules hold?"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from analysis.columns import SCHEMA_VERSION
from analysis.rules import Rules, parse_rules, rules_sha256
from renderer.files import InputError, read_json

_FIELDS = frozenset({
    "schema_version", "study_id", "study_version", "study_state", "title", "question", "target",
    "baselines", "pairs", "policy", "catalogue_sha256", "main_trials", "answers_by_mode", "withdrawn",
    "exclusions", "exclusions_sha256", "exclusions_changed_at", "collection_began_at", "closed_at",
    "columns",
})  # fmt: skip


@dataclass(frozen=True)
class Codebook:
    """What the export says of the data as a whole."""

    present: bool
    frozen: bool
    """The study is closed; without a codebook the data count as unfrozen."""
    rules: Rules
    rules_sha256: str
    rules_origin: str
    """`declared`, `none` (no rules known) or `post hoc` (changed after collection began)."""
    main_trials: int | None = None
    """Main trials of a full session, where the study states it."""
    unknown_fields: tuple[str, ...] = ()
    """Fields that no version of the format knows: a misspelt rule table must not pass in silence."""


def read_codebook(responses: Path) -> Codebook:
    """Read `codebook.json` beside `responses`; refuses an unknown schema version, state or rule."""
    path = responses.parent / "codebook.json"
    if not path.is_file():
        return Codebook(False, False, {}, rules_sha256({}), "none")
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(path, "content", type(content).__name__, "a JSON object")
    version, state = content.get("schema_version"), content.get("study_state")
    if version != SCHEMA_VERSION:
        raise InputError(path, "schema_version", version, str(SCHEMA_VERSION))
    if state not in ("open", "closed", "draft"):
        raise InputError(path, "study_state", state, "open or closed")
    rules, origin = _rules(path, content)
    trials = content.get("main_trials")
    if trials is not None and (not isinstance(trials, int) or trials < 1):
        raise InputError(path, "main_trials", trials, "a whole number from 1")
    unknown = tuple(sorted(content.keys() - _FIELDS))
    return Codebook(True, state == "closed", rules, rules_sha256(rules), origin, trials, unknown)


def _rules(path: Path, content: dict[str, Any]) -> tuple[Rules, str]:
    declared = content.get("exclusions")
    if declared is None:
        return {}, "none"
    if not isinstance(declared, dict):
        raise InputError(path, "exclusions", declared, "an object of rules")
    rules = parse_rules(path, declared)
    stated = content.get("exclusions_sha256")
    if stated is not None and stated != rules_sha256(rules):
        raise InputError(
            path, "exclusions_sha256", stated, f"the rules' hash {rules_sha256(rules)}"
        )
    changed, began = (_moment(path, content, f"{what}_at")
                      for what in ("exclusions_changed", "collection_began"))  # fmt: skip
    late = changed is not None and began is not None and changed > began
    return rules, "post hoc" if late else "declared"


def _moment(path: Path, content: dict[str, Any], field: str) -> datetime | None:
    value = content.get(field)
    if value is None:
        return None
    try:
        moment = datetime.fromisoformat(value)
    except (TypeError, ValueError):
        raise InputError(path, field, value, "an ISO 8601 time") from None
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)

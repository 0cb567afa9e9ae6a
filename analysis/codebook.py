"""The `codebook.json` beside `responses.csv`: is the study closed, and which exclusion rules hold?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.columns import SCHEMA_VERSION
from analysis.rules import Rules, parse_rules, rules_sha256
from renderer.files import InputError, read_json


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
    return Codebook(True, state == "closed", rules, rules_sha256(rules), origin, trials)


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
    changed, began = content.get("exclusions_changed_at"), content.get("collection_began_at")
    late = isinstance(changed, str) and isinstance(began, str) and changed > began
    return rules, "post hoc" if late else "declared"

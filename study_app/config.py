"""`study.toml`: what a study asks, of which clips, how often, under which rules."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from analysis.rules import parse_rules
from renderer.files import InputError
from study_app.texts import TEXTS

SCHEMA_VERSION = 1
Identifier = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
Count = Annotated[int, Field(ge=0, le=100)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class ExtraTrials(_Strict):
    """Trials beside the main ones, per participant."""

    catch: Count = 0
    """A sound placement against the same body lifted; who misses these did not look."""
    identical: Count = 0
    """The same clip twice: shows a side bias, never a reason to exclude."""
    repeat: Count = 0
    """A main pair again, sides flipped, at least 15 trials later: test-retest reliability."""
    practice: Count = 0
    """Before the main part, with feedback."""


class Checks(_Strict):
    """What is asked of the participant's screen and attention, and the optional pages."""

    min_window_width: int = Field(default=320, ge=0, le=4000)
    min_window_height: int = Field(default=400, ge=0, le=4000)
    min_kbit_s: int = Field(default=0, ge=0, le=100_000)
    """Speed of the line; 0 = measured and kept, nobody turned away."""
    comprehension: bool = False
    """One question about the task before the first trial."""
    break_every: int = Field(default=20, ge=0, le=1000)
    demographics: bool = False
    comments: bool = True


class Completion(_Strict):
    """What a participant gets at the end: a fixed code (empty = one per person), a link back."""

    code: str = Field(default="", max_length=64)
    url: str = Field(default="", max_length=500, pattern=r"^(https?://.*)?$")


class StudyConfig(_Strict):
    """A study, as its file says it."""

    schema_version: Literal[1] = 1
    study_id: Identifier
    title: str = Field(min_length=1, max_length=200)
    question: str = Field(min_length=1, max_length=500)
    target: Identifier
    baselines: tuple[Identifier, ...] = Field(min_length=1)
    pairs: Literal["target", "all"] = "target"
    scenes: tuple[Identifier, ...] = ()
    """Empty = every scene of the catalogue that has main clips."""
    trials_per_cell: int = Field(ge=1, le=200)
    policy: Literal["balanced", "random", "list"] = "balanced"
    lists: str = ""
    """Policy `list`: JSON file with the prepared sessions, beside the study file."""
    layout: Literal["auto", "stacked", "side_by_side"] = "auto"
    seed: int = Field(default=0, ge=0, lt=2**31)
    repeat_scene_motion: bool = False
    """May a participant meet one (scene, motion) in several main trials?"""
    extra_trials: ExtraTrials = ExtraTrials()
    texts: dict[str, str] = {}
    checks: Checks = Checks()
    exclusions: dict[str, bool | int | float] = {}
    """Rules of `analysis.rules`, fixed before the study opens."""
    completion: Completion = Completion()

    @field_validator("baselines", "scenes", mode="before")
    @classmethod
    def _tuple_from_toml(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value


def read_study(path: Path) -> StudyConfig:
    """Read and validate a study file. Raises `InputError` with one line naming field and value."""
    try:
        record = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(path, "file", "missing", "an existing study file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(path, "content", str(error), "valid TOML") from None
    return parse_study(record, path)


def parse_study(record: dict[str, Any], source: object) -> StudyConfig:
    """Validate a study given as a dictionary; `source` names it in errors."""
    if record.get("schema_version", SCHEMA_VERSION) != SCHEMA_VERSION:
        version = record["schema_version"]
        raise InputError(source, "schema_version", version, f"the number {SCHEMA_VERSION}")
    try:
        config = StudyConfig.model_validate(record)
    except ValidationError as error:
        raise _one_line(error, source) from None
    _check_methods(config, source)
    parse_rules(source, config.exclusions)
    for key in config.texts:
        if key not in TEXTS:
            raise InputError(source, f"texts.{key}", config.texts[key], _nearest(key, list(TEXTS)))
    return config


def _check_methods(config: StudyConfig, source: object) -> None:
    methods = [config.target, *config.baselines]
    for index, method in enumerate(methods):
        if method in methods[:index]:
            raise InputError(
                source, "baselines", method, "each method once, the target not among them"
            )
    for index, scene in enumerate(config.scenes):
        if scene in config.scenes[:index]:
            raise InputError(source, "scenes", scene, "each scene once")
    if (config.policy == "list") != bool(config.lists):
        raise InputError(
            source, "lists", config.lists, 'a file name with policy = "list", else nothing'
        )


def _one_line(error: ValidationError, source: object) -> InputError:
    """The first fault, a misspelt key before a missing one (it usually is the cause)."""
    faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    fault = faults[0]
    where = ".".join(str(part) for part in fault["loc"])
    if fault["type"] == "extra_forbidden":
        known = _keys_at(StudyConfig, fault["loc"][:-1])
        return InputError(source, where, fault["input"], _nearest(str(fault["loc"][-1]), known))
    if fault["type"] == "missing":
        return InputError(source, where, "nothing", "this key")
    wanted = fault["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
    return InputError(source, where, fault["input"], wanted)


def _keys_at(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    for part in path:
        annotation = model.model_fields[str(part)].annotation
        assert isinstance(annotation, type) and issubclass(annotation, BaseModel)
        model = annotation
    return list(model.model_fields)


def _nearest(key: str, known: list[str]) -> str:
    close = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    if close:
        return f"a known key; the nearest is {close[0]!r}"
    return "a known key: " + ", ".join(known[:20])

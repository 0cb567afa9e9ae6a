"""StimulusSetConfig: the file that says what a stimulus set consists of."""

from __future__ import annotations

import dataclasses
import difflib
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from renderer.files import InputError, value_sha256

CONFIGS = Path(__file__).resolve().parent / "configs"


@dataclass(frozen=True)
class PlacementConfig:
    """How methods are run."""

    preset: str = "default"
    """Name of a `PlacementSettings` preset: fast, default, paper or posa."""
    full_preset: str = "default"
    """`evaluate` also places some motions with this fuller preset, see `full_motions`."""
    full_motions: int = 0
    """How many motions a room, the first ones, are placed with `full_preset` too."""


@dataclass(frozen=True)
class RenderConfig:
    """How clips are drawn."""

    preset: str = "540p"
    """Name of a `RenderSettings` preset."""
    tiling: str = "grid"
    """How the four views share a clip: grid (2x2), strip (1x4) or single."""
    fps: int = 30
    """Frames per second of the clips."""
    min_visible: float = 0.2
    """A (scene, motion) whose worst view shows less of the body than this is dropped as a whole."""


@dataclass(frozen=True)
class ExtrasConfig:
    """Clips beside the main pool: catch pairs and practice pairs."""

    catch: int = 1
    """Number of catch pairs: a real placement against the same body lifted off the floor."""
    practice: int = 1
    """Number of practice pairs, made from `practice_motion`."""
    practice_motion: str = "stand_idle_look"
    """A motion outside the main pool."""
    seconds: float = 4.0
    """Length of these clips."""
    lift_m: float = 0.6
    """How far the body of the faulty clip is lifted."""


@dataclass(frozen=True)
class StimulusSetConfig:
    """Everything that decides what a stimulus set contains; equal configs give equal sets."""

    set_id: str
    seed: int
    scenes: tuple[str, ...]
    methods: tuple[str, ...]
    study_methods: tuple[str, ...]
    motions: tuple[str, ...] = ()
    """Ids of default motions."""
    motions_dir: str = ""
    """Instead of `motions`: a folder of motion `.npz` files, relative to the config file."""
    motions_wanted: int = 0
    """How many motions of `motions_dir` to use, drawn by the seed; 0 means all. With fewer in the
    folder, all are used and the build says how many there were."""
    body: str = "male_slim"
    """Which embedded adult acts."""
    cut_seconds: float = 0.0
    """Cut every motion to this length around its interaction; 0 keeps it whole."""
    other_methods_motions: int = 0
    """Place methods that are not study methods for this many motions a room; 0 means all."""
    placement: PlacementConfig = field(default_factory=PlacementConfig)
    render: RenderConfig = field(default_factory=RenderConfig)
    extras: ExtrasConfig = field(default_factory=ExtrasConfig)

    def sha256(self) -> str:
        """Hash of every value, for provenance."""
        return value_sha256(dataclasses.asdict(self))


def read_config(source: Path) -> StimulusSetConfig:
    """Read and validate a stimulus-set file. Raises `InputError` naming file, key and value."""
    try:
        record = tomllib.loads(source.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(source, "file", "missing", "an existing TOML file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(source, "content", str(error), "valid TOML") from None
    config: StimulusSetConfig = _build(source, StimulusSetConfig, record, "")
    _validate(source, config)
    if config.motions_dir:
        folder = (source.parent / config.motions_dir).resolve()
        config = dataclasses.replace(config, motions_dir=str(folder))
    return config


def _build(source: Path, kind: type[Any], record: dict[str, Any], where: str) -> Any:
    fields = {item.name: item for item in dataclasses.fields(kind)}
    values: dict[str, Any] = {}
    for name, value in record.items():
        if name not in fields:
            near = difflib.get_close_matches(name, fields, n=1)
            hint = f"did you mean {near[0]}?" if near else "one of " + ", ".join(fields)
            raise InputError(source, f"{where}{name}", value, f"a known key ({hint})")
        values[name] = _value(source, f"{where}{name}", str(fields[name].type), value)
    for name, item in fields.items():
        required = (
            item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING
        )
        if required and name not in values:
            raise InputError(source, f"{where}{name}", "nothing", f"a value ({item.type})")
    return kind(**values)


_SECTIONS = {
    "PlacementConfig": PlacementConfig,
    "RenderConfig": RenderConfig,
    "ExtrasConfig": ExtrasConfig,
}


def _value(source: Path, where: str, kind: str, value: Any) -> Any:
    if kind in _SECTIONS:
        if not isinstance(value, dict):
            raise InputError(source, where, value, "a table")
        return _build(source, _SECTIONS[kind], value, f"{where}.")
    if kind == "tuple[str, ...]":
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise InputError(source, where, value, "a list of names")
        return tuple(value)
    if kind == "float" and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    wanted = {"int": int, "str": str}.get(kind, float)
    if not isinstance(value, wanted) or isinstance(value, bool):
        raise InputError(source, where, value, f"a value of type {kind}")
    return value


def _validate(source: Path, config: StimulusSetConfig) -> None:
    for name in ("scenes", "methods", "study_methods"):
        if not getattr(config, name):
            raise InputError(source, name, [], "at least one name")
    for name in ("scenes", "methods", "study_methods", "motions"):
        names = getattr(config, name)
        for item in names:
            if names.count(item) > 1:
                raise InputError(source, name, item, "every name once")
    if bool(config.motions) == bool(config.motions_dir):
        raise InputError(source, "motions", list(config.motions), "either motions or motions_dir")
    for method in config.study_methods:
        if method not in config.methods:
            raise InputError(source, "study_methods", method, "names that stand in methods")
    positive = {"render.fps": config.render.fps, "extras.seconds": config.extras.seconds}
    for name, number in positive.items():
        if number <= 0:
            raise InputError(source, name, number, "a positive number")
    for name, number in {
        "cut_seconds": config.cut_seconds,
        "motions_wanted": config.motions_wanted,
        "other_methods_motions": config.other_methods_motions,
        "placement.full_motions": config.placement.full_motions,
        "extras.catch": config.extras.catch,
        "extras.practice": config.extras.practice,
    }.items():
        if number < 0:
            raise InputError(source, name, number, "zero or more")
    if config.motions_wanted and not config.motions_dir:
        raise InputError(source, "motions_wanted", config.motions_wanted, "0 without motions_dir")
    _validate_extras(source, config)


def _validate_extras(source: Path, config: StimulusSetConfig) -> None:
    # A second pair of the same room and motion would be the same two clips again.
    if config.extras.practice > len(config.scenes):
        raise InputError(source, "extras.practice", config.extras.practice, "at most one a scene")
    pool = len(config.scenes) * len(config.motions)
    if config.motions and config.extras.catch > pool:
        wanted = f"at most one for each of the {pool} (scene, motion) pairs"
        raise InputError(source, "extras.catch", config.extras.catch, wanted)

"""The catalogue: what the offline stage hands to the study (standard library only).

`catalogue.json` lists every clip of a stimulus set with its scores and provenance. It is written
atomically and *last*, so its presence means that the set is complete. Field names in the JSON equal
the attribute names here; `docs/reference/catalogue.md` explains each one.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from renderer.files import InputError, file_sha256, read_json, write_json

SCHEMA_VERSION = 1
FILE_NAME = "catalogue.json"
Role = Literal["main", "catch", "practice"]
ROLES: tuple[str, ...] = get_args(Role)


@dataclass(frozen=True)
class Clip:
    """One video that a participant may see. `clip_id` is a content hash and tells no method."""

    clip_id: str
    file: str
    sha256: str
    frames_sha256: str
    poster: str
    role: Role
    method: str
    scene: str
    motion: str
    views: tuple[str, ...]
    tiling: str
    fps: float
    n_frames: int
    duration_s: float
    width: int
    height: int
    codec: str
    scores: dict[str, float]
    placement: str


@dataclass(frozen=True)
class Catalogue:
    """A stimulus set: its clips and where they come from."""

    set_id: str
    created_at: str
    generator: dict[str, Any]
    scenes: tuple[dict[str, Any], ...]
    motions: tuple[dict[str, Any], ...]
    methods: tuple[dict[str, Any], ...]
    cameras: tuple[dict[str, Any], ...]
    clips: tuple[Clip, ...]
    dropped: tuple[dict[str, Any], ...] = ()
    schema_version: int = SCHEMA_VERSION

    def main_clips(self) -> tuple[Clip, ...]:
        """The clips that main trials draw from."""
        return tuple(clip for clip in self.clips if clip.role == "main")


def write_catalogue(catalogue: Catalogue, folder: Path) -> Path:
    """Write `folder/catalogue.json` atomically, clips sorted by id; return its path."""
    record = dataclasses.asdict(catalogue)
    record["clips"] = sorted(record["clips"], key=lambda clip: str(clip["clip_id"]))
    target = folder / FILE_NAME
    write_json(target, record)
    return target


def read_catalogue(path: Path) -> Catalogue:
    """Read and validate a catalogue; `path` is the JSON file or the folder that holds it.

    Raises `InputError` naming file, field and value. Files of the clips are not opened here:
    `verify_catalogue` does that.
    """
    source = path / FILE_NAME if path.is_dir() else path
    record = read_json(source)
    if not isinstance(record, dict):
        raise InputError(source, "content", type(record).__name__, "a JSON object")
    if record.get("schema_version") != SCHEMA_VERSION:
        raise InputError(
            source, "schema_version", record.get("schema_version"), f"the number {SCHEMA_VERSION}"
        )
    raw_clips = _field(source, record, "clips", list)
    clips = tuple(_read_clip(source, index, raw) for index, raw in enumerate(raw_clips))
    _require_unique(source, [clip.clip_id for clip in clips])
    return Catalogue(
        set_id=_field(source, record, "set_id", str),
        created_at=_field(source, record, "created_at", str),
        generator=_field(source, record, "generator", dict),
        scenes=tuple(_field(source, record, "scenes", list)),
        motions=tuple(_field(source, record, "motions", list)),
        methods=tuple(_field(source, record, "methods", list)),
        cameras=tuple(_field(source, record, "cameras", list)),
        clips=clips,
        dropped=tuple(_field(source, record, "dropped", list)),
    )


def verify_catalogue(path: Path) -> list[str]:
    """Recompute the hash of every clip and look for its poster; one line per fault, empty if sound."""
    catalogue = read_catalogue(path)
    folder = path if path.is_dir() else path.parent
    faults: list[str] = []
    for clip in catalogue.clips:
        video, poster = folder / clip.file, folder / clip.poster
        if not video.is_file():
            faults.append(f"{video}: clip {clip.clip_id}: file is missing")
        elif file_sha256(video) != clip.sha256:
            faults.append(f"{video}: clip {clip.clip_id}: content differs from its sha256")
        if not poster.is_file():
            faults.append(f"{poster}: clip {clip.clip_id}: poster is missing")
    return faults


_CLIP_TYPES: dict[str, type | tuple[type, ...]] = {
    "clip_id": str, "file": str, "sha256": str, "frames_sha256": str, "poster": str, "role": str,
    "method": str, "scene": str, "motion": str, "views": list, "tiling": str, "fps": (int, float),
    "n_frames": int, "duration_s": (int, float), "width": int, "height": int, "codec": str,
    "scores": dict, "placement": str,
}  # fmt: skip


def _read_clip(source: Path, index: int, raw: Any) -> Clip:
    where = f"clips[{index}]"
    if not isinstance(raw, dict):
        raise InputError(source, where, raw, "a JSON object")
    for name in sorted(raw.keys() - _CLIP_TYPES.keys()):
        raise InputError(source, f"{where}.{name}", raw[name], "no field of this name")
    values = {name: _field(source, raw, name, kind, where) for name, kind in _CLIP_TYPES.items()}
    if values["role"] not in ROLES:
        raise InputError(source, f"{where}.role", values["role"], "one of " + ", ".join(ROLES))
    for name in ("file", "poster"):
        relative = Path(values[name])
        if relative.is_absolute() or ".." in relative.parts:
            raise InputError(source, f"{where}.{name}", values[name], "a path inside the set")
    values["views"] = tuple(values["views"])
    return Clip(**values)


def _field(
    source: Path, record: dict[str, Any], name: str, kind: type | tuple[type, ...], where: str = ""
) -> Any:
    label = f"{where}.{name}" if where else name
    if name not in record:
        raise InputError(source, label, "nothing", "this field")
    value = record[name]
    if not isinstance(value, kind) or isinstance(value, bool):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        raise InputError(source, label, value, " or ".join(k.__name__ for k in kinds))
    return value


def _require_unique(source: Path, clip_ids: list[str]) -> None:
    seen: set[str] = set()
    for clip_id in clip_ids:
        if clip_id in seen:
            raise InputError(source, "clips.clip_id", clip_id, "a value that occurs once")
        seen.add(clip_id)

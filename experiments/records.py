"""The folder of a stimulus set: which record lies where, and what is already done.

catalogue.json            written last
config.json               the configuration that owns the folder
evaluation.json           scores of every placement, study methods or not
placements/S__M__X.npz    placed motion, .json beside it
records/S__M__X.json      scores or the reason why there is no placement
records/clips/*.json      what was rendered, by (scene, motion, role)
clips/<clip_id>.mp4|.jpg  what participants see
"""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.config import StimulusSetConfig
from renderer.files import InputError, read_json, write_json

Key = tuple[str, str]
"""(scene, motion)."""


@dataclass(frozen=True)
class SetFolder:
    """Paths and records of one stimulus set."""

    path: Path

    def claim(self, config: StimulusSetConfig) -> None:
        """Make the folder this configuration's own; refuse one that belongs to another."""
        record, marker = dataclasses.asdict(config), self.path / "config.json"
        if marker.exists():
            found = read_json(marker)
            if found.get("sha256") != config.sha256():
                wanted = "an empty folder, or the one this configuration began"
                raise InputError(self.path, "config.json", f"set {found.get('set_id')}", wanted)
            return
        write_json(marker, {**record, "sha256": config.sha256()})

    def sweep(self) -> None:
        """Remove what a killed run left half-made."""
        for leftover in self.path.glob("clips/.partial-*"):
            shutil.rmtree(leftover, ignore_errors=True)

    def motion_ids(self, config: StimulusSetConfig) -> tuple[str, ...]:
        """The motions of the main pool, in order."""
        if not config.motions_dir:
            return config.motions
        found = sorted(item.stem for item in Path(config.motions_dir).glob("*.npz"))
        if not found:
            raise InputError(config.motions_dir, "motions_dir", "no .npz files", "motion files")
        if 0 < config.motions_wanted < len(found):
            # Drawn, because the names of capture data go by subject.
            rng = np.random.default_rng(config.seed)
            drawn = rng.choice(len(found), size=config.motions_wanted, replace=False)
            found = [found[index] for index in sorted(drawn)]
        return tuple(found)

    def placement_stem(self, scene: str, motion_id: str, method: str) -> Path:
        """Where a placement's two files lie, without suffix."""
        return self.path / "placements" / f"{_safe(scene)}__{motion_id}__{method}"

    def record_path(self, scene: str, motion_id: str, method: str) -> Path:
        """Where the scores of a placement lie."""
        return self.path / "records" / f"{_safe(scene)}__{motion_id}__{method}.json"

    def clip_record_path(self, scene: str, motion_id: str, role: str) -> Path:
        """Where the list of rendered clips of a (scene, motion) lies."""
        return self.path / "records" / "clips" / f"{role}__{_safe(scene)}__{motion_id}.json"

    def placement_records(self) -> list[dict[str, Any]]:
        """All placement records, in the order of their names."""
        return list(_records(self.path / "records"))

    def clip_records(self) -> list[dict[str, Any]]:
        """All clip records, in the order of their names."""
        return list(_records(self.path / "records" / "clips"))

    def drops(self) -> dict[Key, dict[str, Any]]:
        """(scene, motion) pairs that some study method could not place, with the reason.

        Kept or dropped for all study methods together: dropping single clips would flatter a method.
        """
        return {
            (record["scene"], record["motion"]): {
                "scene": record["scene"],
                "motion": record["motion"],
                "method": record["method"],
                "reason": record["failure"],
            }
            for record in self.placement_records()
            if record["failure"] and record["study_method"]
        }


def _records(folder: Path) -> Iterator[dict[str, Any]]:
    for path in sorted(folder.glob("*.json")):
        record = read_json(path)
        if not isinstance(record, dict):
            raise InputError(path, "content", type(record).__name__, "a JSON object")
        yield record


def _safe(scene: str) -> str:
    return Path(scene).name

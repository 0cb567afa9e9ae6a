"""The training data of the interaction model: bodies with the distance and class of what is near."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float16, Integer, UInt8

from renderer.files import InputError, atomic_path

SCHEMA_VERSION = 1
RECIPE_VERSION = 3
"""Raised with every change of the recipe that changes the numbers."""
DISTANCE_CAP_M = 0.5
FPS = 30.0
"""Frame rate that `ContactDataset.frame` counts in."""

Progress = Callable[[int, int], None]
"""(done, total) after every clip."""


@dataclass(frozen=True)
class ClipRecord:
    """One clip of the data set, with the scene that was built for it (or the room it stands in)."""

    name: str
    kind: str
    """`captured` or `authored`."""
    split: str
    """`train` or `test`; captured performances, authored recipes' seeds and furniture seeds are split."""
    body: str
    seed: int
    """Seed of the scene."""
    family: str
    """What it does, e.g. `walk`, `sit_thighs`."""


@dataclass(frozen=True)
class ContactDataset:
    """N bodies on the feature vertices. Axes: N bodies, V vertices; clip by clip, in order of time."""

    vertex_ids: Integer[np.ndarray, " V"]
    """Full numbering of the body, as `experiments.interaction.mesh.feature_vertices` gives it."""
    vertices: Float16[np.ndarray, "N V 3"]
    """Canonical frame (`canonical_frames`), metres."""
    height: Float16[np.ndarray, "N V"]
    """Above the clip's floor (`height_above_floor`), metres."""
    distance: Float16[np.ndarray, "N V"]
    """To the nearest surface, metres, unsigned, at most `DISTANCE_CAP_M`."""
    nearest: UInt8[np.ndarray, "N V"]
    """mpcat40 class of that surface."""
    clip: Integer[np.ndarray, " N"]
    """Index into `clips`."""
    frame: Integer[np.ndarray, " N"]
    """Frame number within the clip, at `FPS`; training clips are strided, test clips are not."""
    clips: tuple[ClipRecord, ...]

    def labels(
        self, thickness_m: float
    ) -> tuple[Bool[np.ndarray, "N V"], UInt8[np.ndarray, "N V"]]:
        """POSA's labels: contact where something is nearer than `thickness_m`, and its class, else 0."""
        contact = self.distance < np.float16(thickness_m)
        return contact, np.where(contact, self.nearest, np.uint8(0))

    def select(self, keep: Bool[np.ndarray, " N"]) -> ContactDataset:
        """Only the bodies marked; the list of clips stays whole."""
        arrays = ("vertices", "height", "distance", "nearest", "clip", "frame")
        return replace(self, **{name: getattr(self, name)[keep] for name in arrays})

    def bodies_of(self, **wanted: str) -> Bool[np.ndarray, " N"]:
        """Mask of the bodies whose clip has these fields, e.g. `split="test", kind="captured"`."""
        match = [all(getattr(clip, k) == v for k, v in wanted.items()) for clip in self.clips]
        return np.asarray(np.array(match, dtype=bool)[self.clip])

    def save(self, target: Path) -> None:
        """Write as `.npz`, whole or not at all."""
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        clips = json.dumps([asdict(clip) for clip in self.clips])
        with atomic_path(target) as temporary:
            np.savez(temporary, schema_version=SCHEMA_VERSION, clips=clips, **arrays)

    @staticmethod
    def load(source: Path) -> ContactDataset:
        """Read what `save` wrote. Raises `InputError` on anything else."""
        record = _read(source)
        version = int(record["schema_version"]) if "schema_version" in record else None
        if version != SCHEMA_VERSION:
            raise InputError(source, "schema_version", version, f"the number {SCHEMA_VERSION}")
        for name in (*_ARRAYS, "clips"):
            if name not in record:
                raise InputError(source, name, "nothing", "this array")
        clips = tuple(ClipRecord(**entry) for entry in json.loads(str(record["clips"])))
        return ContactDataset(clips=clips, **{name: record[name] for name in _ARRAYS})


_ARRAYS = tuple(entry.name for entry in fields(ContactDataset) if entry.name != "clips")


def _read(source: Path) -> dict[str, Any]:
    try:
        with source.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except FileNotFoundError:
        raise InputError(source, "file", "missing", "a data set made by this program") from None
    except Exception as error:
        # numpy raises zipfile, EOF, Value and OS errors for damaged archives: all are bad input
        raise InputError(source, "content", str(error), "a readable .npz archive") from None

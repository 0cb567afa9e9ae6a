"""Placement: a method's answer, where and how a motion goes into a scene."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from experiments.motion.motion import Motion, read_motion, write_motion
from renderer.files import InputError, read_json, write_json

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Placement:
    """A motion placed in a scene.

    `motion` is already in the scene's frame: the rigid part (`yaw` about the clip's horizontal
    centre, then `translation`) and the alteration (if `altered`) are applied to it, so whoever
    renders or scores a placement needs the motion alone. `translation` and `yaw` are kept for
    tables and tests.
    """

    scene: str
    motion_id: str
    method: str
    translation: Float[np.ndarray, "3"]
    yaw: float
    motion: Motion
    altered: bool
    weights: Float[np.ndarray, " T"]
    """The frame weights k the method used."""
    terms: dict[str, float]
    """Final loss by term name; "total" is their weighted sum."""
    seed: int
    config_hash: str
    info: dict[str, Any] = field(default_factory=dict)
    """Evaluations, iterations, CPU seconds, start, share of frames with contact, ..."""


def write_placement(placement: Placement, stem: Path) -> tuple[Path, Path]:
    """Write `stem.npz` (the placed motion) and `stem.json` (all the rest); return both paths."""
    archive, record_path = stem.with_suffix(".npz"), stem.with_suffix(".json")
    write_motion(placement.motion, archive)
    record = {
        item.name: getattr(placement, item.name)
        for item in dataclasses.fields(placement)
        if item.name != "motion"
    }
    record["translation"] = placement.translation.tolist()
    record["weights"] = placement.weights.tolist()
    record["schema_version"] = SCHEMA_VERSION
    write_json(record_path, json.loads(json.dumps(record, default=float)))
    return archive, record_path


def read_placement(stem: Path) -> Placement:
    """Read what `write_placement` wrote; `stem` may carry either suffix."""
    record_path = stem.with_suffix(".json")
    record = read_json(record_path)
    if not isinstance(record, dict) or record.pop("schema_version", None) != SCHEMA_VERSION:
        raise InputError(record_path, "schema_version", "another", f"the number {SCHEMA_VERSION}")
    names = {item.name for item in dataclasses.fields(Placement)} - {"motion"}
    for name in sorted(names ^ record.keys()):
        found = "nothing" if name in names else record[name]
        raise InputError(record_path, name, found, "exactly the fields of a placement")
    record["translation"] = np.asarray(record["translation"], float)
    record["weights"] = np.asarray(record["weights"], float)
    return Placement(motion=read_motion(stem.with_suffix(".npz")), **record)

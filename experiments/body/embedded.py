"""The embedded bodies: four adults in `experiments/assets/body.npz`, read and checked."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from experiments.body.model import BodyModel
from experiments.body.skinned_body import SkinnedBody
from renderer.files import InputError, file_sha256, read_json

BODY_NAMES: tuple[str, ...] = ("female_slim", "male_slim", "female_heavy", "male_heavy")
BODY_FILE = Path(__file__).resolve().parents[1] / "assets" / "body.npz"
SCHEMA_VERSION = 1
POINT_UNIT_M = 2e-5
"""Step of the stored rest points, 0.02 mm: the worst vertex of random poses is then 0.06 mm off."""


@lru_cache(maxsize=8)
def load_body(name: str = "male_slim") -> BodyModel:
    """One of the embedded bodies (`BODY_NAMES`). `InputError` for an unknown name or a damaged file."""
    return read_body(BODY_FILE, name)


def read_body(source: Path, name: str) -> SkinnedBody:
    """Read one body of a file that `experiments/assets/build_body.py` wrote.

    `source` must match the SHA-256 in the JSON file of the same name beside it.
    """
    if name not in BODY_NAMES:
        raise InputError(source, "body", name, "one of " + ", ".join(BODY_NAMES))
    _check_hash(source)
    with np.load(source, allow_pickle=False) as archive:
        arrays = {key: archive[key] for key in archive.files}
    regions = {
        key.removeprefix("region_"): arrays[key].astype(np.int64)
        for key in arrays
        if key.startswith("region_")
    }
    return SkinnedBody(
        name=name,
        faces=arrays["faces"].astype(np.int64),
        body_component=arrays["body_component"].astype(np.int64),
        subset=arrays["subset"].astype(np.int64),
        subset_faces=arrays["subset_faces"].astype(np.int64),
        regions=regions,
        contact_rows=arrays["contact_rows"].astype(np.int64),
        rest_joints=arrays[f"joints_{name}"].astype(np.float64),
        points=_points(arrays, name),
    )


def _check_hash(source: Path) -> None:
    note = source.with_suffix(".json")
    record = read_json(note)
    version = record.get("schema_version") if isinstance(record, dict) else None
    if version != SCHEMA_VERSION:
        raise InputError(note, "schema_version", version, f"the number {SCHEMA_VERSION}")
    if not source.is_file():
        raise InputError(source, "file", "missing", "the body file of the project")
    found, wanted = file_sha256(source), record.get("sha256")
    if found != wanted:
        raise InputError(source, "sha256", found, f"{wanted} (the file was altered or damaged)")


def _points(arrays: dict[str, Any], name: str) -> Float[np.ndarray, "V 22 4"]:
    """Dense (V, 22, 4) table from the stored (vertex, joint) entries; weights are made to sum to one."""
    vertex, joint = arrays["vertex"].astype(np.int64), arrays["joint"].astype(np.int64)
    weight = arrays["weight"].astype(np.float64)
    total = np.bincount(vertex, weight)
    dense = np.zeros((len(total), 22, 4))
    weight = weight / total[vertex]
    heads = arrays[f"joints_{name}"].astype(np.float64)
    dense[vertex, joint, :3] = (
        arrays[f"points_{name}"] * POINT_UNIT_M + weight[:, None] * heads[joint]
    )
    dense[vertex, joint, 3] = weight
    return dense

"""Reader of DeepMimic-style clips, such as those inside the installed package `pybullet`.

A frame is 44 numbers: its duration (s), root position (m) and quaternion (w, x, y, z), then chest, neck,
right hip, knee, ankle, shoulder, elbow and the same on the left; knees and elbows are one angle about
the lateral axis (rad), the rest quaternions. Axes: x forward, y up, z right. Rest: arms hanging down.
Layout and bone lengths after Peng et al., DeepMimic (2018), humanoid3d.
"""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from experiments.motion.capture import Capture, check_rate, fill_unmapped
from experiments.motion.rotations import UPRIGHT, to_axis_angle, to_matrix
from renderer.files import InputError

_TO_REST_AXES = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
_LEG_M = 0.421546 + 0.409870
_N_COLUMNS = 44
_CHAIN: dict[str, tuple[str, int, int]] = {
    # joint: (parent, first column, width)
    "spine3": ("pelvis", 8, 4),
    "head": ("spine3", 12, 4),
    "right_hip": ("pelvis", 16, 4),
    "right_knee": ("right_hip", 20, 1),
    "right_ankle": ("right_knee", 21, 4),
    "right_shoulder": ("spine3", 25, 4),
    "right_elbow": ("right_shoulder", 29, 1),
    "left_hip": ("pelvis", 30, 4),
    "left_knee": ("left_hip", 34, 1),
    "left_ankle": ("left_knee", 35, 4),
    "left_shoulder": ("spine3", 39, 4),
    "left_elbow": ("left_shoulder", 43, 1),
}


def read_deepmimic(path: Path) -> Capture:
    """Read one clip. Raises `InputError` naming the frame and column at fault."""
    frames = _read_frames(path)
    times = _frame_times(path, frames)
    known = {"pelvis": _quaternion(path, frames, 4)}
    for joint, (parent, column, width) in _CHAIN.items():
        local = _hinge(frames[:, column]) if width == 1 else _quaternion(path, frames, column)
        known[joint] = known[parent] @ local
    known |= _spread(known, "pelvis", "spine3", ("spine1", "spine2"))
    known |= _spread(known, "spine3", "head", ("neck",))
    to_world = UPRIGHT @ _TO_REST_AXES
    rotations = {name: to_world @ known[name] @ _TO_REST_AXES.T for name in known}
    down = np.array([0.0, -1.0, 0.0])
    parts = ("hip", "knee", "shoulder", "elbow")
    return Capture(
        rotations=fill_unmapped(rotations),
        hip_centre=frames[:, 1:4] @ to_world.T,
        times=times,
        rest_directions={f"{side}_{part}": down for side in ("left", "right") for part in parts},
        leg_length=_LEG_M,
        label=path.stem.removeprefix("humanoid3d_").replace("_", " "),
        source=f"DeepMimic clip {path.name}",
    )


def pybullet_clip(name: str) -> Path:
    """Path of a clip inside the installed package `pybullet`, found without loading its physics engine."""
    spec = importlib.util.find_spec("pybullet_data")
    if spec is None or spec.origin is None:
        raise InputError("pybullet_data", "package", "not installed", "the package pybullet")
    path = Path(spec.origin).parent / "data" / "motions" / f"{name}.txt"
    if not path.is_file():
        raise InputError("pybullet_data", "motion", name, f"a clip in {path.parent.name}")
    return path


def _read_frames(path: Path) -> Float[np.ndarray, "T 44"]:
    try:
        record: Any = json.loads(path.read_text())
    except FileNotFoundError:
        raise InputError(path, "file", "missing", "an existing clip") from None
    except (OSError, ValueError) as error:
        raise InputError(path, "content", str(error), "the JSON of a DeepMimic clip") from None
    rows = record.get("Frames") if isinstance(record, dict) else None
    if not isinstance(rows, list) or len(rows) < 2:
        raise InputError(path, "Frames", type(rows).__name__, "a list of two or more frames")
    for index, row in enumerate(rows):
        _check_row(path, index, row)
    return np.array(rows, dtype=np.float64)


def _check_row(path: Path, index: int, row: Any) -> None:
    if not isinstance(row, list) or len(row) != _N_COLUMNS:
        size = len(row) if isinstance(row, list) else row
        raise InputError(path, f"Frames[{index}]", size, f"{_N_COLUMNS} numbers (a humanoid)")
    for column, value in enumerate(row):
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise InputError(path, f"Frames[{index}][{column}]", value, "a finite number")


def _frame_times(path: Path, frames: Float[np.ndarray, "T 44"]) -> Float[np.ndarray, " T"]:
    steps = frames[:-1, 0]
    for index, step in enumerate(steps):
        check_rate(path, f"Frames[{index}][0]", 1.0 / step if step > 0 else 0.0)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _quaternion(
    path: Path, frames: Float[np.ndarray, "T 44"], column: int
) -> Float[np.ndarray, "T 3 3"]:
    w_first = frames[:, column : column + 4]
    length = np.linalg.norm(w_first, axis=1)
    if np.abs(length - 1).max() > 0.05:
        worst = int(np.abs(length - 1).argmax())
        field = f"Frames[{worst}][{column}:{column + 4}]"
        raise InputError(path, field, w_first[worst].tolist(), "a unit quaternion")
    return np.asarray(Rotation.from_quat(w_first, scalar_first=True).as_matrix())


def _hinge(angle: Float[np.ndarray, " T"]) -> Float[np.ndarray, "T 3 3"]:
    return to_matrix(np.stack([np.zeros_like(angle), np.zeros_like(angle), angle], axis=1))


def _spread(
    known: dict[str, Float[np.ndarray, "T 3 3"]], low: str, high: str, between: tuple[str, ...]
) -> dict[str, Float[np.ndarray, "T 3 3"]]:
    """Share one joint's bend evenly with the joints between that the recording lacks."""
    arc = to_axis_angle(np.swapaxes(known[low], -1, -2) @ known[high])
    shares = [(index + 1) / (len(between) + 1) for index in range(len(between))]
    return {name: known[low] @ to_matrix(arc * s) for name, s in zip(between, shares, strict=True)}

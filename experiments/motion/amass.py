"""Reader of AMASS archives: SMPL+H (`mocap_framerate`) and SMPL-X "stageii" (`mocap_frame_rate`).

Only the 22 body joints and the translation are taken; hands, jaw, eyes and soft tissue are left.
The actor's leg length is not in such a file (it needs the licensed body model), so none is given.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from experiments.motion.capture import Capture, check_rate
from experiments.motion.rotations import world_rotations
from renderer.files import InputError

_RATE_KEYS = ("mocap_frame_rate", "mocap_framerate")
_LIMIT_M = 100.0
_LIMIT_RAD = 4 * np.pi


def read_amass(path: Path) -> Capture:
    """Read an AMASS `.npz`. Raises `InputError` naming the field and frame at fault."""
    record = _load(path)
    pose = _body_pose(path, record)
    transl = _numbers(path, record, "trans", 3, _LIMIT_M, "metres")
    if len(transl) != len(pose) or len(pose) < 2:
        raise InputError(path, "trans", f"{len(transl)} frames", f"{len(pose)}, two or more")
    rate = _rate(path, record)
    return Capture(
        rotations=world_rotations(pose),
        hip_centre=transl,
        times=np.arange(len(pose)) / rate,
        rest_directions={},
        leg_length=None,
        label=path.stem.replace("_", " "),
        source=f"AMASS {path.name}",
    )


def _load(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files if _is_wanted(name)}
    except FileNotFoundError:
        raise InputError(path, "file", "missing", "an existing AMASS .npz") from None
    except Exception as error:
        # numpy raises zipfile, EOF, Value and OS errors for damaged archives: all are bad input
        raise InputError(path, "content", str(error), "a readable .npz archive") from None


def _is_wanted(name: str) -> bool:
    # Other members (marker labels, gender) may be object arrays, which are never unpickled.
    return name in {"poses", "root_orient", "pose_body", "trans", *_RATE_KEYS}


def _body_pose(path: Path, record: dict[str, Any]) -> Float[np.ndarray, "T 22 3"]:
    if "poses" in record:
        flat = _numbers(path, record, "poses", 66, _LIMIT_RAD, "radians")
    else:
        root = _numbers(path, record, "root_orient", 3, _LIMIT_RAD, "radians")
        body = _numbers(path, record, "pose_body", 63, _LIMIT_RAD, "radians")
        if len(root) != len(body):
            raise InputError(path, "pose_body", f"{len(body)} frames", f"{len(root)} frames")
        flat = np.concatenate([root, body], axis=1)
    return flat.reshape(len(flat), 22, 3)


def _numbers(
    path: Path, record: dict[str, Any], name: str, width: int, limit: float, unit: str
) -> Float[np.ndarray, "T W"]:
    """The first `width` columns of a field, checked for kind, width, finiteness and plausible size."""
    if name not in record:
        raise InputError(path, name, "nothing", "this array (is it an AMASS file?)")
    array = np.asarray(record[name])
    if array.ndim != 2 or array.shape[1] < width or array.dtype.kind not in "fiu":
        shape = f"numbers of shape (T, {width} or more)"
        raise InputError(path, name, f"{array.dtype} {array.shape}", shape)
    array = array[:, :width].astype(np.float64)
    bad = ~(np.abs(array) <= limit)
    if bad.any():
        frame, column = np.argwhere(bad)[0].tolist()
        wanted = f"a finite value within {limit:.4g} ({unit})"
        raise InputError(path, f"{name}[{frame}, {column}]", float(array[frame, column]), wanted)
    return array


def _rate(path: Path, record: dict[str, Any]) -> float:
    for key in _RATE_KEYS:
        if key in record:
            value = np.asarray(record[key])
            if value.size != 1 or value.dtype.kind not in "fiu":
                raise InputError(path, key, str(value), "one number (Hz)")
            check_rate(path, key, float(value.reshape(-1)[0]))
            return float(value.reshape(-1)[0])
    raise InputError(path, _RATE_KEYS[0], "nothing", "the frame rate (Hz) under either spelling")

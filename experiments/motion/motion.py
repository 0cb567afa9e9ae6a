"""Motion: a time series of body parameters, and its `.npz` file with AMASS key names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from renderer.files import InputError, atomic_path

SCHEMA_VERSION = 1
N_JOINTS = 22


@dataclass(frozen=True)
class Motion:
    """A motion of the body. Frame: z up, metres; a standing person at yaw 0 faces -y.

    `pose` holds the 22 SMPL-X body joints as axis-angle vectors in radians relative to their parent,
    the root (pelvis) first and in the world; all zeros is the T-pose of SMPL-X in its own y-up axes,
    so a standing person has root (pi/2, 0, 0). `transl` is the world position of the pelvis joint
    *minus its position in the zero pose* (the SMPL-X convention). `times` are seconds, increasing.
    """

    pose: Float[np.ndarray, "T 22 3"]
    transl: Float[np.ndarray, "T 3"]
    times: Float[np.ndarray, " T"]
    fps: float
    motion_id: str
    label: str
    source: str
    body: str = "male_slim"
    """The embedded body the motion was retargeted to or authored for."""

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(self.times)

    @property
    def duration_s(self) -> float:
        """Playing time: one frame interval longer than the last time stamp."""
        return float(self.times[-1] - self.times[0] + 1.0 / self.fps)


def write_motion(motion: Motion, target: Path) -> None:
    """Write a motion as `.npz` (float32, AMASS key names), whole or not at all."""
    arrays: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "root_orient": motion.pose[:, 0].astype(np.float32),
        "pose_body": motion.pose[:, 1:].reshape(motion.n_frames, 63).astype(np.float32),
        "trans": motion.transl.astype(np.float32),
        "times": motion.times.astype(np.float64),
        "mocap_frame_rate": float(motion.fps),
        "label": motion.label,
        "motion_id": motion.motion_id,
        "source": motion.source,
        "body": motion.body,
    }
    with atomic_path(target) as temporary:
        np.savez_compressed(temporary, **arrays)


def read_motion(source: Path) -> Motion:
    """Read a motion that `write_motion` wrote. Raises `InputError` on anything else."""
    record = _load(source)
    version = record.get("schema_version")
    if version is None or int(version) != SCHEMA_VERSION:
        raise InputError(source, "schema_version", version, f"the number {SCHEMA_VERSION}")
    wanted = {"root_orient": 3, "pose_body": 63, "trans": 3}
    arrays = {name: _matrix(source, record, name, width) for name, width in wanted.items()}
    times = _matrix(source, record, "times", None)
    n_frames = len(times)
    for name, array in arrays.items():
        if len(array) != n_frames:
            raise InputError(source, name, f"{len(array)} frames", f"{n_frames} as in times")
    if n_frames < 2 or np.any(np.diff(times) <= 0):
        raise InputError(source, "times", f"{n_frames} stamps", "two or more, strictly increasing")
    root = arrays["root_orient"][:, None]
    pose = np.concatenate([root, arrays["pose_body"].reshape(n_frames, 21, 3)], axis=1)
    return Motion(
        pose=pose,
        transl=arrays["trans"],
        times=times,
        fps=float(record["mocap_frame_rate"]),
        **{name: str(record[name]) for name in ("motion_id", "label", "source", "body")},
    )


def _load(source: Path) -> dict[str, Any]:
    try:
        # Opened by us: numpy leaks its own handle when the archive is damaged.
        with source.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except FileNotFoundError:
        raise InputError(source, "file", "missing", "an existing motion .npz") from None
    except Exception as error:
        # numpy raises zipfile, EOF, Value and OS errors for damaged archives: all are bad input
        raise InputError(source, "content", str(error), "a readable .npz archive") from None


def _matrix(
    source: Path, record: dict[str, Any], name: str, width: int | None
) -> Float[np.ndarray, "..."]:
    if name not in record:
        raise InputError(source, name, "nothing", "this array")
    array = np.asarray(record[name])
    shape_ok = array.ndim == 1 if width is None else array.ndim == 2 and array.shape[1] == width
    if not shape_ok or array.dtype.kind not in "fiu":
        shape = "(T,)" if width is None else f"(T, {width})"
        raise InputError(source, name, f"{array.dtype} {array.shape}", f"numbers of shape {shape}")
    array = array.astype(np.float64)
    if not np.isfinite(array).all():
        frame = int(np.argwhere(~np.isfinite(array))[0][0])
        raise InputError(source, f"{name}[{frame}]", "not a number", "finite values")
    return array

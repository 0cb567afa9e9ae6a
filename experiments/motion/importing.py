"""Import: any supported motion file onto an embedded body, filtered, at 30 fps, cleaned."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from experiments.motion.amass import read_amass
from experiments.motion.amc import CMU_RATE_HZ, read_amc
from experiments.motion.bvh import read_bvh
from experiments.motion.capture import Capture
from experiments.motion.cleanup import clean_recording
from experiments.motion.deepmimic import read_deepmimic
from experiments.motion.figure import Figure, figure_of
from experiments.motion.motion import Motion, read_motion
from experiments.motion.resample import low_pass, resample
from experiments.motion.retarget import retarget
from renderer.files import InputError

_READERS: dict[str, Callable[[Path], Capture]] = {
    ".bvh": read_bvh,
    ".npz": read_amass,
    ".txt": read_deepmimic,
    ".json": read_deepmimic,
}


def read_motion_file(path: Path, body_name: str = "male_slim", fps: float | None = None) -> Motion:
    """A motion file on an embedded body, ready to be placed: uniform 30 fps, on the floor, feet held.

    By suffix: `.amc` (skeleton `.asf` beside it; `fps` is its frame rate, CMU's 120 if not given),
    `.bvh`, `.npz` (AMASS, or a motion this project wrote for this body, taken as it is) and DeepMimic's
    `.txt` or `.json`. Raises `InputError` naming file, field and value.
    """
    figure = figure_of(body_name)
    if path.suffix.lower() == ".npz" and is_own(path):
        return _own(path, body_name)
    named = dataclasses.replace(adapt(read_capture(path, fps), figure), motion_id=path.stem)
    return clean_recording(named, figure)


def read_capture(path: Path, fps: float | None = None) -> Capture:
    """A recording on its own skeleton, by suffix as in `read_motion_file`. Raises `InputError`."""
    suffix = path.suffix.lower()
    if suffix == ".amc":
        return read_amc(path, fps=CMU_RATE_HZ if fps is None else fps)
    if suffix in _READERS:
        return _READERS[suffix](path)
    known = ", ".join((".amc", *_READERS))
    raise InputError(path, "suffix", path.suffix, f"one of {known}")


def adapt(capture: Capture, figure: Figure) -> Motion:
    """Retarget, remove tremble, resample to 30 fps; the start is moved to the origin. Not yet cleaned."""
    motion = resample(low_pass(retarget(capture, figure)))
    start = motion.transl[0] * np.array([1.0, 1.0, 0.0])
    return dataclasses.replace(motion, transl=motion.transl - start)


def is_own(path: Path) -> bool:
    """Whether this is a motion that this project wrote."""
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return "schema_version" in archive.files
    except Exception:
        # a missing or damaged file: the reader it goes to says so
        return False


def _own(path: Path, body_name: str) -> Motion:
    motion = read_motion(path)
    if motion.body != body_name:
        raise InputError(path, "body", motion.body, f"{body_name}, the body asked for")
    return motion

"""Clips that motion synthesis learns from: recorded files, walks of recorded steps, authored clips."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Bool

from experiments.motion import recipes
from experiments.motion.cleanup import clean_recording
from experiments.motion.figure import Figure, figure_of, surface
from experiments.motion.importing import adapt, is_own, read_capture
from experiments.motion.motion import Motion, read_motion
from experiments.synthesis import authored_clips
from experiments.synthesis.training_rooms import Split
from renderer.files import InputError

Kind = Literal["captured", "composed", "authored"]
Support = Literal["none", "seat", "hands"]

MOTION_SUFFIXES = (".amc", ".bvh", ".npz")
COMPOSED_CAPTURE_S = 0.63 + 1.27 + 3.03
"""Seconds of recording in the composed clips: one step, one turn, one getting up from the floor."""
HELD_OUT_SHARE = 0.2
_FLOOR_BAND_M = (-0.08, 0.12)
"""Where the lowest point of a body may be that stands, walks, sits or hops on the floor."""
_FLOOR_PERCENTILE = 10.0


@dataclass(frozen=True)
class ClipMotion:
    """A clip on one body, and in which frames the floor (or a seat that stands on it) carries it."""

    motion: Motion
    on_floor: Bool[np.ndarray, " T"]


@dataclass(frozen=True)
class TrainingClip:
    """One clip before it is built for a body."""

    name: str
    kind: Kind
    split: Split
    support: Support
    """What the clip wants of a room at its still moments."""
    build: Callable[[Figure], ClipMotion]
    path: Path | None = None


def captured_clips(
    files: Sequence[Path], seconds: Sequence[float], seed: int
) -> tuple[TrainingClip, ...]:
    """One clip a recorded file, a fifth of the usable `seconds` or a little more held out.

    Whole clips are held out in random order; a single usable clip is for training.
    """
    held, wanted = set[int](), HELD_OUT_SHARE * sum(seconds)
    usable = np.flatnonzero(np.asarray(seconds) > 0)
    for index in np.random.default_rng([seed, 1]).permutation(usable).tolist():
        if len(usable) > 1 and sum(seconds[k] for k in held) < wanted:
            held.add(index)
    return tuple(
        TrainingClip(
            path.stem,
            "captured",
            "held_out" if index in held else "train",
            "none",
            partial(recorded_clip, path),
            path,
        )
        for index, path in enumerate(files)
    )


def made_clips(counts: dict[str, int], seed: int) -> tuple[TrainingClip, ...]:
    """Composed walks and authored clips, so many of each of `walk`, `seat`, `bed`, `touch`, `idle`."""
    clips = [
        TrainingClip("floor_get_up", "composed", "train", "none", _all_floor(recipes.floor_get_up))
    ]
    for stream, (name, (maker, kind, support)) in enumerate(_MAKERS.items()):
        rng = np.random.default_rng([seed, 2, stream])
        count = counts.get(name, 0)
        for index, split in enumerate(_splits(count, rng)):
            build = _all_floor(maker(rng))
            clips.append(TrainingClip(f"{name}_{index}", kind, split, support, build))
    return tuple(clips)


def motion_files(folder: Path | None) -> tuple[Path, ...]:
    """Motion files in a folder and below, by name; CMU's recordings under `PACE_SHARED` if None.

    An AMASS folder also holds files that are no motions; they are left out when they are read.
    Raises `InputError` if the folder asked for holds no file of a known suffix.
    """
    chosen = _shared_cmu() if folder is None else folder
    found = sorted(p for p in chosen.rglob("*") if p.suffix.lower() in MOTION_SUFFIXES)
    if folder is not None and not found:
        wanted = "a folder with motion files: " + ", ".join(MOTION_SUFFIXES)
        raise InputError(folder, "motions", "no motion file", wanted)
    return tuple(found)


def recorded_clip(path: Path, figure: Figure) -> ClipMotion:
    """A recording on a body, cleaned. Frames far off the floor (ladders, bars, leaps) are marked."""
    return _recorded(path, figure.body.name)


@lru_cache(maxsize=4096)
def _recorded(path: Path, body_name: str) -> ClipMotion:
    figure = figure_of(body_name)
    if path.suffix.lower() == ".npz" and is_own(path):
        # a motion of this project fits the body it was made for and no other
        own = read_motion(path)
        return ClipMotion(own, np.full(own.n_frames, own.body == body_name))
    raw = adapt(read_capture(path), figure)
    lowest = surface(figure, raw, figure.body.subset[::4])[..., 2].min(axis=1)
    height = lowest - np.percentile(lowest, _FLOOR_PERCENTILE)
    on_floor = (height > _FLOOR_BAND_M[0]) & (height < _FLOOR_BAND_M[1])
    return ClipMotion(clean_recording(replace(raw, motion_id=path.stem), figure), on_floor)


def _all_floor(build: Callable[[Figure], Motion]) -> Callable[[Figure], ClipMotion]:
    def built(figure: Figure) -> ClipMotion:
        motion = build(figure)
        return ClipMotion(motion, np.ones(motion.n_frames, dtype=bool))

    return built


def _splits(count: int, rng: np.random.Generator) -> list[Split]:
    """A random fifth held out; a single clip is for training."""
    n_held = max(1, round(HELD_OUT_SHARE * count)) if count > 1 else 0
    held = set(rng.permutation(count)[:n_held].tolist())
    return ["held_out" if index in held else "train" for index in range(count)]


def _shared_cmu() -> Path:
    root = Path(__file__).resolve().parents[2]
    return Path(os.environ.get("PACE_SHARED") or root.parent / "shared") / "data" / "cmu"


_MAKERS: dict[str, tuple[Callable[[np.random.Generator], authored_clips.Build], Kind, Support]] = {
    "walk": (authored_clips.walk_clip, "composed", "none"),
    "seat": (authored_clips.seat_clip, "authored", "seat"),
    "bed": (authored_clips.bed_clip, "authored", "seat"),
    "touch": (authored_clips.touch_clip, "authored", "hands"),
    "idle": (authored_clips.idle_clip, "authored", "none"),
}

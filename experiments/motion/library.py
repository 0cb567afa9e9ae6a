"""The library: default motions by name, built for any embedded body and cached."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from functools import lru_cache, partial
from importlib import metadata
from pathlib import Path

import numpy as np

from experiments.body.embedded import BODY_FILE
from experiments.cache import cache_path
from experiments.motion import recipes
from experiments.motion.figure import Figure, figure_of
from experiments.motion.motion import Motion, read_motion, write_motion
from experiments.motion.resample import window
from renderer.files import InputError, file_sha256, value_sha256

AUTHORED = "authored key poses"
STEPS = "DeepMimic clips of the package pybullet (steps)"


@dataclasses.dataclass(frozen=True)
class MotionSpec:
    """One motion of the library and what it asks of a place."""

    motion_id: str
    label: str
    source: str
    build: Callable[[Figure], Motion]
    highlight_s: float
    """The moment of the interaction: what a shorter cut is centred on."""
    contact: tuple[str, ...] = ("floor",)
    """mpcat40 classes of what the person touches, best first."""
    seat_height: float | None = None
    """Height of the seat or bed the clip was authored for, metres."""
    surface_height: float | None = None
    """Height of the table top or shelf that the hands go to, metres (reach_high: on male_slim)."""
    recording: Path | None = None
    """The file it is read from, where that is outside the project and its packages."""


def default_motions() -> tuple[MotionSpec, ...]:
    """The motions every installation has, in a fixed order: pybullet's clips and authored ones only."""
    return _DEFAULT


def extra_motions() -> tuple[MotionSpec, ...]:
    """Motions from CMU's recordings, where the folder `PACE_SHARED` (default `../shared`) has them."""
    folder = Path(os.environ.get("PACE_SHARED") or _ROOT.parent / "shared") / "data" / "cmu"
    specs = []
    for name, label, seconds, contact in _CMU:
        path = folder / name.split("_")[0] / f"{name}.amc"
        if path.is_file():
            build = partial(recipes.recorded, path, seconds)
            source = f"CMU motion capture {name} (mocap.cs.cmu.edu, NSF EIA-0196217)"
            middle = (seconds[1] - seconds[0]) / 2
            specs.append(
                MotionSpec(f"cmu_{name}", label, source, build, middle, contact, recording=path)
            )
    return tuple(specs)


def load_motion(motion_id: str, body_name: str = "male_slim") -> Motion:
    """A motion of the library on an embedded body; built on first use, then read from the cache.

    Raises `InputError` for an unknown motion or body.
    """
    spec = find_spec(motion_id)
    target = cache_path("motions", _recipe_hash(spec.motion_id, body_name, spec.recording), ".npz")
    if not target.is_file():
        motion = spec.build(figure_of(body_name))
        named = dataclasses.replace(
            motion, motion_id=spec.motion_id, label=spec.label, source=spec.source, body=body_name
        )
        write_motion(named, target)
    return read_motion(target)


def find_spec(motion_id: str) -> MotionSpec:
    """The entry of that name. Raises `InputError` listing the names there are."""
    specs = (*_DEFAULT, *extra_motions())
    for spec in specs:
        if spec.motion_id == motion_id:
            return spec
    names = ", ".join(spec.motion_id for spec in specs)
    raise InputError("motion library", "motion", motion_id, f"one of {names}")


def trim(motion: Motion, seconds: float) -> Motion:
    """A cut of that length around the motion's moment of interaction, or around its middle if unknown.

    Time stamps are kept, so a cut can be cut again around the same moment.
    """
    wanted = round(seconds * motion.fps)
    if wanted < 2:
        raise InputError(motion.motion_id, "seconds", seconds, "two frames or more")
    if wanted >= motion.n_frames:
        return motion
    known = {spec.motion_id: spec.highlight_s for spec in _DEFAULT}
    middle = float(motion.times[[0, -1]].mean())
    centre = int(np.searchsorted(motion.times, known.get(motion.motion_id, middle)))
    start = int(np.clip(centre - wanted // 2, 0, motion.n_frames - wanted))
    cut = window(motion, start, start + wanted)
    return dataclasses.replace(cut, times=motion.times[start : start + wanted])


@lru_cache(maxsize=64)
def _recipe_hash(motion_id: str, body_name: str, recording: Path | None) -> str:
    """Changes with the code that builds motions, the body file and the package the steps come from."""
    read = file_sha256(recording) if recording else ""
    code = {path.name: file_sha256(path) for path in sorted(Path(__file__).parent.glob("*.py"))}
    versions = {name: metadata.version(name) for name in ("pybullet", "scipy", "numpy")}
    return value_sha256([motion_id, body_name, read, code, file_sha256(BODY_FILE), versions])


_ROOT = Path(__file__).resolve().parents[2]
_CMU: tuple[tuple[str, str, tuple[float, float], tuple[str, ...]], ...] = (
    ("02_01", "walk (recorded)", (0.0, 2.8), ("floor",)),
    ("02_02", "walk briskly (recorded)", (0.0, 2.4), ("floor",)),
    ("02_06", "bend, scoop up, rise (recorded)", (0.0, 5.0), ("objects", "floor")),
    ("02_10", "wash oneself (recorded)", (0.0, 8.0), ("floor",)),
)
"""Recording, label, part (s), contact."""

_SEAT = ("chair", "sofa", "stool", "seating")

_DEFAULT: tuple[MotionSpec, ...] = (
    MotionSpec("walk_straight", "walk a few steps and stop", f"{STEPS}; {AUTHORED}",
               recipes.walk_straight, 2.6),
    MotionSpec("walk_turn_right", "walk, turn right, walk on and stop", f"{STEPS}; {AUTHORED}",
               recipes.walk_turn_right, 2.7),
    MotionSpec("walk_turn_left", "walk, turn left, walk on and stop", f"{STEPS}, mirrored; {AUTHORED}",
               recipes.walk_turn_left, 2.7),
    MotionSpec("walk_turn_sit", "walk, turn and sit down on a chair", f"{STEPS}; {AUTHORED}",
               recipes.walk_turn_sit, 5.5, _SEAT, 0.45),
    MotionSpec("sit_stay_stand", "sit down, look about, stand up", AUTHORED,
               recipes.sit_stay_stand, 2.8, _SEAT, 0.45),
    MotionSpec("sofa_sit", "sit down on a sofa, lean back, stand up", AUTHORED,
               recipes.sofa_sit, 3.4, ("sofa", "chair", "seating"), 0.43),
    MotionSpec("sit_work", "work at a table", AUTHORED,
               recipes.sit_work, 4.0, ("chair", "stool", "table"), 0.45, 0.73),
    MotionSpec("lie_down", "sit down on a bed and lie down", AUTHORED,
               recipes.lie_down_on_bed, 5.0, ("bed",), 0.50),
    MotionSpec("lie_rest_get_up", "rest on a bed, get up", AUTHORED,
               recipes.rest_and_get_up, 4.0, ("bed",), 0.50),
    MotionSpec("bend_pick", "bend down and pick something up", AUTHORED,
               recipes.bend_pick, 2.2, ("objects", "floor"), None, 0.22),
    MotionSpec("reach_high", "reach for a high shelf", AUTHORED,
               recipes.reach_high, 2.3, ("shelving", "cabinet", "floor"), None, 1.80),
    MotionSpec("floor_get_up", "get up from the floor", f"DeepMimic clip of the package pybullet; {AUTHORED}",
               recipes.floor_get_up, 2.0),
    MotionSpec("step_aside", "step aside and back", AUTHORED, recipes.step_aside, 2.4),
    MotionSpec("walk_around", "walk round something and on", f"{STEPS}; {AUTHORED}",
               recipes.walk_around, 3.4),
    MotionSpec("reach_forward", "reach for something on a shelf", AUTHORED,
               recipes.reach_forward, 2.4, ("shelving", "cabinet", "floor"), None, 1.40),
    MotionSpec("lean_table", "lean on a table with both hands", AUTHORED,
               recipes.lean_table, 3.2, ("table", "counter"), None, 0.75),
    MotionSpec("stand_idle_look", "stand at ease and look about", AUTHORED,
               recipes.stand_idle_look, 4.0),
)  # fmt: skip

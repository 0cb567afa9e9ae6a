"""The pose pool: recorded and authored clips in three versions each, bodies in turn.

Versions: as it is; mirrored with constant noise on the joints; the same noise unmirrored. Clips of
the test half come as they are and, if recorded, mirrored, but never with noise.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from experiments.body.embedded import BODY_NAMES
from experiments.interaction.mesh import feature_vertices
from experiments.interaction.pose_recipes import FAMILIES
from experiments.motion.amc import read_amc
from experiments.motion.bvh import read_bvh
from experiments.motion.capture import INDEX, Capture
from experiments.motion.cleanup import clean_recording
from experiments.motion.deepmimic import pybullet_clip, read_deepmimic
from experiments.motion.figure import Figure, figure_of
from experiments.motion.ground import lowest_height, rest_on_floor
from experiments.motion.importing import adapt
from experiments.motion.motion import Motion
from experiments.motion.resample import mirror
from experiments.motion.rotations import to_axis_angle, to_matrix

NOISE_DEG = {"leg": 2.5, "trunk": 3.5, "arm": 6.0}
"""Standard deviation of the constant turn about each axis, by part of the body."""
TEST_SHARE = 0.15
"""Of the authored clips; at least one of every family."""
SMOOTH_FRAMES = 1.5
"""Standard deviation of the Gaussian over the heights that bring a noisy clip back to its floor."""
_MOST_FRAMES = 1500


@dataclass(frozen=True)
class PoseClip:
    """One clip of the pool. World: z up, metres, its floor at z = 0."""

    name: str
    kind: str
    split: str
    family: str
    body: str
    motion: Motion


@dataclass(frozen=True)
class Recording:
    """A recording to take in: how it is brought onto the floor and whether it is held out."""

    name: str
    family: str
    read: Callable[[], Capture]
    grounding: str
    """`feet`: the soles are on the floor; `skin`: whatever is lowest is; `none`: only at its lowest."""
    test: bool = False


def pose_pool(seed: int, split: str | None = None) -> Iterator[PoseClip]:
    """All clips, or those of one split, in a fixed order; every clip has a generator of its own."""
    for number, source in enumerate(pool_sources()):
        if split in (None, source.split):
            yield source.build(np.random.default_rng([seed, number]))


def pool_size(split: str | None = None) -> int:
    """How many clips `pose_pool` yields."""
    return sum(split in (None, source.split) for source in pool_sources())


@dataclass(frozen=True)
class PoolSource:
    """A clip of the pool before it is built."""

    name: str
    split: str
    build: Callable[[np.random.Generator], PoseClip]


def recordings() -> tuple[Recording, ...]:
    """The clips of the package pybullet and, where `PACE_SHARED` has them, of CMU's database."""
    return (*_PYBULLET, *_cmu())


def pool_sources() -> Iterator[PoolSource]:
    """Every clip and version there is: recorded ones first, then the authored families."""
    for index, recording in enumerate(recordings()):
        for version in range(2 if recording.test else 3):
            body = BODY_NAMES[(index + version) % len(BODY_NAMES)]
            split = "test" if recording.test else "train"
            yield PoolSource(recording.name, split, partial(_captured, recording, version, body))
    index = 0
    for family, (_, count) in FAMILIES.items():
        for number in range(count):
            test = number >= count - _test_count(count)
            for version in range(1 if test else 3):
                body = BODY_NAMES[(index + version) % len(BODY_NAMES)]
                build = partial(_authored, family, number, version, body, test)
                split = "test" if test else "train"
                yield PoolSource(f"{family}_{number:02d}", split, build)
            index += 1


def _captured(recording: Recording, version: int, body: str, rng: np.random.Generator) -> PoseClip:
    figure = figure_of(body)
    motion = _grounded(adapt(_read(recording), figure), figure, recording.grounding)
    motion = _versioned(motion, figure, recording.grounding, version, recording.test, rng)
    return _named(recording.name, "captured", recording.test, recording.family, version, motion)


@lru_cache(maxsize=2)
def _read(recording: Recording) -> Capture:
    return recording.read()


def _authored(
    family: str, number: int, version: int, body: str, test: bool, rng: np.random.Generator
) -> PoseClip:
    """The versions of one clip share its parameters: those follow from family and number."""
    seeds = [list(FAMILIES).index(family), number]
    figure = figure_of(body)
    motion = FAMILIES[family][0](figure, np.random.default_rng(seeds))
    motion = _versioned(motion, figure, "none", version, test, rng)
    return _named(f"{family}_{number:02d}", "authored", test, family, version, motion)


def _test_count(count: int) -> int:
    return max(1, round(TEST_SHARE * count))


def _named(name: str, kind: str, test: bool, family: str, version: int, motion: Motion) -> PoseClip:
    cut = dataclasses.replace(
        motion,
        pose=motion.pose[:_MOST_FRAMES],
        transl=motion.transl[:_MOST_FRAMES],
        times=motion.times[:_MOST_FRAMES],
    )
    split = "test" if test else "train"
    return PoseClip(f"{name}/{version}", kind, split, family, motion.body, cut)


def _versioned(
    motion: Motion,
    figure: Figure,
    grounding: str,
    version: int,
    test: bool,
    rng: np.random.Generator,
) -> Motion:
    """Version 0 as it is, 1 mirrored and (in training) noisy, 2 noisy."""
    changed = mirror(motion) if version == 1 else motion
    if version == 0 or test:
        return changed
    noisy = noised(changed, rng)
    if grounding != "none":
        return _grounded(noisy, figure, grounding)
    return _at_same_floor(noisy, changed, figure)


def noised(motion: Motion, rng: np.random.Generator) -> Motion:
    """Every joint turned by a small rotation that stays the same for the whole clip."""
    turn = rng.standard_normal((22, 3))
    for name, joint in INDEX.items():
        turn[joint] *= np.radians(NOISE_DEG[_part(name)])
    pose = to_axis_angle(to_matrix(motion.pose) @ to_matrix(turn)[None])
    return dataclasses.replace(motion, pose=pose)


def _part(joint: str) -> str:
    if any(word in joint for word in ("hip", "knee", "ankle", "foot")):
        return "leg"
    return "arm" if any(w in joint for w in ("shoulder", "elbow", "wrist")) else "trunk"


def _at_same_floor(noisy: Motion, original: Motion, figure: Figure) -> Motion:
    """Raised and lowered smoothly, so that its lowest points stand where they did on the floor.

    One height for the whole clip would leave feet some millimetres off the floor that the model is
    told of (the lowest vertex), and blur the edge of every label there.
    """
    skin = feature_vertices(figure.body)
    before, after = (lowest_height(motion, figure, skin) for motion in (original, noisy))
    on_floor = before < 0.05
    frames = np.flatnonzero(on_floor if on_floor.any() else np.ones_like(on_floor))
    shift = np.interp(np.arange(len(before)), frames, (before - after)[frames])
    return _raised(noisy, gaussian_filter1d(shift, SMOOTH_FRAMES, mode="nearest"))


def _grounded(motion: Motion, figure: Figure, grounding: str) -> Motion:
    if grounding == "feet":
        return clean_recording(motion, figure)
    if grounding == "skin":
        return rest_on_floor(motion, figure)
    lowest = lowest_height(motion, figure, np.concatenate(figure.soles))
    return _raised(motion, -float(np.percentile(lowest, 15)))


def _raised(motion: Motion, height: float | Float[np.ndarray, " T"]) -> Motion:
    up = np.broadcast_to(height, len(motion.transl))[:, None] * np.array([0.0, 0.0, 1.0])
    return dataclasses.replace(motion, transl=motion.transl + up)


def _clip(name: str, family: str, grounding: str, test: bool = False) -> Recording:
    short = name.removeprefix("humanoid3d_").replace("walker/", "")
    return Recording(short, family, lambda: read_deepmimic(pybullet_clip(name)), grounding, test)


_PYBULLET = (
    _clip("humanoid3d_walk", "walk", "feet"), _clip("humanoid3d_run", "run", "feet"),
    _clip("humanoid3d_crawl", "crawl", "skin"),
    _clip("humanoid3d_getup_facedown", "get_up", "skin", test=True),
    _clip("humanoid3d_getup_faceup", "get_up", "skin"),
    _clip("humanoid3d_dance_a", "dance", "feet"), _clip("humanoid3d_dance_b", "dance", "feet"),
    _clip("humanoid3d_jump", "jump", "none"),
    _clip("walker/turn_right0", "turn", "feet"), _clip("walker/turn_left1", "turn", "feet", test=True),
    _clip("walker/turn_right1", "turn", "feet"), _clip("walker/0walk_forward", "walk", "feet"),
)  # fmt: skip

_CMU: tuple[tuple[str, str, str, bool], ...] = (
    ("01_01", "jump", "none", False), ("01_02", "climb", "none", False),
    ("01_03", "climb", "none", False), ("01_04", "climb", "none", False),
    ("01_05", "climb", "none", False), ("01_06", "climb", "none", False),
    ("01_07", "climb", "none", False), ("01_08", "climb", "none", True),
    ("01_09", "climb", "none", False), ("01_10", "climb", "none", False),
    ("01_11", "climb", "none", False), ("01_13", "climb", "none", False),
    ("01_14", "climb", "none", False), ("02_01", "walk", "feet", True),
    ("02_02", "walk", "feet", False), ("02_03", "run", "feet", False),
    ("02_04", "jump", "none", False), ("02_05", "punch", "feet", False),
    ("02_06", "bend", "feet", True), ("02_07", "swing", "feet", False),
    ("02_10", "wash", "feet", False), ("03_01", "walk", "none", False),
    ("03_03", "walk", "none", False), ("131_01", "walk", "feet", False),
    ("131_02", "walk", "feet", False), ("131_03", "walk", "feet", False),
)  # fmt: skip
"""Recording, family, grounding, held out. Subjects 01 and 03 move on things that were not recorded."""


@lru_cache(maxsize=1)
def _cmu() -> tuple[Recording, ...]:
    folder = Path(os.environ.get("PACE_SHARED") or Path(__file__).resolve().parents[3] / "shared")
    found = []
    for name, family, grounding, test in _CMU:
        stem = folder / "data" / "cmu" / name.split("_")[0] / name
        for suffix, read in ((".amc", read_amc), (".bvh", read_bvh)):
            path = stem.with_suffix(suffix)
            if path.is_file():
                reader = partial(read, path)
                found.append(Recording(f"cmu_{name}", family, reader, grounding, test))
    return tuple(found)

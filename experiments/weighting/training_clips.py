"""The clips that the network g is trained and judged on: those of the interaction model's pose pool."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from experiments.body.embedded import load_body
from experiments.interaction.mesh import moving_body
from experiments.interaction.pose_pool import PoolSource, PoseClip, pool_sources, recordings
from experiments.interaction.registry import INTERACTIONS
from experiments.motion.motion import Motion
from experiments.motion.resample import FPS, at_times, window
from experiments.weighting.geometric import FrameCues, frame_cues
from experiments.weighting.inputs import MotionInputs, motion_inputs
from renderer.files import atomic_path

SCENE_CLASSES: tuple[tuple[str, ...], ...] = (
    ("floor", "wall", "chair", "table", "cabinet", "shelving", "door"),
    ("floor", "wall", "sofa", "bed", "stool", "counter", "seating", "shelving"),
)
"""Two made-up lists of what a scene has, so that the same motion is seen with other classes."""
RECORDED_STRIDE, AUTHORED_STRIDE = 3, 6
"""Of the pool's recorded and authored sources, one in so many is trained on."""
MOST_FRAMES = 300
"""Longer clips are cut to a part of this length."""
RATES = (1.0 / 3.0, 1.5)
"""Range of speeds in a time-warped clip: a third of the speed is a long stand or sit."""


@dataclass(frozen=True)
class TrainingClip:
    """One clip with its input to the network and what K_g is computed from."""

    name: str
    captured: bool
    held_out: bool
    inputs: MotionInputs
    cues: FrameCues

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(self.cues.speed)


def build_clips(
    interaction: str,
    seed: int,
    folder: Path,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> list[TrainingClip]:
    """Recorded and authored clips, four bodies in turn; every other training clip is time-warped.

    Only some of the pool's training clips are taken (`RECORDED_STRIDE`, `AUTHORED_STRIDE`): it has
    each in three versions that look alike, and many of each family. The split is that of the pool,
    by clip: what the interaction model never saw is held out here too. CMU recordings are used
    where the folder `PACE_SHARED` has them. Clips are kept in `folder`, and not made again.
    """
    wanted = list(_wanted_sources())
    clips: list[TrainingClip] = []
    for number, source in wanted:
        progress(len(clips), len(wanted))
        path = folder / f"{interaction}-{seed}-{number}.npz"
        if not path.exists():
            clip = source.build(np.random.default_rng([seed, number]))
            generator = np.random.default_rng([seed, number, 1])
            write_clip(_clip(clip, len(clips) % 2 == 1, interaction, generator), path)
        clips.append(read_clip(path))
    progress(len(clips), len(wanted))
    return clips


def write_clip(clip: TrainingClip, target: Path) -> None:
    """Keep a clip as `.npz`, whole or not at all."""
    arrays: dict[str, Any] = {
        "name": clip.name,
        "captured": clip.captured,
        "held_out": clip.held_out,
        "points": clip.inputs.points.numpy(),
        "classes": clip.inputs.classes.numpy().astype(np.uint8),
        "velocity": clip.inputs.velocity.numpy(),
        "stride": clip.inputs.stride,
        "speed": clip.cues.speed,
        "histogram": clip.cues.histogram,
        "strength": clip.cues.strength,
    }
    with atomic_path(target) as temporary:
        np.savez_compressed(temporary, **arrays)


def read_clip(source: Path) -> TrainingClip:
    """Read what `write_clip` wrote."""
    with np.load(source, allow_pickle=False) as archive:
        part = {name: archive[name] for name in archive.files}
    inputs = MotionInputs(
        points=torch.as_tensor(part["points"]),
        classes=torch.as_tensor(part["classes"].astype(np.int64)),
        velocity=torch.as_tensor(part["velocity"]),
        stride=int(part["stride"]),
    )
    cues = FrameCues(part["speed"], part["histogram"], part["strength"])
    about = str(part["name"]), bool(part["captured"]), bool(part["held_out"])
    return TrainingClip(*about, inputs=inputs, cues=cues)


def _wanted_sources() -> Iterator[tuple[int, PoolSource]]:
    recorded = sum(2 if recording.test else 3 for recording in recordings())
    for number, source in enumerate(pool_sources()):
        stride = RECORDED_STRIDE if number < recorded else AUTHORED_STRIDE
        if source.split == "test" or number % stride == 0:
            yield number, source


def warp_times(
    times: Float[np.ndarray, " T"], generator: np.random.Generator
) -> Float[np.ndarray, " S"]:
    """Moments of the motion, one for each new frame, at speeds that change along the clip.

    Speeds at four moments are log-uniform in `RATES` and change gradually between them, so that no
    frame jumps.
    """
    knots = np.linspace(times[0], times[-1], 4)
    slowest, fastest = (float(np.log(rate)) for rate in RATES)
    slowness = np.exp(-generator.uniform(slowest, fastest, len(knots)))
    fine = np.linspace(times[0], times[-1], 10 * len(times))
    spent = np.interp(fine, knots, slowness)
    clock = np.concatenate([[0.0], np.cumsum(0.5 * (spent[1:] + spent[:-1]) * np.diff(fine))])
    return np.asarray(np.interp(np.arange(0.0, clock[-1], 1.0 / FPS), clock, fine))


def _clip(
    source: PoseClip, warped: bool, interaction: str, generator: np.random.Generator
) -> TrainingClip:
    motion, held_out = source.motion, source.split == "test"
    if warped and not held_out:
        motion = at_times(motion, warp_times(motion.times, generator), FPS)
    if motion.n_frames > MOST_FRAMES:
        start = int(generator.integers(motion.n_frames - MOST_FRAMES + 1))
        motion = window(motion, start, start + MOST_FRAMES)
    classes = SCENE_CLASSES[int(generator.integers(len(SCENE_CLASSES)))]
    inputs, cues = clip_parts(
        dataclasses.replace(motion, body=source.body), interaction, classes, generator
    )
    return TrainingClip(source.name, source.kind == "captured", held_out, inputs, cues)


def clip_parts(
    motion: Motion,
    interaction: str,
    scene_classes: tuple[str, ...],
    generator: np.random.Generator,
) -> tuple[MotionInputs, FrameCues]:
    """Input and cues of a motion with one of the feature maps that the model offers."""
    body = load_body(motion.body)
    maps = INTERACTIONS[interaction](motion, body, scene_classes)
    features = maps[int(generator.integers(len(maps)))]
    moving = moving_body(motion, body)
    columns = np.searchsorted(moving.vertex_ids, features.vertex_ids)
    cues = frame_cues(moving.vertices[:, columns], motion.times, features)
    return motion_inputs(moving, body, features), cues

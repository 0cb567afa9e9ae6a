"""The clips that the network g is trained and judged on: those of the interaction model's pose pool."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from experiments.body.embedded import load_body
from experiments.interaction.mesh import moving_body
from experiments.interaction.pose_pool import PoseClip, pool_sources, recordings
from experiments.interaction.registry import INTERACTIONS
from experiments.motion.motion import Motion
from experiments.motion.resample import FPS, at_times, window
from experiments.weighting.geometric import FrameCues, frame_cues
from experiments.weighting.inputs import MotionInputs, motion_inputs

SCENE_CLASSES: tuple[tuple[str, ...], ...] = (
    ("floor", "wall", "chair", "table", "cabinet", "shelving", "door"),
    ("floor", "wall", "sofa", "bed", "stool", "counter", "seating", "shelving"),
)
"""Two made-up lists of what a scene has, so that the same motion is seen with other classes."""
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
    interaction: str, seed: int, progress: Callable[[int, int], None] = lambda *_: None
) -> list[TrainingClip]:
    """Recorded and authored clips, four bodies in turn; every other training clip is time-warped.

    The pool has each clip in three versions that look alike: of authored ones one is taken, of
    recorded ones two. The split is that of the pool, by clip: what the interaction model never saw
    is held out here too. CMU recordings are used where the folder `PACE_SHARED` has them.
    """
    sources = list(pool_sources())
    recorded = sum(2 if recording.test else 3 for recording in recordings())
    clips: list[TrainingClip] = []
    for number, source in enumerate(sources):
        versions = (0, 1) if number < recorded else (0,)
        if source.split == "test" or number % 3 in versions:
            clip = source.build(np.random.default_rng([seed, number]))
            generator = np.random.default_rng([seed, number, 1])
            clips.append(_clip(clip, len(clips) % 2 == 1, interaction, generator))
        progress(number + 1, len(sources))
    return clips


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

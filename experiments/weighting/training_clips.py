"""The clips that the network g is trained and judged on: the library's motions and variants of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from experiments.body.embedded import BODY_NAMES, load_body
from experiments.interaction.mesh import moving_body
from experiments.interaction.registry import INTERACTIONS
from experiments.motion.library import MotionSpec, default_motions, extra_motions, load_motion
from experiments.motion.motion import Motion
from experiments.motion.resample import FPS, at_times, mirror
from experiments.weighting.geometric import FrameCues, frame_cues
from experiments.weighting.inputs import MotionInputs, motion_inputs

HELD_OUT: tuple[str, ...] = ("walk_turn_right", "walk_turn_left", "walk_turn_sit", "sofa_sit",
                             "lie_rest_get_up", "reach_forward", "floor_get_up", "cmu_02_06")  # fmt: skip
"""Never trained on, with all their variants; a motion and its mirror image stay together."""
SCENE_CLASSES: tuple[tuple[str, ...], ...] = (
    ("floor", "wall", "chair", "table", "cabinet", "shelving", "door"),
    ("floor", "wall", "sofa", "bed", "stool", "counter", "seating", "shelving"),
)
"""Two made-up lists of what a scene has, so that the same motion is seen with other classes."""
WARPS = 2
"""Time-warped variants beside the clip as it is, of the motion and of its mirror image."""
RATES = (1.0 / 3.0, 1.5)
"""Range of speeds in a time-warped variant: a third of the speed is a long stand or sit."""


@dataclass(frozen=True)
class TrainingClip:
    """One clip with its input to the network and what K_g is computed from."""

    name: str
    motion_id: str
    captured: bool
    inputs: MotionInputs
    cues: FrameCues

    @property
    def held_out(self) -> bool:
        """Whether it belongs to the test split."""
        return self.motion_id in HELD_OUT

    @property
    def n_frames(self) -> int:
        """Number of frames T."""
        return len(self.cues.speed)


def build_clips(
    interaction: str, seed: int, progress: Callable[[int, int], None] = lambda *_: None
) -> list[TrainingClip]:
    """Every motion there is, mirrored and time-warped, on the four bodies in turn.

    CMU recordings are used where the folder `PACE_SHARED` has them.
    """
    specs = (*default_motions(), *extra_motions())
    clips: list[TrainingClip] = []
    total = len(specs) * 2 * (1 + WARPS)
    for index, spec in enumerate(specs):
        generator = np.random.default_rng([seed, index])
        for flip in (False, True):
            for variant in range(1 + WARPS):
                body = BODY_NAMES[len(clips) % len(BODY_NAMES)]
                clips.append(_clip(spec, body, flip, variant, interaction, generator))
                progress(len(clips), total)
    return clips


def warp_times(
    times: Float[np.ndarray, " T"], generator: np.random.Generator
) -> Float[np.ndarray, " S"]:
    """Moments of the motion, one for each new frame, with four stretches of other speed each.

    Speeds are log-uniform in `RATES` and change gradually, so that no frame jumps.
    """
    knots = np.linspace(times[0], times[-1], 4)
    slowness = 1.0 / np.exp(generator.uniform(*np.log(RATES), len(knots)))
    fine = np.linspace(times[0], times[-1], 10 * len(times))
    spent = np.interp(fine, knots, slowness)
    clock = np.concatenate([[0.0], np.cumsum(0.5 * (spent[1:] + spent[:-1]) * np.diff(fine))])
    return np.asarray(np.interp(np.arange(0.0, clock[-1], 1.0 / FPS), clock, fine))


def _clip(
    spec: MotionSpec,
    body_name: str,
    flip: bool,
    variant: int,
    interaction: str,
    generator: np.random.Generator,
) -> TrainingClip:
    motion = load_motion(spec.motion_id, body_name)
    motion = mirror(motion) if flip else motion
    if variant:
        motion = at_times(motion, warp_times(motion.times, generator), FPS)
    classes = SCENE_CLASSES[int(generator.integers(len(SCENE_CLASSES)))]
    inputs, cues = clip_parts(motion, interaction, classes, generator)
    return TrainingClip(
        name=f"{spec.motion_id} {'mirrored ' if flip else ''}{variant} {body_name}",
        motion_id=spec.motion_id,
        captured="authored" not in spec.source or "DeepMimic" in spec.source,
        inputs=inputs,
        cues=cues,
    )


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

"""Building the data sets of the interaction model: poses, one scene a clip, labels; cached."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float16, Integer, UInt8

from experiments.body.embedded import BODY_FILE, load_body
from experiments.cache import cache_path
from experiments.interaction.canonical import canonical_frames, height_above_floor
from experiments.interaction.contact_dataset import (
    DISTANCE_CAP_M,
    RECIPE_VERSION,
    ClipRecord,
    ContactDataset,
    Progress,
)
from experiments.interaction.contact_holds import PosedClip, posed_clip
from experiments.interaction.contact_labels import LabelledFrames, label_clip
from experiments.interaction.mesh import feature_vertices
from experiments.interaction.pose_pool import PoseClip, pool_size, pose_pool, recordings
from renderer.files import file_sha256, value_sha256

STRIDE, SHORT_STRIDE = 6, 3
"""Frames taken of training clips, and of those shorter than `_SHORT`."""
_SHORT = 150


def build_dataset(seed: int = 0, progress: Progress | None = None) -> ContactDataset:
    """Training and test clips, each with supports built to fit it. Cached by recipe and seed."""
    return cached_dataset("fitted", seed, lambda: labelled_pool(seed, None, 1, progress))


def build_second_draw(seed: int = 0, progress: Progress | None = None) -> ContactDataset:
    """The test clips of `build_dataset` again, with other scenes drawn for them. Cached."""
    return cached_dataset("second", seed, lambda: labelled_pool(seed, "test", 2, progress))


def held_out_clips(seed: int = 0) -> list[PoseClip]:
    """The clips of the test split before any scene is built for them."""
    return list(pose_pool(seed, "test"))


def labelled_pool(
    seed: int, split: str | None, draw: int, progress: Progress | None = None
) -> ContactDataset:
    """The clips of a split in the scenes of one draw.

    Seeds of scenes begin with the split and the draw, so no scene of one is ever met in another.
    """
    pieces = []
    for number, pose in enumerate(pose_pool(seed, split)):
        words = [draw if pose.split == "test" else 0, seed, number]
        pieces.append(labelled_clip(pose, number, np.random.default_rng(words)))
        if progress is not None:
            progress(number + 1, pool_size(split))
    return joined([piece for piece in pieces if len(piece.frame)])


@dataclass(frozen=True)
class ClipBodies:
    """The bodies of one clip, as `ContactDataset` has them."""

    record: ClipRecord
    vertices: Float16[np.ndarray, "F V 3"]
    height: Float16[np.ndarray, "F V"]
    distance: Float16[np.ndarray, "F V"]
    nearest: UInt8[np.ndarray, "F V"]
    frame: Integer[np.ndarray, " F"]


def labelled_clip(pose: PoseClip, number: int, rng: np.random.Generator) -> ClipBodies:
    """One clip of the pool, a scene built for it, and what remains of its frames."""
    clip = posed_clip(pose.motion, load_body(pose.body))
    stride = 1 if pose.split == "test" else STRIDE if len(clip.times) >= _SHORT else SHORT_STRIDE
    return clip_bodies(pose, number, clip, label_clip(clip, stride, rng))


def clip_bodies(pose: PoseClip, number: int, clip: PosedClip, found: LabelledFrames) -> ClipBodies:
    """Labelled frames of a clip in the model's frame and number formats."""
    record = ClipRecord(pose.name, pose.kind, pose.split, pose.body, number, pose.family)
    height = height_above_floor(clip.vertices, clip.times)
    canonical = canonical_frames(clip.vertices[found.frames], clip.joints[found.frames])
    return ClipBodies(
        record=record,
        vertices=canonical.astype(np.float16),
        height=height[found.frames].astype(np.float16),
        distance=np.minimum(found.distance, DISTANCE_CAP_M).astype(np.float16),
        nearest=found.nearest,
        frame=found.frames,
    )


def joined(pieces: list[ClipBodies]) -> ContactDataset:
    """All clips one after another."""
    arrays = ("vertices", "height", "distance", "nearest", "frame")
    counts = [len(piece.frame) for piece in pieces]
    return ContactDataset(
        vertex_ids=feature_vertices(load_body()),
        clip=np.repeat(np.arange(len(pieces)), counts),
        clips=tuple(piece.record for piece in pieces),
        **{name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in arrays},
    )


def cache_key(kind: str, seed: int, version: int = RECIPE_VERSION) -> str:
    """Changes with the recipe's version, the seed, the body file and the recordings there are."""
    names = [recording.name for recording in recordings()]
    return value_sha256([kind, seed, version, names, file_sha256(BODY_FILE)])


def cached_dataset(kind: str, seed: int, build: Callable[[], ContactDataset]) -> ContactDataset:
    """A data set from the cache, or built and put there."""
    target = cache_path("contact", cache_key(kind, seed), ".npz")
    if not target.is_file():
        build().save(target)
    return ContactDataset.load(target)

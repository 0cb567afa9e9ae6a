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
_FURNITURE = {"train": 1, "test": 2, "second": 3}
"""First word of the seed of every scene: no scene of one half is ever drawn in the other."""


def build_dataset(seed: int = 0, progress: Progress | None = None) -> ContactDataset:
    """Training and test clips, each with supports built to fit it. Cached by recipe and seed."""
    return _cached("fitted", seed, lambda: _labelled_pool(seed, ("train", "test"), progress))


def build_second_draw(seed: int = 0, progress: Progress | None = None) -> ContactDataset:
    """The test clips of `build_dataset` again, with other scenes drawn for them. Cached."""
    return _cached("second", seed, lambda: _labelled_pool(seed, ("second",), progress))


def _labelled_pool(seed: int, parts: tuple[str, ...], progress: Progress | None) -> ContactDataset:
    pieces = []
    for number, pose in enumerate(pose_pool(np.random.default_rng(seed))):
        part = "second" if parts == ("second",) else pose.split
        if progress is not None:
            progress(number, pool_size())
        if parts == ("second",) and pose.split != "test":
            continue
        scene_seed = [_FURNITURE[part], seed, number]
        piece = labelled_clip(pose, number, np.random.default_rng(scene_seed))
        if len(piece.frame):
            pieces.append(piece)
    return joined(pieces)


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


def _cached(kind: str, seed: int, build: Callable[[], ContactDataset]) -> ContactDataset:
    target = cache_path("contact", cache_key(kind, seed), ".npz")
    if not target.is_file():
        build().save(target)
    return ContactDataset.load(target)

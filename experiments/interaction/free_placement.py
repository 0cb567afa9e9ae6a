"""The second test set: held-out clips placed in furnished rooms, which were not built to fit them.

Each clip is placed rigidly by `posa_t` with the rule `geometric`, so nothing learned decides where it
goes; the rooms are the training rooms and a variation of each. Distances and classes are read from
the rooms' baked, unthickened volumes. A clip that fits nowhere is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import torch

from experiments.body.embedded import load_body
from experiments.interaction.contact_build import ClipBodies, clip_bodies
from experiments.interaction.contact_dataset import Progress
from experiments.interaction.contact_holds import PosedClip, posed_clip
from experiments.interaction.contact_labels import LabelledFrames, carrying_columns, possible
from experiments.interaction.contact_scene import ContactScene
from experiments.interaction.pose_pool import PoseClip
from experiments.methods.posa_t import posa_t
from experiments.placement.errors import PlacementError
from experiments.placement.settings import PRESETS
from experiments.scene.baking import bake_layout
from experiments.scene.furnish import furnish
from experiments.scene.layout import read_layout
from experiments.scene.lookup import SceneLookup
from experiments.scene.rooms import TRAINING_ROOMS
from experiments.scene.scene import Scene
from experiments.scene.variations import vary

STRIDE = 3
ROOMS_PER_CLIP = 2


def free_rooms(seed: int) -> tuple[Scene, ...]:
    """The training rooms and one variation of each; baked on first use."""
    layouts = [read_layout(name) for name in TRAINING_ROOMS]
    layouts += [vary(layout, 1000 + seed) for layout in layouts]
    return tuple(bake_layout(layout, furnish(layout)) for layout in layouts)


def place_freely(
    clips: Sequence[PoseClip],
    rooms: Sequence[Scene],
    seed: int,
    progress: Progress | None = None,
) -> Iterator[ClipBodies]:
    """Each clip in some of the rooms, rooms in turn; nothing for a clip that fits in none of them."""
    for number, pose in enumerate(clips):
        for turn in range(ROOMS_PER_CLIP):
            room = rooms[(number + turn * (len(rooms) // ROOMS_PER_CLIP)) % len(rooms)]
            placed = placed_in(pose, room, seed)
            if placed is not None and len(placed.frame):
                yield placed
        if progress is not None:
            progress(number + 1, len(clips))


def placed_in(pose: PoseClip, room: Scene, seed: int) -> ClipBodies | None:
    """A clip in one room with the room's labels; None where it fits nowhere."""
    body = load_body(pose.body)
    settings = replace(PRESETS["fast"], interaction="geometric")
    named = replace(pose.motion, motion_id=pose.name)
    try:
        placement = posa_t(named, room, body, settings, seed)
    except PlacementError:
        return None
    clip = posed_clip(placement.motion, body)
    found = in_room(clip, room)
    named_pose = replace(pose, name=f"{pose.name}@{room.scene_id}")
    return clip_bodies(named_pose, seed, clip, found)


def in_room(clip: PosedClip, room: Scene) -> LabelledFrames:
    """Distances and classes of a placed clip, by the room's volumes; impossible frames left out."""
    frames = np.arange(0, len(clip.times), STRIDE)
    lookup = SceneLookup(room)
    points = torch.as_tensor(clip.vertices[frames], dtype=torch.float32)
    signed = lookup.distance(points).double().numpy()
    label = lookup.label(points).numpy().astype(np.uint8)
    distance = np.abs(signed)
    keep = possible(distance, label, np.maximum(-signed, 0.0), carrying_columns(clip))
    return LabelledFrames(frames[keep], distance[keep], label[keep], ContactScene(()))

"""Labels of one clip: a scene is drawn, distances are taken, frames that cannot be are dropped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Integer, UInt8

from experiments.interaction.contact_holds import PosedClip, find_holds
from experiments.interaction.contact_scene import ContactScene
from experiments.interaction.contact_supports import FLOOR, draw_scene

DEEPEST_M = 0.035
"""A frame with a vertex deeper than this inside anything is dropped."""
FURTHEST_M = 0.06
"""A frame that nothing this near holds up hangs on something that was not recorded."""
DRAWS = 6
TRIED_FRAMES = 40
"""About so many frames decide between scenes."""
ENOUGH = 0.9
"""A scene that keeps this share of the frames is taken at once."""


@dataclass(frozen=True)
class LabelledFrames:
    """Some frames of a clip with what is nearest to every vertex."""

    frames: Integer[np.ndarray, " F"]
    distance: Float[np.ndarray, "F V"]
    """Unsigned, metres."""
    nearest: UInt8[np.ndarray, "F V"]
    scene: ContactScene


def label_clip(clip: PosedClip, stride: int, rng: np.random.Generator) -> LabelledFrames:
    """The best of some random scenes and the frames it leaves; perhaps none.

    The later draws leave out what does not carry the body: back rests, arms, walls beside.
    """
    holds = find_holds(clip)
    frames = np.arange(0, len(clip.times), stride)
    tried = frames[:: max(1, len(frames) // TRIED_FRAMES)]
    best, most = ContactScene((FLOOR,)), -1
    for attempt in range(DRAWS):
        scene = draw_scene(clip, holds, rng, sparing=attempt >= DRAWS // 2)
        kept = len(in_scene(clip, scene, tried).frames)
        if kept > most:
            best, most = scene, kept
        if most >= ENOUGH * len(tried) or len(scene.solids) == 1:
            break
    return in_scene(clip, best, frames)


def in_scene(
    clip: PosedClip, scene: ContactScene, frames: Integer[np.ndarray, " F"]
) -> LabelledFrames:
    """The frames that are possible in a scene, and their labels."""
    distance, nearest, depth = scene.nearest(clip.vertices[frames])
    keep = possible(distance, nearest, depth, carrying_columns(clip))
    return LabelledFrames(frames[keep], distance[keep], nearest[keep], scene)


def possible(
    distance: Float[np.ndarray, "F V"],
    nearest: UInt8[np.ndarray, "F V"],
    depth: Float[np.ndarray, "F V"],
    carrying: Integer[np.ndarray, " C"],
) -> Bool[np.ndarray, " F"]:
    """Frames without deep penetration in which something holds the body up.

    That is anything near to its trunk, legs or head, or the floor near to its hands.
    """
    on_floor = np.where(nearest == FLOOR.label, distance, np.inf).min(1)
    held = np.minimum(distance[:, carrying].min(1), on_floor) <= FURTHEST_M
    return np.asarray((depth.max(1) <= DEEPEST_M) & held)


def carrying_columns(clip: PosedClip) -> Integer[np.ndarray, " C"]:
    """The vertices that can carry the body on furniture: all but hands and forearms."""
    arms = np.concatenate([clip.columns[n] for n in ("left_hand", "right_hand", "forearms")])
    return np.setdiff1d(np.arange(clip.vertices.shape[1]), arms)

"""Motion synthesis: a motion of its own for the room, after Wang et al. (CVPR 2021), re-implemented.

Nothing of the paired clip is used but its slot: name, frame rate, number of frames.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from jaxtyping import Float

from experiments.body.model import BodyModel
from experiments.motion.motion import Motion
from experiments.motion.resample import at_times
from experiments.placement.errors import OptimisationFailed, PlacementError
from experiments.placement.placement import Placement
from experiments.placement.settings import PlacementSettings
from experiments.scene.scene import Scene
from experiments.synthesis.body_vector import Clip, to_motion
from experiments.synthesis.refinement import PHASES, Refined, refine
from experiments.synthesis.route_net import SEGMENT, SEGMENT_FPS
from experiments.synthesis.sequence import generate, n_segments, scene_features, subgoal_bodies
from experiments.synthesis.spots import RoomSpots, Spot, room_spots
from experiments.synthesis.subgoals import NoSubgoals, choose_subgoals
from experiments.synthesis.weights import SynthesisNets, load_nets, read_note, weights_file
from renderer.files import InputError, value_sha256

NAME = "synthesis"


def synthesis(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings, seed: int
) -> Placement:
    """Synthesise a motion as long as `motion` in the room; raises `PlacementError`.

    The four published stages: a body at every sub-goal, routes, poses, refinement. `settings` do not
    enter. Sub-goals and latents are drawn from a generator seeded by `seed`, the room and the slot.
    """
    return synthesise(load_nets(), motion, scene, body, settings, seed)


def synthesise(
    nets: SynthesisNets,
    slot: Motion,
    scene: Scene,
    body: BodyModel,
    settings: PlacementSettings,
    seed: int,
) -> Placement:
    """The same with networks of one's own."""
    drawn = slot_seed(seed, scene.scene_id, slot.motion_id)
    rng = np.random.default_rng(drawn)
    segments = n_segments(frames_at_30(slot))
    spots = room_spots(scene, body)
    try:
        subgoals = choose_subgoals(spots, segments + 1, rng)
    except NoSubgoals as error:
        raise PlacementError(slot.motion_id, scene.scene_id, str(error)) from None
    features = scene_features(nets, scene)
    bodies = subgoal_bodies(nets, features, body, subgoals, rng)
    refined = refine(generate(nets, features, bodies), bodies[[0, -1]], body, scene)
    if not all(math.isfinite(value) for value in refined.terms.values()):
        reason = "the networks gave a body that is not finite"
        raise OptimisationFailed(slot.motion_id, scene.scene_id, reason)
    return Placement(
        scene=scene.scene_id,
        motion_id=slot.motion_id,
        method=NAME,
        translation=np.zeros(3),
        yaw=0.0,
        motion=as_long_as(refined.vectors.double().numpy(), slot, nets),
        altered=True,
        weights=np.ones(slot.n_frames),
        terms=_weighted(refined),
        seed=seed,
        config_hash=settings.config_hash(),
        info=_info(nets, spots, subgoals, refined, drawn),
    )


def display_name() -> str:
    """The name with the minutes of capture, read from the weights' header."""
    try:
        minutes = read_note(weights_file("subgoal")).capture_minutes
    except InputError:
        return "Motion synthesis (re-implemented, untrained)"
    return f"Motion synthesis (re-implemented, {minutes:.0f} min of capture)"


def frames_at_30(slot: Motion) -> int:
    """Frames at 30 per second that span the slot's frames."""
    return 1 + math.ceil(float(slot.times[-1] - slot.times[0]) * SEGMENT_FPS - 1e-6)


def slot_seed(seed: int, scene_id: str, motion_id: str) -> int:
    """A seed of its own for every room and slot, so that no two sequences share their draws."""
    return int(value_sha256([seed, scene_id, motion_id])[:12], 16)


def as_long_as(vectors: Float[np.ndarray, "T 135"], slot: Motion, nets: SynthesisNets) -> Motion:
    """The sequence at the slot's frame times; what is left over after its last frame is dropped."""
    minutes = nets.note.capture_minutes
    clip = Clip(
        fps=SEGMENT_FPS,
        motion_id=slot.motion_id,
        label="synthesised",
        source=f"motion synthesis (re-implemented, {minutes:.0f} min of capture)",
        body=slot.body,
    )
    motion = at_times(to_motion(vectors, clip), slot.times - slot.times[0], slot.fps)
    return dataclasses.replace(motion, times=slot.times)


def _weighted(refined: Refined) -> dict[str, float]:
    """Terms of the result with the weights of the last phase, as every method returns them."""
    names = zip(refined.terms, PHASES[-1].weights, strict=True)
    terms = {name: weight * refined.terms[name] for name, weight in names}
    return {**terms, "total": sum(terms.values())}


def _info(
    nets: SynthesisNets,
    spots: RoomSpots,
    subgoals: tuple[Spot, ...],
    refined: Refined,
    drawn: int,
) -> dict[str, Any]:
    kinds = sorted({kind for _, kind in spots.furniture})
    return {
        "capture_minutes": nets.note.capture_minutes,
        "recipe": nets.note.recipe,
        "training_seed": nets.note.seed,
        "weights": nets.sha256,
        "seed_of_slot": drawn,
        "segments": len(subgoals) - 1,
        "subgoals": [
            {
                "kind": spot.kind,
                "place": spot.place,
                "pelvis": spot.pelvis.round(4).tolist(),
                "before_frame": SEGMENT * index,
            }
            for index, spot in enumerate(subgoals)
        ],
        "free_cells": len(spots.free),
        "offers": {
            kind: sum(len(found) for key, found in spots.furniture.items() if key[1] == kind)
            for kind in kinds
        },
        "iterations": refined.iterations,
        "stopped": refined.stopped,
        "trace": list(refined.trace),
    }

"""Retargeting: a recording's rotations onto one of our bodies.

World rotations are transferred joint by joint; where the rest poses differ, the rest direction is
corrected first. With UP-right world rotations S of the recording and the minimal rotation D from our
T-pose bone to the recording's rest bone, the target is G = S D.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from experiments.body.model import JOINT_NAMES
from experiments.motion.capture import INDEX, Capture
from experiments.motion.figure import Figure
from experiments.motion.motion import Motion
from experiments.motion.rotations import UPRIGHT, local_pose, shortest_arc

_BONES = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist"}
# Ends of limbs have no bone of their own: soles and palms were drawn along with shank and forearm.
_FOLLOWERS = {"ankle": "knee", "foot": "knee", "wrist": "elbow"}


def retarget(capture: Capture, figure: Figure) -> Motion:
    """The recording on this body, at the recording's own times; the root path scaled by leg length.

    The feet may still slide or float: see `cleanup`.
    """
    world = capture.rotations.copy()
    for joint, correction in rest_corrections(capture, figure).items():
        world[:, joint] = world[:, joint] @ correction
    scale = 1.0 if capture.leg_length is None else sum(figure.leg) / capture.leg_length
    times = capture.times - capture.times[0]
    return Motion(
        pose=local_pose(world),
        transl=_root_translation(world, capture.hip_centre * scale, figure),
        times=times,
        fps=(len(times) - 1) / float(times[-1]),
        motion_id=capture.label.replace(" ", "_"),
        label=capture.label,
        source=capture.source,
        body=figure.body.name,
    )


def rest_corrections(capture: Capture, figure: Figure) -> dict[int, Float[np.ndarray, "3 3"]]:
    """D by joint index: from our T-pose bone to the recording's rest bone, rest axes."""
    corrections: dict[int, Float[np.ndarray, "3 3"]] = {}
    for name, wanted in capture.rest_directions.items():
        side, part = name.split("_")
        bone = figure.rest_joints[INDEX[f"{side}_{_BONES[part]}"]] - figure.rest_joints[INDEX[name]]
        corrections[INDEX[name]] = shortest_arc(bone, wanted)
    for joint, name in enumerate(JOINT_NAMES):
        side, _, part = name.partition("_")
        leader = INDEX.get(f"{side}_{_FOLLOWERS.get(part, '')}")
        if leader in corrections:
            corrections[joint] = corrections[leader]
    return corrections


def _root_translation(
    world: Float[np.ndarray, "T 22 3 3"], hip_centre: Float[np.ndarray, "T 3"], figure: Figure
) -> Float[np.ndarray, "T 3"]:
    pelvis = hip_centre - world[:, 0] @ figure.hip_from_pelvis
    return np.asarray(pelvis - figure.rest_joints[0])


def standing_pose() -> Float[np.ndarray, "22 3"]:
    """The zero pose stood upright in the world: T-pose facing -y."""
    world = np.tile(UPRIGHT, (1, 22, 1, 1))
    return np.asarray(local_pose(world)[0])

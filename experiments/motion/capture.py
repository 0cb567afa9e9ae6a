"""Capture: recorded motion on the recording's own skeleton, before it is retargeted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from experiments.body.model import JOINT_NAMES, PARENTS
from renderer.files import InputError

INDEX: Mapping[str, int] = {name: index for index, name in enumerate(JOINT_NAMES)}
LIMBS: tuple[str, ...] = tuple(
    f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "shoulder", "elbow")
)
"""Joints whose bone has a rest direction of its own in every recording format."""

LEG_RANGE_M = (0.5, 1.2)
"""Hip to ankle along the bones: shorter or longer means wrong units or no adult."""
RATE_RANGE_HZ = (5.0, 1000.0)


@dataclass(frozen=True)
class Capture:
    """What a recording says about the 22 SMPL-X body joints. World: z up, metres.

    `rotations[t, j]` turns the rest axes (y up, facing +z, left = +x) of joint j into the world;
    all equal to `rotations.UPRIGHT` is the recording's own rest pose, standing and facing -y.
    """

    rotations: Float[np.ndarray, "T 22 3 3"]
    hip_centre: Float[np.ndarray, "T 3"]
    """Midpoint of the two hip joints."""
    times: Float[np.ndarray, " T"]
    rest_directions: Mapping[str, Float[np.ndarray, "3"]]
    """Direction of the bone that starts at each joint of LIMBS in the rest pose, rest axes.

    Empty when the recording's rest pose is the T-pose of SMPL-X."""
    leg_length: float | None
    """Hip to ankle along the bones, metres; None where the recording does not tell (AMASS)."""
    label: str
    source: str


def check_leg_length(source: object, field: str, leg_length: float) -> None:
    """Refuse a skeleton whose legs are not those of an adult: nearly always wrong units."""
    low, high = LEG_RANGE_M
    if not low <= leg_length <= high:
        wanted = f"a leg of {low} to {high} m (are the units right?)"
        raise InputError(source, field, f"{leg_length:.4g} m", wanted)


def check_rate(source: object, field: str, rate: float) -> None:
    """Refuse a frame rate that no recording has."""
    low, high = RATE_RANGE_HZ
    if not low <= rate <= high:
        raise InputError(source, field, rate, f"a frame rate from {low:g} to {high:g} Hz")


def fill_unmapped(
    known: Mapping[str, Float[np.ndarray, "T 3 3"]],
) -> Float[np.ndarray, "T 22 3 3"]:
    """Stack the joints a recording has; a joint it lacks moves with its parent."""
    n_frames = len(known["pelvis"])
    rotations = np.zeros((n_frames, len(JOINT_NAMES), 3, 3))
    for joint, name in enumerate(JOINT_NAMES):
        rotations[:, joint] = known[name] if name in known else rotations[:, PARENTS[joint]]
    return rotations

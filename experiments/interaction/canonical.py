"""The frame of the interaction model: pelvis at the origin, yaw removed, and height above the floor."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.ndimage import minimum_filter1d

from experiments.body.model import JOINT_NAMES

FLOOR_WINDOW_S = 0.5
"""The floor below a frame is the lowest vertex within this time before and after it."""

_INDEX = {name: index for index, name in enumerate(JOINT_NAMES)}


def canonical_frames(
    vertices: Float[np.ndarray, "T V 3"], joints: Float[np.ndarray, "T 22 3"]
) -> Float[np.ndarray, "T V 3"]:
    """Vertices (m, z up) relative to the pelvis, turned about the vertical so that the body faces -y.

    POSA (Hassan et al. 2021, section 3.1) removes position and yaw and keeps pitch. Our yaw is that
    of `body_yaw`, which exists for lying bodies too.
    """
    centred = vertices - joints[:, :1]
    yaw = body_yaw(joints)
    cosine, sine = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y = centred[..., 0], centred[..., 1]
    turned = [cosine * x + sine * y, cosine * y - sine * x, centred[..., 2]]
    return np.asarray(np.stack(turned, axis=-1))


def body_yaw(joints: Float[np.ndarray, "T 22 3"]) -> Float[np.ndarray, " T"]:
    """Heading about the vertical, radians; 0 faces -y, positive counter-clockwise from above.

    The hip vector vanishes on the floor plane when one lies on the side, the facing vector when one
    lies on the back; the sum of the facing vector and the left vector turned by -90 degrees, both
    projected on the floor, vanishes only upside down.
    """
    left = _unit(joints[:, _INDEX["left_hip"]] - joints[:, _INDEX["right_hip"]])
    trunk = joints[:, _INDEX["neck"]] - joints[:, _INDEX["pelvis"]]
    facing = _unit(np.cross(left, trunk))
    plane = facing[:, 0] + 1j * facing[:, 1] - 1j * (left[:, 0] + 1j * left[:, 1])
    # The sum points along -y at yaw 0: a quarter turn more makes that the real axis.
    return np.asarray(np.angle(1j * plane))


def height_above_floor(
    vertices: Float[np.ndarray, "T V 3"], times: Float[np.ndarray, " T"]
) -> Float[np.ndarray, "T V"]:
    """Height (m) of every vertex above the clip's floor at that frame.

    That floor is the lowest vertex of all within `FLOOR_WINDOW_S`: a swinging foot keeps its height
    above the ground that the other foot, or the same foot a moment earlier, stood on.
    """
    lowest = vertices[..., 2].min(axis=1)
    reach = round(FLOOR_WINDOW_S / float(np.median(np.diff(times)))) if len(times) > 1 else 0
    floor = minimum_filter1d(lowest, 2 * reach + 1, mode="nearest")
    return np.asarray(vertices[..., 2] - floor[:, None])


def _unit(vector: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector / np.maximum(length, 1e-9))

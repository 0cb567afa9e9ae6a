"""Rotations of joints over time: axis-angle, matrices, quaternions of one hemisphere, the joint chain.

Axis letters: T frames, J joints, N any leading shape flattened by the caller.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from experiments.body.model import PARENTS

UPRIGHT: Float[np.ndarray, "3 3"] = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""From SMPL-X's rest axes (y up, facing +z) to the world (z up): a standing person faces -y."""


def to_matrix(axis_angle: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N 3 3"]:
    """Axis-angle vectors (rad) to rotation matrices."""
    flat = Rotation.from_rotvec(axis_angle.reshape(-1, 3)).as_matrix()
    return np.asarray(flat).reshape(*axis_angle.shape[:-1], 3, 3)


def to_axis_angle(matrix: Float[np.ndarray, "*N 3 3"]) -> Float[np.ndarray, "*N 3"]:
    """Rotation matrices to axis-angle vectors (rad), angles in [0, pi]."""
    flat = Rotation.from_matrix(matrix.reshape(-1, 3, 3)).as_rotvec()
    return np.asarray(flat).reshape(matrix.shape[:-1])


def to_quaternion(axis_angle: Float[np.ndarray, "T *N 3"]) -> Float[np.ndarray, "T *N 4"]:
    """Axis-angle to unit quaternions (x, y, z, w), signs aligned along time so that filters may mix them."""
    flat = Rotation.from_rotvec(axis_angle.reshape(-1, 3)).as_quat()
    quaternion = np.asarray(flat).reshape(*axis_angle.shape[:-1], 4)
    dots = np.sum(quaternion[1:] * quaternion[:-1], axis=-1, keepdims=True)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([quaternion[:1], quaternion[1:] * signs])


def from_quaternion(quaternion: Float[np.ndarray, "*N 4"]) -> Float[np.ndarray, "*N 3"]:
    """Quaternions (x, y, z, w) of any positive length to axis-angle."""
    flat = Rotation.from_quat(quaternion.reshape(-1, 4)).as_rotvec()
    return np.asarray(flat).reshape(*quaternion.shape[:-1], 3)


def slerp(
    start: Float[np.ndarray, "*N 3"], end: Float[np.ndarray, "*N 3"], share: Float[np.ndarray, "*N"]
) -> Float[np.ndarray, "*N 3"]:
    """Axis-angle on the shortest arc from `start` (share 0) to `end` (share 1)."""
    first = to_matrix(start)
    arc = to_axis_angle(np.swapaxes(first, -1, -2) @ to_matrix(end))
    return to_axis_angle(first @ to_matrix(arc * share[..., None]))


def steady_slerp(
    start: Float[np.ndarray, "T 3 3"],
    end: Float[np.ndarray, "T 3 3"],
    share: Float[np.ndarray, " T"],
) -> Float[np.ndarray, "T 3 3"]:
    """Rotations between two moving ones, continuous over time.

    The shortest arc flips where the two come to differ by half a turn; here the arc of each frame is
    the one nearest to that of the frame before.
    """
    arc = to_axis_angle(np.swapaxes(start, -1, -2) @ end)
    for frame in range(1, len(arc)):
        angle = float(np.linalg.norm(arc[frame]))
        other = arc[frame] * (1 - 2 * np.pi / max(angle, 1e-9))
        before = arc[frame - 1]
        if np.linalg.norm(other - before) < np.linalg.norm(arc[frame] - before):
            arc[frame] = other
    return np.asarray(start @ to_matrix(arc * share[:, None]))


def about(axis: str, degrees: Float[np.ndarray, " T"] | float) -> Float[np.ndarray, "*T 3 3"]:
    """Rotation matrices about a coordinate axis, degrees in, one matrix for a number."""
    angles = np.atleast_1d(np.asarray(degrees, dtype=np.float64))
    vectors = np.zeros((len(angles), 3))
    vectors[:, "xyz".index(axis)] = np.radians(angles)
    matrices = to_matrix(vectors)
    return matrices[0] if np.ndim(degrees) == 0 else matrices


def shortest_arc(
    start: Float[np.ndarray, "*N 3"], end: Float[np.ndarray, "*N 3"]
) -> Float[np.ndarray, "*N 3 3"]:
    """The smallest rotation that turns direction `start` into direction `end` (not for opposite ones)."""
    first, second = unit(start), unit(end)
    axis = np.cross(first, second)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    cosine = np.sum(first * second, axis=-1, keepdims=True)
    angle = np.arctan2(sine, cosine)
    return to_matrix(axis * angle / np.maximum(sine, 1e-12))


def unit(vector: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N 3"]:
    """Vectors scaled to length one; zero stays zero."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector / np.maximum(length, 1e-12))


def world_rotations(pose: Float[np.ndarray, "T 22 3"]) -> Float[np.ndarray, "T 22 3 3"]:
    """World rotation of every joint from the rotations relative to the parents."""
    world = to_matrix(pose)
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            world[:, joint] = world[:, parent] @ world[:, joint]
    return world


def local_pose(world: Float[np.ndarray, "T 22 3 3"]) -> Float[np.ndarray, "T 22 3"]:
    """Inverse of `world_rotations`: pose as axis-angle relative to the parents."""
    local = world.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            local[:, joint] = np.swapaxes(world[:, parent], -1, -2) @ world[:, joint]
    return to_axis_angle(local)


def joint_positions(
    world: Float[np.ndarray, "T 22 3 3"],
    transl: Float[np.ndarray, "T 3"],
    rest_joints: Float[np.ndarray, "22 3"],
) -> Float[np.ndarray, "T 22 3"]:
    """World positions of the joints (m) of a body with these rest joints."""
    positions = np.zeros(world.shape[:-1])
    positions[:, 0] = rest_joints[0] + transl
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            bone = rest_joints[joint] - rest_joints[parent]
            positions[:, joint] = positions[:, parent] + world[:, parent] @ bone
    return positions

"""Skinning the slow and obvious way: one 4 x 4 matrix a joint and frame, blended vertex by vertex.

Kept beside the fast product of `experiments/body/skinning.py`; a test demands that both agree.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from experiments.body.model import PARENTS


def skin_slowly(
    points: Float[np.ndarray, "V 22 4"],
    rest_joints: Float[np.ndarray, "22 3"],
    pose: Float[np.ndarray, "22 3"],
    transl: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "V 3"]:
    """Posed vertices of one frame, metres: the sum over joints of T_j (p_vj, w_vj)."""
    transforms = joint_matrices(rest_joints, pose, transl)
    posed = np.zeros((len(points), 3))
    for vertex, entries in enumerate(points):
        for joint in np.flatnonzero(entries[:, 3]):
            posed[vertex] += (transforms[joint] @ entries[joint])[:3]
    return posed


def joint_matrices(
    rest_joints: Float[np.ndarray, "22 3"],
    pose: Float[np.ndarray, "22 3"],
    transl: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "22 4 4"]:
    """For every joint the rigid motion of space that carries rest points to their posed place."""
    transforms = np.zeros((22, 4, 4))
    for joint, parent in enumerate(PARENTS):
        about_joint = np.eye(4)
        about_joint[:3, :3] = Rotation.from_rotvec(pose[joint]).as_matrix()
        about_joint[:3, 3] = rest_joints[joint] - about_joint[:3, :3] @ rest_joints[joint]
        above = _shift(transl) if parent < 0 else transforms[parent]
        transforms[joint] = above @ about_joint
    return transforms


def _shift(transl: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
    matrix = np.eye(4)
    matrix[:3, 3] = transl
    return matrix

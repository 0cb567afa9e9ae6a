"""A body as a textbook rig: one template, joints with helper bones and few influences a vertex.

Our bodies keep a rest point of their own for every (vertex, joint), because several bones of the
source rig were merged into one joint. File formats know one template only: vertex v is posed to
sum_k w_k G_k (v - h_k). With the 22 joints alone that is centimetres off. A *helper bone* of joint j
is a rigid child of j, displaced by s_k. With four helpers at the corners of a tetrahedron any mean
displacement inside it is a convex combination, so that sum_k w_k R_j (v + s_k - h_j) gives joint j the
rest point that it wants.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Integer

from experiments.body.model import JOINT_NAMES, PARENTS

MAX_INFLUENCES = 16
"""Four sets of four in glTF. With eight, one vertex in a hundred is 8 mm off; few need more than five."""
NEGLIGIBLE_M = 2e-4
"""A rest point this far off (times its weight) is not worth a helper bone."""
_CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0)


@dataclass(frozen=True)
class Rig:
    """Joints (the 22 of the body first, helper bones after) and a skin with K influences a vertex.

    Rest frame of the body: y up, facing +z, metres.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Float[np.ndarray, "J 3"]
    """Position of each joint in its parent's frame; of the root in the rest frame."""
    binds: Float[np.ndarray, "J 3"]
    """h_k: the rest point that is subtracted before joint k turns a vertex."""
    rest_vertices: Float[np.ndarray, "V 3"]
    joints: Integer[np.ndarray, "V K"]
    weights: Float[np.ndarray, "V K"]
    """Rows are not negative, sum to one and fall; joint 0 where a weight is 0."""

    def posed(
        self, rotations: Float[np.ndarray, "T 22 3 3"], positions: Float[np.ndarray, "T 22 3"]
    ) -> Float[np.ndarray, "T V 3"]:
        """Skinned vertices for the world rotations and positions of the body's joints."""
        owner = np.array([j if j < 22 else self.parents[j] for j in range(len(self.names))])
        shift = np.where(np.arange(len(owner))[:, None] < 22, 0.0, self.offsets)
        turned = rotations[:, owner]
        origin = positions[:, owner] + np.einsum("tjab,jb->tja", turned, shift - self.binds)
        blended = np.zeros((len(rotations), len(self.rest_vertices), 3))
        for column in range(self.joints.shape[1]):
            joint, weight = self.joints[:, column], self.weights[:, column]
            used = np.flatnonzero(weight)
            local = np.einsum("tvab,vb->tva", turned[:, joint[used]], self.rest_vertices[used])
            blended[:, used] += weight[used, None] * (local + origin[:, joint[used]])
        return blended


def helper_rig(points: Float[np.ndarray, "V 22 4"], rest_joints: Float[np.ndarray, "22 3"]) -> Rig:
    """The rig whose skin comes closest to that of a body of rest points (`SkinnedBody.points`)."""
    weights = points[:, :, 3]
    template, shifts = _template(points)
    wants = (weights * np.linalg.norm(shifts, axis=2)) > NEGLIGIBLE_M
    dense = np.where(wants, 0.0, weights)
    names, parents = list(JOINT_NAMES), list(PARENTS)
    offsets = [*_local(rest_joints)]
    for joint in np.flatnonzero(wants.any(0)):
        rows = np.flatnonzero(wants[:, joint])
        corners = _simplex(shifts[rows, joint])
        share = np.zeros((len(dense), 4))
        share[rows] = weights[rows, joint, None] * _barycentric(shifts[rows, joint], corners)
        dense = np.concatenate([dense, share], axis=1)
        names += [f"{JOINT_NAMES[joint]}_helper_{number}" for number in range(1, 5)]
        parents += [int(joint)] * 4
        offsets += [*corners]
    owner = np.array([j if j < 22 else parents[j] for j in range(len(parents))])
    joints, kept = _strongest(dense, owner)
    return Rig(
        tuple(names), tuple(parents), np.array(offsets), rest_joints[owner], template, joints, kept
    )


def _template(
    points: Float[np.ndarray, "V 22 4"],
) -> tuple[Float[np.ndarray, "V 3"], Float[np.ndarray, "V 22 3"]]:
    """One rest point a vertex, and how far from it every joint wants the vertex (0 where unused).

    The rest point is that of the joint which leaves the fewest other joints in want of helpers.
    """
    weights = points[:, :, 3]
    used = weights > 0
    rest = points[:, :, :3] / np.where(used, weights, 1.0)[:, :, None]
    apart = np.linalg.norm(rest[:, :, None] - rest[:, None], axis=3) * weights[:, None, :]
    cost = (apart > NEGLIGIBLE_M).sum(2) + 0.5 * apart.sum(2) - 1e-3 * weights
    chosen = np.where(used, cost, np.inf).argmin(1)
    template = rest[np.arange(len(rest)), chosen]
    return template, np.where(used[:, :, None], rest - template[:, None], 0.0)


def _local(rest_joints: Float[np.ndarray, "22 3"]) -> Float[np.ndarray, "22 3"]:
    parent = np.array(PARENTS)
    return np.where(parent[:, None] < 0, rest_joints, rest_joints - rest_joints[parent])


def _simplex(shifts: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "4 3"]:
    """Corners of a tetrahedron that holds all these points, stretched along their main axes."""
    centre = 0.5 * (shifts.min(0) + shifts.max(0))
    _, _, axes = np.linalg.svd(shifts - centre, full_matrices=True)
    along = (shifts - centre) @ axes.T
    reach = np.maximum(np.abs(along).max(0), 1e-3)
    # The tetrahedron whose inscribed sphere has radius r has its corners at distance 3 r. A single
    # point has no extent, hence the floor.
    spread = max(1.0, float(np.linalg.norm(along / reach, axis=1).max()))
    radius = 3.0 * spread * (1 + 1e-9)
    corners: Float[np.ndarray, "4 3"] = centre + (radius * _CORNERS * reach) @ axes
    return corners


def _barycentric(
    shifts: Float[np.ndarray, "N 3"], corners: Float[np.ndarray, "4 3"]
) -> Float[np.ndarray, "N 4"]:
    system = np.concatenate([corners.T, np.ones((1, 4))])
    wanted = np.concatenate([shifts, np.ones((len(shifts), 1))], axis=1)
    shares: Float[np.ndarray, "N 4"] = np.linalg.solve(system, wanted.T).T.clip(0.0)
    return shares


def _strongest(
    dense: Float[np.ndarray, "V J"], owner: Integer[np.ndarray, " J"]
) -> tuple[Integer[np.ndarray, "V K"], Float[np.ndarray, "V K"]]:
    """The largest weights of each row; what is cut goes to the same joint's others, else to all."""
    order = np.argsort(-dense, axis=1, kind="stable")[:, :MAX_INFLUENCES]
    kept = np.zeros_like(dense)
    np.put_along_axis(kept, order, np.take_along_axis(dense, order, axis=1), axis=1)
    member = (owner[:, None] == np.arange(22)).astype(float)
    before, after = dense @ member, kept @ member
    kept = kept * (before / np.where(after > 0, after, 1.0))[:, owner]
    kept /= kept.sum(1, keepdims=True)
    order = np.argsort(-kept, axis=1, kind="stable")[:, :MAX_INFLUENCES]
    weights = np.take_along_axis(kept, order, axis=1)
    return np.where(weights > 0, order, 0), weights

"""A body of arrays: the implementation of `BodyModel` that every body source fills."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float, Integer
from torch import Tensor

from experiments.body.kinematics import forward_kinematics, rotation_matrices
from experiments.body.model import BodyMesh
from experiments.body.skinning import joint_translations, skin


@dataclass(eq=False)
class SkinnedBody:
    """One adult, skinned on the 22 SMPL-X body joints. Implements `experiments.body.model.BodyModel`.

    Rest frame: SMPL-X axes (y up, facing +z, left = +x), T-pose, metres.
    """

    name: str
    faces: Integer[np.ndarray, "F 3"]
    body_component: Integer[np.ndarray, " K"]
    subset: Integer[np.ndarray, " S"]
    subset_faces: Integer[np.ndarray, "G 3"]
    regions: dict[str, Integer[np.ndarray, " _"]]
    contact_rows: Integer[np.ndarray, " C"]
    """Vertices beside `subset` that thicken its thin contact areas (soles, buttocks, thighs, back)."""
    rest_joints: Float[np.ndarray, "22 3"]
    points: Float[np.ndarray, "V 22 4"]
    """For every vertex and joint the weighted rest point p_vj and, last, the weight w_vj."""
    pose_offsets: Float[np.ndarray, "V 3 189"] | None = None
    """Pose blend shapes (SMPL, Loper et al. 2015, eq. 9): metres per entry of R_1..R_21 - I."""
    n_vertices: int = field(init=False)
    """Number of vertices V of the full mesh."""
    _tensors: dict[tuple[str, torch.dtype, torch.device], Tensor] = field(
        default_factory=dict, repr=False
    )

    def __post_init__(self) -> None:
        self.n_vertices = len(self.points)

    @property
    def weights(self) -> Float[np.ndarray, "V 22"]:
        """Skinning weights: rows sum to one."""
        return self.points[:, :, 3]

    @property
    def rest_vertices(self) -> Float[np.ndarray, "V 3"]:
        """The full mesh in the zero pose (T-pose, y up, facing +z), metres."""
        return np.asarray(self.points[:, :, :3].sum(axis=1))

    def posed(
        self,
        pose: Float[Tensor, "T 22 3"],
        transl: Float[Tensor, "T 3"],
        vertex_ids: Integer[np.ndarray, " V"] | None = None,
    ) -> BodyMesh:
        """Skin the vertices named (all if None); see `BodyModel.posed`.

        Computed in the precision and on the device of `pose`. The vertices are a permuted view
        (not contiguous).
        """
        rotations, positions = self.joint_transforms(pose, transl)
        rest_joints = self._tensor("rest_joints", pose)
        rows = (
            None if vertex_ids is None else torch.as_tensor(vertex_ids).to(pose.device, torch.int64)
        )
        points = self._rows("points", pose, rows)
        translations = joint_translations(rotations, positions, rest_joints)
        vertices = skin(points, rotations, translations)
        if self.pose_offsets is not None:
            offsets = self._rows("pose_offsets", pose, rows)
            vertices = vertices + _pose_correction(points, offsets, pose, rotations)
        return BodyMesh(vertices, positions, self._faces_of(vertex_ids))

    def joint_transforms(
        self, pose: Float[Tensor, "T 22 3"], transl: Float[Tensor, "T 3"]
    ) -> tuple[Float[Tensor, "T 22 3 3"], Float[Tensor, "T 22 3"]]:
        """World rotation and position (metres) of every joint."""
        return forward_kinematics(pose, transl, self._tensor("rest_joints", pose))

    def _faces_of(self, vertex_ids: Integer[np.ndarray, " V"] | None) -> Integer[np.ndarray, "F 3"]:
        if vertex_ids is None:
            return self.faces
        if np.array_equal(vertex_ids, self.subset):
            return self.subset_faces
        return np.zeros((0, 3), dtype=self.faces.dtype)

    def _rows(self, array: str, like: Tensor, rows: Tensor | None) -> Tensor:
        table = self._tensor(array, like)
        return table if rows is None else table.index_select(0, rows)

    def _tensor(self, array: str, like: Tensor) -> Tensor:
        """One of the arrays, in the precision and on the device of `like`."""
        key = (array, like.dtype, like.device)
        if key not in self._tensors:
            values = np.asarray(getattr(self, array))
            flat = values if array == "rest_joints" else values.reshape(len(values), -1)
            self._tensors[key] = torch.as_tensor(flat).to(like)
        return self._tensors[key]


def _pose_correction(
    points: Float[Tensor, "V 88"],
    offsets: Float[Tensor, "V 567"],
    pose: Float[Tensor, "T 22 3"],
    rotations: Float[Tensor, "T 22 3 3"],
) -> Float[Tensor, "T V 3"]:
    """Pose blend shapes, carried to the posed frame by each vertex's blended rotation."""
    local = rotation_matrices(pose[:, 1:])
    features = (local - torch.eye(3, dtype=pose.dtype, device=pose.device)).flatten(1)
    rest = torch.einsum("vaf,tf->tva", offsets.reshape(len(offsets), 3, -1), features)
    blended = torch.einsum("vj,tjab->tvab", points[:, 3::4], rotations)
    return (blended @ rest[..., None]).squeeze(-1)

"""The body model protocol: 22 SMPL-X body joints in, joints and chosen vertices out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Integer
from torch import Tensor

JOINT_NAMES: tuple[str, ...] = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2",
    "left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck",
    "left_collar", "right_collar", "head", "left_shoulder", "right_shoulder",
    "left_elbow", "right_elbow", "left_wrist", "right_wrist",
)  # fmt: skip
PARENTS: tuple[int, ...] = (
    -1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19,
)  # fmt: skip


@dataclass(frozen=True)
class BodyMesh:
    """A posed body: the output of a `BodyModel`. World frame, z up, metres."""

    vertices: Float[Tensor, "T V 3"]
    joints: Float[Tensor, "T 22 3"]
    faces: Integer[np.ndarray, "F 3"]


@runtime_checkable
class BodyModel(Protocol):
    """Linear blend skinning of one adult on the 22 SMPL-X body joints.

    Vertices are numbered once, on the full render mesh. `subset` is the index list of the small
    optimisation mesh in it, `subset_faces` its closed surface in subset numbering.
    """

    name: str
    n_vertices: int
    faces: Integer[np.ndarray, "F 3"]
    """Triangles of the full mesh (body component and eyes/teeth), in full numbering."""
    body_component: Integer[np.ndarray, " K"]
    """Full-mesh vertices of the outer skin (no eyes, no teeth): use these for geometry."""
    subset: Integer[np.ndarray, " S"]
    subset_faces: Integer[np.ndarray, "G 3"]
    regions: dict[str, Integer[np.ndarray, " R"]]
    """Named index lists in full numbering: left_sole, right_sole, buttocks, thigh_backs, back,
    left_palm, right_palm, left_hand, right_hand, forearms, calves."""
    contact_rows: Integer[np.ndarray, " C"]
    """Vertices beside `subset` that thicken its thin contact areas (soles, buttocks, thighs, back)."""
    rest_joints: Float[np.ndarray, "22 3"]
    """Joint positions of the zero pose, SMPL-X axes (y up, facing +z), metres."""

    def posed(
        self,
        pose: Float[Tensor, "T 22 3"],
        transl: Float[Tensor, "T 3"],
        vertex_ids: Integer[np.ndarray, " V"] | None = None,
    ) -> BodyMesh:
        """Skin the vertices named (all if None), batched over frames, differentiable.

        `transl` is added to the posed body (SMPL-X convention: the pelvis joint then stands at
        `rest_joints[0] + transl`). Only the vertices asked for are computed. `faces` of the answer
        are those of the full mesh if all vertices are asked for, of the small mesh if exactly
        `subset` is, and empty otherwise.
        """
        ...

    def joint_transforms(
        self, pose: Float[Tensor, "T 22 3"], transl: Float[Tensor, "T 3"]
    ) -> tuple[Float[Tensor, "T 22 3 3"], Float[Tensor, "T 22 3"]]:
        """World rotation and position of every joint."""
        ...

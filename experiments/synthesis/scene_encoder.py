"""The scene encoder of all three networks, and the points it reads of a room.

After Wang et al., "Synthesizing Long-Term 3D Human Motion and Interaction in 3D Scenes" (CVPR 2021):
a point network (Qi et al. 2017) 3-64-128-256 whose layers are normalised over the points of a scene
(instance normalisation without learned scale), then a maximum over the points.
"""

from __future__ import annotations

import itertools

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from experiments.scene.scene import Scene

FEATURE_SIZE = 256
N_POINTS = 4096
POINT_SEED = 0
"""Seed of the points of a room: the same in training and use, so that features can be kept."""


class SceneEncoder(nn.Module):
    """(R, N, 3) points of R rooms, metres in the room's frame, to (R, 256) features.

    The answer depends on the room alone: compute it once for many bodies.
    """

    def __init__(self) -> None:
        super().__init__()
        widths = (3, 64, 128, FEATURE_SIZE)
        self.layers = nn.ModuleList(
            nn.Linear(width, wider) for width, wider in itertools.pairwise(widths)
        )

    def forward(self, points: Float[Tensor, "R N 3"]) -> Float[Tensor, "R 256"]:
        """Encode every room."""
        values = points
        for layer in self.layers:
            values = torch.relu(_over_points(layer(values)))
        return values.amax(dim=1)


def scene_points(
    scene: Scene, seed: int = POINT_SEED, count: int = N_POINTS
) -> Float[np.ndarray, "N 3"]:
    """Random points on the surfaces of a room, uniform by area, metres; float32."""
    rng = np.random.default_rng(seed)
    corners = scene.vertices[scene.faces].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    face = rng.choice(len(corners), size=count, p=area / area.sum())
    u, v = rng.random((2, count))
    over = u + v > 1
    u, v = np.where(over, 1 - u, u)[:, None], np.where(over, 1 - v, v)[:, None]
    a, b, c = corners[face, 0], corners[face, 1], corners[face, 2]
    points: Float[np.ndarray, "N 3"] = (a + u * (b - a) + v * (c - a)).astype(np.float32)
    return points


def _over_points(values: Float[Tensor, "R N C"]) -> Float[Tensor, "R N C"]:
    """Zero mean and unit variance over the points of each room and channel."""
    mean = values.mean(dim=1, keepdim=True)
    variance = values.var(dim=1, keepdim=True, unbiased=False)
    return (values - mean) / torch.sqrt(variance + 1e-5)

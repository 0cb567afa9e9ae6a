"""PoseNet: the joint rotations along a route between two sub-goals (Wang et al., CVPR 2021, 3.3)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from experiments.synthesis.body_vector import POSE_SIZE, STATE_SIZE
from experiments.synthesis.route_net import SEGMENT
from experiments.synthesis.scene_encoder import FEATURE_SIZE, SceneEncoder


class PoseNet(nn.Module):
    """Start and end pose, the route and the room, to 60 poses in between."""

    def __init__(self) -> None:
        super().__init__()
        self.scene = SceneEncoder()
        self.lstm = nn.LSTM(POSE_SIZE, 256, bidirectional=True, batch_first=True)
        self.scene_in = nn.Linear(FEATURE_SIZE, 32)
        self.route_in = nn.Linear(SEGMENT * STATE_SIZE, 64)
        self.hidden = nn.Linear(2 * 2 * 256 + 32 + 64, 1024)
        self.out = nn.Linear(1024, SEGMENT * POSE_SIZE)

    def forward(
        self,
        feature: Float[Tensor, "B 256"],
        ends: Float[Tensor, "B 2 126"],
        route: Float[Tensor, "B 60 9"],
    ) -> Float[Tensor, "B 60 126"]:
        """`ends` are the poses one frame before the first and one frame after the last."""
        poses, _ = self.lstm(ends)
        context = [poses.flatten(1), self.scene_in(feature), self.route_in(route.flatten(1))]
        found: Tensor = self.out(torch.relu(self.hidden(torch.cat(context, dim=1))))
        return found.reshape(-1, SEGMENT, POSE_SIZE)

"""RouteNet: the root states of the 60 frames between two sub-goals (Wang et al., CVPR 2021, 3.2)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from experiments.synthesis.body_vector import STATE_SIZE
from experiments.synthesis.scene_encoder import FEATURE_SIZE, SceneEncoder

SEGMENT = 60
"""Frames between two sub-goals: 2 s at 30 frames per second."""
SEGMENT_FPS = 30.0


class RouteNet(nn.Module):
    """Start and end state, and the room, to 60 states in between."""

    def __init__(self) -> None:
        super().__init__()
        self.scene = SceneEncoder()
        self.lstm = nn.LSTM(STATE_SIZE, 64, bidirectional=True, batch_first=True)
        self.scene_in = nn.Linear(FEATURE_SIZE, 32)
        self.hidden = nn.Linear(2 * 2 * 64 + 32, 256)
        self.out = nn.Linear(256, SEGMENT * STATE_SIZE)

    def forward(
        self, feature: Float[Tensor, "B 256"], ends: Float[Tensor, "B 2 9"]
    ) -> Float[Tensor, "B 60 9"]:
        """`ends` are the states one frame before the first and one frame after the last."""
        states, _ = self.lstm(ends)
        values = torch.cat([states.flatten(1), self.scene_in(feature)], dim=1)
        route: Tensor = self.out(torch.relu(self.hidden(values)))
        return route.reshape(-1, SEGMENT, STATE_SIZE)

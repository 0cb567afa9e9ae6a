"""The sub-goal network: what a body looks like at a given place and heading in a given room.

A conditional variational auto-encoder after Wang et al. (CVPR 2021), section 3.1, at the widths of
their code: condition 275 -> 512, body -> 512, two residual blocks of width 1024 each way, latent 32.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from experiments.synthesis.body_vector import DESCRIPTOR_SIZE, SIZE, STATE_SIZE
from experiments.synthesis.scene_encoder import FEATURE_SIZE, SceneEncoder

LATENT_SIZE = 32


class SubgoalNet(nn.Module):
    """p(body vector | room, root state, body shape). Root state: translation and 6D orientation."""

    def __init__(self) -> None:
        super().__init__()
        self.scene = SceneEncoder()
        self.condition = nn.Linear(FEATURE_SIZE + STATE_SIZE + DESCRIPTOR_SIZE, 512)
        self.body_in = nn.Linear(SIZE, 512)
        self.encoder = nn.Sequential(_ResidualBlock(1024), _ResidualBlock(1024))
        self.mean = nn.Linear(1024, LATENT_SIZE)
        self.log_variance = nn.Linear(1024, LATENT_SIZE)
        self.latent_in = nn.Linear(LATENT_SIZE, 512)
        self.decoder = nn.Sequential(_ResidualBlock(1024), _ResidualBlock(1024))
        self.body_out = nn.Linear(1024, SIZE)

    def forward(
        self,
        feature: Float[Tensor, "B 256"],
        state: Float[Tensor, "B 9"],
        shape: Float[Tensor, "B 10"],
        body: Float[Tensor, "B 135"],
        noise: Float[Tensor, "B 32"],
    ) -> tuple[Float[Tensor, "B 135"], Float[Tensor, "B 32"], Float[Tensor, "B 32"]]:
        """Reconstruction, mean and log variance of the latent; `noise` is standard normal."""
        condition = self.conditioned(feature, state, shape)
        hidden = self.encoder(torch.cat([self.body_in(body), condition], dim=1))
        mean, log_variance = self.mean(hidden), self.log_variance(hidden)
        latent = mean + noise * torch.exp(0.5 * log_variance)
        return self.decoded(condition, latent), mean, log_variance

    def sample(
        self,
        feature: Float[Tensor, "B 256"],
        state: Float[Tensor, "B 9"],
        shape: Float[Tensor, "B 10"],
        latent: Float[Tensor, "B 32"],
    ) -> Float[Tensor, "B 135"]:
        """Bodies of latent vectors drawn from the standard normal prior."""
        return self.decoded(self.conditioned(feature, state, shape), latent)

    def conditioned(
        self,
        feature: Float[Tensor, "B 256"],
        state: Float[Tensor, "B 9"],
        shape: Float[Tensor, "B 10"],
    ) -> Float[Tensor, "B 512"]:
        """The condition as both halves of the network read it."""
        values: Tensor = self.condition(torch.cat([feature, state, shape], dim=1))
        return values

    def decoded(
        self, condition: Float[Tensor, "B 512"], latent: Float[Tensor, "B 32"]
    ) -> Float[Tensor, "B 135"]:
        """The decoder."""
        hidden = torch.cat([self.latent_in(latent), condition], dim=1)
        values: Tensor = self.body_out(self.decoder(hidden))
        return values


class _ResidualBlock(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = nn.Linear(width, width)
        self.second = nn.Linear(width, width)

    def forward(self, values: Float[Tensor, "B W"]) -> Float[Tensor, "B W"]:
        hidden = nn.functional.leaky_relu(self.first(values))
        return values + nn.functional.leaky_relu(self.second(hidden))

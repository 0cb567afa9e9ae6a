"""The conditional VAE of human-scene interaction: given a posed body, which vertex touches what.

The task, the inputs and the outputs are POSA's (Hassan et al., CVPR 2021, section 3.2): a body in its
canonical frame goes in, one contact probability and one class distribution a vertex come out,
and a latent code z stands for all that the pose leaves open. The architecture is ours: `spiral.py`
holds POSA's.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Integer
from torch import Tensor, nn
from torch.nn import functional

LOG_VAR_RANGE = (-8.0, 4.0)
NEAR_M = (0.05, 0.015)
"""Scales at which the closeness to the lowest, foremost and rearmost vertex is felt, metres."""
EDGE_WIDTH_M = 0.002
"""How soft the step is by which a vertex counts as nearer to the floor than a label's thickness."""

FLOOR_REACH_M = 0.02
"""How fast that step fades above the floor: what is higher is the other layers' to judge."""
FLOOR_GAIN = 15.0
"""What the step adds to the logit of contact before training: at first the network is the height rule."""


@dataclass(frozen=True)
class NetworkShape:
    """Sizes of a network; all that its tensors' shapes depend on."""

    architecture: str
    """`point` (ours) or `spiral` (POSA's)."""
    classes: tuple[int, ...]
    """mpcat40 indices of the C classes that it tells apart, ascending; the first is void."""
    n_vertices: int
    latent: int = 16
    width: int = 64
    edge_m: float = 0.02
    """Height above the floor at which `point` places its step: the thickness of the labels, metres."""

    @property
    def n_classes(self) -> int:
        """C, with void."""
        return len(self.classes)


class ContactNetwork(nn.Module):
    """What every architecture offers. Axes: B bodies, V vertices, C classes, Z latent dimensions."""

    shape: NetworkShape
    class_temperature: float = 1.0
    """Divides the class logits of `decode`; fitted after training (`fit_class_temperature`)."""

    def encode(
        self,
        vertices: Float[Tensor, "B V 3"],
        height: Float[Tensor, "B V"],
        contact: Float[Tensor, "B V"],
        label: Integer[Tensor, "B V"],
    ) -> tuple[Float[Tensor, "B Z"], Float[Tensor, "B Z"]]:
        """Mean and logarithm of the variance of q(z | body, contact, label); `label` counts in C."""
        raise NotImplementedError

    def decode(
        self,
        vertices: Float[Tensor, "B V 3"],
        height: Float[Tensor, "B V"],
        z: Float[Tensor, "B Z"],
    ) -> tuple[Float[Tensor, "B V"], Float[Tensor, "B V C"]]:
        """Logits of contact and of the classes, p(contact, label | body, z).

        `vertices` in the canonical frame and `height` above the clip's floor, both metres.
        """
        raise NotImplementedError


class PointNetwork(ContactNetwork):
    """One small network shared by all vertices, steered by a code of the whole body and by z.

    A vertex brings its place, an embedding of its own, its height above the floor and how far it is
    above, behind and ahead of the lowest, foremost and rearmost vertex of its body part: surfaces
    touch there first. A head for each body part lets z switch whole supports on and off. Whether it
    is lower than the label's thickness goes round the layers, straight to the answer: on open floor
    that step is the label, and layers trained in half precision would blur it.
    """

    parts: Tensor
    members: Tensor

    def __init__(self, shape: NetworkShape, parts: Integer[Tensor, " V"]) -> None:
        super().__init__()
        self.shape = shape
        self.register_buffer("parts", parts.to(torch.int64))
        self.register_buffer("members", part_members(parts), persistent=False)
        width, out = shape.width, 1 + shape.n_classes
        n_parts = int(parts.max()) + 1
        inputs = 3 + 4 + 4 * len(NEAR_M) + 1 + 16
        self.embedding = nn.Parameter(0.1 * torch.randn(shape.n_vertices, 16))
        self.body = nn.Sequential(
            nn.Linear(3 * shape.n_vertices + 1, 256),
            nn.LayerNorm(256),
            nn.ReLU(),
            nn.Linear(256, 128),
        )
        self.see = nn.Sequential(
            nn.Linear(inputs + out, width), nn.ReLU(), nn.Linear(width, 128), nn.ReLU()
        )
        self.posterior = nn.Sequential(
            nn.Linear(3 * 128, 256), nn.ReLU(), nn.Linear(256, 2 * shape.latent)
        )
        self.steer = nn.Sequential(nn.Linear(128 + shape.latent, 256), nn.ReLU())
        self.film = nn.Linear(256, 3 * width)
        self.enter = nn.Linear(inputs, width)
        self.residual = nn.Linear(width, width)
        self.leave = nn.Linear(width, width)
        self.answer = nn.Linear(width, out)
        self.vertex_bias = nn.Parameter(torch.zeros(shape.n_vertices, out))
        self.by_floor = nn.Parameter(torch.zeros(n_parts, out))
        with torch.no_grad():
            self.by_floor[:, 0] = FLOOR_GAIN
        self.part_head = nn.Linear(256, n_parts * out)

    def encode(
        self,
        vertices: Float[Tensor, "B V 3"],
        height: Float[Tensor, "B V"],
        contact: Float[Tensor, "B V"],
        label: Integer[Tensor, "B V"],
    ) -> tuple[Float[Tensor, "B Z"], Float[Tensor, "B Z"]]:
        """See `ContactNetwork.encode`."""
        classes = functional.one_hot(label.long(), self.shape.n_classes).to(vertices.dtype)
        inputs = self._inputs(vertices, height)
        seen = self.see(torch.cat([inputs, contact[..., None], classes], dim=-1))
        pooled = torch.cat([seen.amax(1), seen.mean(1), self._body(vertices, height)], dim=-1)
        return split_posterior(self.posterior(pooled))

    def decode(
        self,
        vertices: Float[Tensor, "B V 3"],
        height: Float[Tensor, "B V"],
        z: Float[Tensor, "B Z"],
    ) -> tuple[Float[Tensor, "B V"], Float[Tensor, "B V C"]]:
        """See `ContactNetwork.decode`."""
        code = self.steer(torch.cat([self._body(vertices, height), z], dim=-1))
        scale, shift, late = self.film(code)[:, None].chunk(3, dim=-1)
        inputs = self._inputs(vertices, height)
        hidden = functional.relu(self.enter(inputs) * (1 + scale) + shift)
        hidden = hidden + functional.relu(self.residual(hidden))
        hidden = functional.relu(self.leave(hidden) + late)
        by_part = self.part_head(code).unflatten(-1, (-1, 1 + self.shape.n_classes))
        floor = self._below_edge(height)[..., None] * self.by_floor[self.parts]
        logits = self.answer(hidden) + self.vertex_bias + by_part[:, self.parts] + floor
        return logits[..., 0], logits[..., 1:] / self.class_temperature

    def _body(
        self, vertices: Float[Tensor, "B V 3"], height: Float[Tensor, "B V"]
    ) -> Float[Tensor, "B 128"]:
        pelvis = (height - vertices[..., 2]).mean(1, keepdim=True)
        code: Float[Tensor, "B 128"] = self.body(torch.cat([vertices.flatten(1), pelvis], dim=-1))
        return code

    def _inputs(
        self, vertices: Float[Tensor, "B V 3"], height: Float[Tensor, "B V"]
    ) -> Float[Tensor, "B V I"]:
        of_part = vertices[:, self.members]
        low, front = of_part[..., 2].amin(-1), of_part[..., 1].amin(-1)
        rear = of_part[..., 1].amax(-1)
        gaps = torch.stack(
            [
                height,
                vertices[..., 2] - low[:, self.parts],
                vertices[..., 1] - front[:, self.parts],
                rear[:, self.parts] - vertices[..., 1],
            ],
            dim=-1,
        )
        near = [2 * torch.exp(-gaps.clamp(min=0) / scale) for scale in NEAR_M]
        embedding = self.embedding.expand(len(vertices), -1, -1)
        edge = self._below_edge(height)[..., None]
        return torch.cat([vertices, gaps, *near, edge, embedding], dim=-1)

    def _below_edge(self, height: Float[Tensor, "B V"]) -> Float[Tensor, "B V"]:
        """1 below the edge, negative just above it, fading to 0 where the floor has no say."""
        below = self.shape.edge_m - height
        return torch.tanh(below / EDGE_WIDTH_M) * torch.exp(below.clamp(max=0) / FLOOR_REACH_M)


def split_posterior(
    both: Float[Tensor, "B Z2"],
) -> tuple[Float[Tensor, "B Z"], Float[Tensor, "B Z"]]:
    """Mean and clamped log variance out of one layer's output."""
    mean, log_var = both.chunk(2, dim=-1)
    return mean, log_var.clamp(*LOG_VAR_RANGE)


def sample_posterior(
    mean: Float[Tensor, "B Z"], log_var: Float[Tensor, "B Z"], noise: Float[Tensor, "B Z"]
) -> Float[Tensor, "B Z"]:
    """z = mean + standard deviation * noise (Kingma and Welling 2014)."""
    return mean + torch.exp(0.5 * log_var) * noise


def part_members(parts: Integer[Tensor, " V"]) -> Integer[Tensor, "P M"]:
    """Vertices of every part, each row padded with its own first vertex to the longest row."""
    rows = [torch.nonzero(parts == part)[:, 0] for part in range(int(parts.max()) + 1)]
    longest = max(len(row) for row in rows)
    return torch.stack([torch.cat([row, row[:1].expand(longest - len(row))]) for row in rows])

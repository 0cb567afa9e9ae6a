"""POSA's network: spiral convolutions over the body mesh (Hassan et al. 2021; Gong et al. 2019).

Layers, widths and order follow POSA; the mesh is ours (feature vertices, two halvings by quadric
collapse), and so is the rule that makes spirals, which is a function of the triangles alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Integer
from torch import Tensor, nn
from torch.nn import functional

from experiments.body.decimate import closed_subset
from experiments.interaction.network import ContactNetwork, NetworkShape, split_posterior

SPIRAL_LENGTH = 9
HIDDEN = 512
GROUPS = 8


@dataclass(frozen=True)
class SpiralTables:
    """Spirals of three meshes, each a subset of the one before."""

    spirals: tuple[Integer[Tensor, "V0 9"], Integer[Tensor, "V1 9"], Integer[Tensor, "V2 9"]]
    kept: tuple[Integer[Tensor, " V1"], Integer[Tensor, " V2"]]
    """Vertices of a mesh that the next one keeps, in the numbering of the former."""


def spiral_tables(
    points: Float[np.ndarray, "V 3"], faces: Integer[np.ndarray, "F 3"]
) -> SpiralTables:
    """Spirals of a closed mesh, of its quarter and of its sixteenth."""
    spirals = [spirals_of(faces, len(points))]
    kept = []
    for count in (round(len(points) / 4), round(len(points) / 16)):
        subset, faces = closed_subset(points, faces, count)
        points = points[subset]
        kept.append(torch.as_tensor(subset, dtype=torch.int64))
        spirals.append(spirals_of(faces, len(points)))
    return SpiralTables((spirals[0], spirals[1], spirals[2]), (kept[0], kept[1]))


def spirals_of(
    faces: Integer[np.ndarray, "F 3"], n_vertices: int, length: int = SPIRAL_LENGTH
) -> Integer[Tensor, "V length"]:
    """Each vertex, its ring and the rings after, cut to `length`.

    A ring is walked in the order of the half edges, the first from its lowest neighbour on; the next
    ring visits, vertex by vertex of the last, the neighbours not seen yet. A mesh too small to fill a
    spiral fills it with its centre.
    """
    rings = _ordered_rings(faces, n_vertices)
    rows = []
    for centre in range(n_vertices):
        row, ring = [centre], rings[centre]
        while ring and len(row) < length:
            row += ring
            seen = set(row)
            outer = [vertex for inner in ring for vertex in rings[inner]]
            ring = [vertex for vertex in dict.fromkeys(outer) if vertex not in seen]
        rows.append((row + [centre] * length)[:length])
    return torch.tensor(rows, dtype=torch.int64)


def _ordered_rings(faces: Integer[np.ndarray, "F 3"], n_vertices: int) -> list[list[int]]:
    following: list[dict[int, int]] = [{} for _ in range(n_vertices)]
    for face in faces.tolist():
        for turn in range(3):
            centre, here, there = face[turn], face[turn - 2], face[turn - 1]
            following[centre][here] = there
    rings = []
    for after in following:
        ring, vertex = [], min(after, default=None)
        while vertex is not None and vertex not in ring:
            ring.append(vertex)
            vertex = after.get(vertex)
        rings.append(ring)
    return rings


class SpiralConv(nn.Module):
    """Gather a spiral, concatenate its channels, one linear layer."""

    spirals: Tensor

    def __init__(self, spirals: Integer[Tensor, "V L"], inputs: int, outputs: int) -> None:
        super().__init__()
        self.register_buffer("spirals", spirals, persistent=False)
        self.layer = nn.Linear(inputs * spirals.shape[1], outputs)
        nn.init.xavier_uniform_(self.layer.weight)
        nn.init.zeros_(self.layer.bias)

    def forward(self, values: Float[Tensor, "B V I"]) -> Float[Tensor, "B V O"]:
        """Values of all vertices of the mesh to new values of them."""
        gathered = values.index_select(1, self.spirals.flatten())
        rows = gathered.reshape(len(values), len(self.spirals), -1)
        out: Float[Tensor, "B V O"] = self.layer(rows)
        return out


class SpiralNetwork(ContactNetwork):
    """POSA's encoder and decoder. It is not shown the height above the floor, as POSA is not."""

    def __init__(self, shape: NetworkShape, tables: SpiralTables) -> None:
        super().__init__()
        self.shape = shape
        width, out = shape.width, 1 + shape.n_classes
        fine, middle, coarse = tables.spirals
        self.register_buffer("kept_middle", tables.kept[0], persistent=False)
        self.register_buffer("kept_coarse", tables.kept[1], persistent=False)
        self.encoder = nn.ModuleList(
            [
                SpiralConv(fine, 3 + out, width),
                SpiralConv(fine, width, width),
                SpiralConv(middle, width, width),
                SpiralConv(coarse, width, width),
            ]
        )
        self.encoder_norms = nn.ModuleList([nn.GroupNorm(GROUPS, width) for _ in range(4)])
        self.bottleneck = nn.Sequential(
            nn.Linear(len(coarse) * width, HIDDEN), nn.LayerNorm(HIDDEN), nn.ReLU()
        )
        self.posterior = nn.Linear(HIDDEN, 2 * shape.latent)
        self.of_place = nn.Linear(3, 2 * width)
        self.of_z = nn.Linear(shape.latent, 2 * width, bias=False)
        self.narrow = nn.Linear(2 * width, width)
        self.decoder = nn.ModuleList([SpiralConv(fine, width, width) for _ in range(3)])
        self.decoder_norms = nn.ModuleList(
            [nn.GroupNorm(GROUPS, size) for size in (2 * width, width, width, width, width)]
        )
        self.answer = SpiralConv(fine, width, out)

    def encode(
        self,
        vertices: Float[Tensor, "B V 3"],
        height: Float[Tensor, "B V"],
        contact: Float[Tensor, "B V"],
        label: Integer[Tensor, "B V"],
    ) -> tuple[Float[Tensor, "B Z"], Float[Tensor, "B Z"]]:
        """See `ContactNetwork.encode`."""
        classes = functional.one_hot(label.long(), self.shape.n_classes).to(vertices.dtype)
        values = torch.cat([vertices, contact[..., None], classes], dim=-1)
        for index, (convolve, norm) in enumerate(
            zip(self.encoder, self.encoder_norms, strict=True)
        ):
            values = _normed(norm, convolve(values))
            if index == 1:
                values = values.index_select(1, self.get_buffer("kept_middle"))
            elif index == 2:
                values = values.index_select(1, self.get_buffer("kept_coarse"))
        return split_posterior(self.posterior(self.bottleneck(values.flatten(1))))

    def decode(
        self,
        vertices: Float[Tensor, "B V 3"],
        height: Float[Tensor, "B V"],
        z: Float[Tensor, "B Z"],
    ) -> tuple[Float[Tensor, "B V"], Float[Tensor, "B V C"]]:
        """See `ContactNetwork.decode`."""
        # One linear layer of [place, z], its z half once a body instead of once a vertex.
        values = _normed(self.decoder_norms[0], self.of_place(vertices) + self.of_z(z)[:, None])
        values = _normed(self.decoder_norms[1], self.narrow(values))
        for convolve, norm in zip(self.decoder, self.decoder_norms[2:], strict=True):
            values = _normed(norm, convolve(values))
        logits = self.answer(values)
        return logits[..., 0], logits[..., 1:] / self.class_temperature


def _normed(norm: nn.Module, values: Float[Tensor, "B V W"]) -> Float[Tensor, "B V W"]:
    return functional.relu(norm(values.movedim(1, 2))).movedim(1, 2)

"""Networks of the interaction model by architecture, built for the embedded bodies."""

from __future__ import annotations

from functools import lru_cache

import torch
from jaxtyping import Integer
from torch import Tensor

from experiments.body.embedded import BODY_FILE, read_body
from experiments.body.skinned_body import SkinnedBody
from experiments.interaction.feature_mesh import feature_faces, vertex_parts
from experiments.interaction.mesh import feature_vertices
from experiments.interaction.network import ContactNetwork, NetworkShape, PointNetwork
from experiments.interaction.spiral import SpiralNetwork, SpiralTables, spiral_tables

ARCHITECTURES: tuple[str, ...] = ("point", "spiral")
_REFERENCE = "male_slim"
"""All embedded bodies share their triangles and weights; spirals are those of this one."""


def build_network(shape: NetworkShape, seed: int) -> ContactNetwork:
    """A network with its first weights drawn from `seed`; the state of torch's generator is kept."""
    if shape.architecture not in ARCHITECTURES:
        raise ValueError(f"architecture {shape.architecture!r}: one of {', '.join(ARCHITECTURES)}")
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        if shape.architecture == "spiral":
            return SpiralNetwork(shape, _reference_tables())
        return PointNetwork(shape, _reference_parts())


@lru_cache(maxsize=1)
def _reference_body() -> SkinnedBody:
    return read_body(BODY_FILE, _REFERENCE)


@lru_cache(maxsize=1)
def _reference_parts() -> Integer[Tensor, " V"]:
    return torch.as_tensor(vertex_parts(_reference_body()))


@lru_cache(maxsize=1)
def _reference_tables() -> SpiralTables:
    body = _reference_body()
    points = body.rest_vertices[feature_vertices(body)]
    return spiral_tables(points, feature_faces(body))

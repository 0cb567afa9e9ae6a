"""The network stages: a body at every sub-goal, a route between them, poses along the route."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from experiments.body.model import BodyModel
from experiments.scene.scene import Scene
from experiments.synthesis.body_vector import POSE, STATE, body_descriptor
from experiments.synthesis.route_net import SEGMENT
from experiments.synthesis.scene_encoder import scene_points
from experiments.synthesis.spots import Spot
from experiments.synthesis.subgoal_net import LATENT_SIZE
from experiments.synthesis.weights import SynthesisNets


@dataclass(frozen=True)
class SceneFeatures:
    """One room as each network's own encoder sees it."""

    subgoal: Float[Tensor, "1 256"]
    route: Float[Tensor, "1 256"]
    pose: Float[Tensor, "1 256"]


def n_segments(n_frames: int) -> int:
    """Segments that cover `n_frames` frames at 30 frames per second."""
    return -(-n_frames // SEGMENT)


def generate(
    nets: SynthesisNets, features: SceneFeatures, bodies: Float[Tensor, "K 135"]
) -> Float[Tensor, "T 135"]:
    """Body vectors of a whole sequence, float32: 60 frames between each two sub-goal bodies.

    The bodies themselves are no frames of it, as in the published demonstration.
    """
    with torch.no_grad():
        ends = torch.stack([bodies[:-1], bodies[1:]], dim=1)
        n = len(ends)
        route = nets.route(features.route.expand(n, -1), ends[..., STATE])
        poses = nets.pose(features.pose.expand(n, -1), ends[..., POSE], route)
        return torch.cat([route, poses], dim=-1).flatten(0, 1)


def subgoal_bodies(
    nets: SynthesisNets,
    features: SceneFeatures,
    body: BodyModel,
    spots: tuple[Spot, ...],
    rng: np.random.Generator,
) -> Float[Tensor, "K 135"]:
    """One body for every root state, latents drawn from the standard normal prior."""
    states = torch.tensor(np.stack([root_state(spot, body) for spot in spots])).float()
    shape = torch.tensor(body_descriptor(body)).float().expand(len(spots), -1)
    latent = torch.tensor(rng.standard_normal((len(spots), LATENT_SIZE))).float()
    feature = features.subgoal.expand(len(spots), -1)
    with torch.no_grad():
        found: Tensor = nets.subgoal.sample(feature, states, shape, latent)
    return found


def root_state(spot: Spot, body: BodyModel) -> Float[np.ndarray, "9"]:
    """Translation and 6D orientation of the root at a spot."""
    columns = spot.orientation[:, :2].T.reshape(6)
    return np.concatenate([spot.pelvis - body.rest_joints[0], columns])


def scene_features(nets: SynthesisNets, scene: Scene) -> SceneFeatures:
    """Encode a room once a process; the networks and the room are told apart by their hashes."""
    key = (scene.content_hash, *sorted(nets.sha256.values()))
    if key not in _FEATURES:
        points = torch.tensor(scene_points(scene))[None]
        with torch.no_grad():
            encoded = [net.scene(points) for net in (nets.subgoal, nets.route, nets.pose)]
        _FEATURES[key] = SceneFeatures(*encoded)
    return _FEATURES[key]


_FEATURES: dict[tuple[str, ...], SceneFeatures] = {}

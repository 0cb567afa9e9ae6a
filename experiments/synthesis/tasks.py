"""What each network learns: a batch drawn by step number, its loss, and its held-out error.

In each step one room is encoded with gradient; the rest of the batch comes from other rooms, whose
features are those of their last encoding. Training a point network for every sample would take a
dozen times as long.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Integer
from torch import Tensor

from experiments.body.embedded import BODY_NAMES, load_body
from experiments.synthesis import losses
from experiments.synthesis.body_vector import POSE, STATE, to_pose
from experiments.synthesis.pose_net import PoseNet
from experiments.synthesis.route_net import RouteNet
from experiments.synthesis.scene_encoder import FEATURE_SIZE, SceneEncoder
from experiments.synthesis.subgoal_net import LATENT_SIZE, SubgoalNet
from experiments.synthesis.training_set import (
    QUARTERS,
    TrainingSet,
    about_z,
    quarter_turns,
)
from experiments.synthesis.weights import Kind

SynthesisNet = RouteNet | PoseNet | SubgoalNet
HELD_OUT_BATCH = 512
_ENDS = [0, 61]
_BETWEEN = slice(1, 61)


@runtime_checkable
class Task(Protocol):
    """One network and what it is trained on."""

    kind: Kind
    features: RoomFeatures
    items: int
    """Training samples in an epoch."""
    batch: int

    @property
    def net(self) -> SynthesisNet:
        """The network, with its own scene encoder."""
        ...

    def loss(self, seed: tuple[int, int], epoch: float) -> Float[Tensor, ""]:
        """Training loss of the batch that `seed` (run, step) draws."""
        ...

    def held_out(self) -> float:
        """The loss on held-out clips in held-out rooms."""
        ...


class RoomFeatures:
    """The latest feature of every room and quarter turn."""

    def __init__(self, data: TrainingSet) -> None:
        self.data = data
        self.rows = {room: row for row, room in enumerate(data.rooms)}
        self.table = torch.zeros((len(self.rows), QUARTERS, FEATURE_SIZE), device=data.device)

    def refresh(self, encoder: SceneEncoder) -> None:
        """Encode every room without gradient."""
        with torch.no_grad():
            for room in self.rows:
                for quarter in range(QUARTERS):
                    self.fresh(encoder, room, quarter)

    def fresh(self, encoder: SceneEncoder, room: int, quarter: int) -> Float[Tensor, "256"]:
        """Encode one room with gradient and keep the value."""
        feature: Tensor = encoder(self.data.room_points(room, quarter)[None])[0]
        self.table[self.rows[room], quarter] = feature.detach()
        return feature

    def of(
        self, rooms: Integer[np.ndarray, " B"], quarters: Integer[np.ndarray, " B"]
    ) -> Float[Tensor, "B 256"]:
        """Kept features, no gradient."""
        rows = torch.tensor([self.rows[int(room)] for room in rooms])
        return self.table[rows, torch.as_tensor(quarters)]


class RouteTask:
    """RouteNet: root states between two ends."""

    kind: Kind = "route"

    def __init__(self, net: RouteNet, train: TrainingSet, held: TrainingSet, batch: int) -> None:
        self.net, self.train, self.held, self.batch = net, train, held, batch
        self.features = RoomFeatures(train)
        self.items = len(train.moving)

    def loss(self, seed: tuple[int, int], epoch: float) -> Float[Tensor, ""]:
        """Mean absolute error of the states."""
        drawn = _drawn(self.train, self.features, self.net.scene, self.batch, seed)
        ends, between = drawn.vectors[:, _ENDS], drawn.vectors[:, _BETWEEN]
        return losses.l1(self.net(drawn.feature, ends[..., STATE]), between[..., STATE])

    def held_out(self) -> float:
        """The same on held-out data."""
        vectors, rooms = held_out_segments(self.held)
        with torch.no_grad():
            feature = encoded(self.net.scene, self.held, rooms)
            route = self.net(feature, vectors[:, _ENDS][..., STATE])
            return float(losses.l1(route, vectors[:, _BETWEEN][..., STATE]))


class PoseTask:
    """PoseNet: joint rotations between two ends, along the route that RouteNet predicts."""

    kind: Kind = "pose"

    def __init__(
        self, net: PoseNet, route: RouteNet, train: TrainingSet, held: TrainingSet, batch: int
    ) -> None:
        self.net, self.route, self.train, self.held, self.batch = net, route, train, held, batch
        self.route.requires_grad_(False)
        self.features = RoomFeatures(train)
        self.route_features = RoomFeatures(train)
        self.route_features.refresh(route.scene)
        self.items = len(train.moving)

    def loss(self, seed: tuple[int, int], epoch: float) -> Float[Tensor, ""]:
        """Mean absolute error of the 6D rotations."""
        drawn = _drawn(self.train, self.features, self.net.scene, self.batch, seed)
        ends = drawn.vectors[:, _ENDS]
        room = self.route_features.of(drawn.rooms, drawn.quarters)
        route = self.route(room, ends[..., STATE])
        found = self.net(drawn.feature, ends[..., POSE], route)
        return losses.l1(found, drawn.vectors[:, _BETWEEN][..., POSE])

    def held_out(self) -> float:
        """The same on held-out data."""
        vectors, rooms = held_out_segments(self.held)
        ends = vectors[:, _ENDS]
        with torch.no_grad():
            route = self.route(encoded(self.route.scene, self.held, rooms), ends[..., STATE])
            found = self.net(encoded(self.net.scene, self.held, rooms), ends[..., POSE], route)
            return float(losses.l1(found, vectors[:, _BETWEEN][..., POSE]))


class SubgoalTask:
    """The sub-goal network: reconstruction, divergence, and the body against the room it is in."""

    kind: Kind = "subgoal"

    def __init__(self, net: SubgoalNet, train: TrainingSet, held: TrainingSet, batch: int) -> None:
        self.net, self.train, self.held, self.batch = net, train, held, batch
        self.features = RoomFeatures(train)
        self.items = len(train.data.placed("train"))
        self._parts = _BodyParts()

    def loss(self, seed: tuple[int, int], epoch: float) -> Float[Tensor, ""]:
        """The published sum; the terms against the scene are those of the room encoded afresh."""
        rng = np.random.default_rng(seed)
        room = int(rng.choice(list(self.train.rooms)))
        half = self.batch // 2
        here = self.train.subgoals(rng, half, room)
        elsewhere = self.train.subgoals(rng, self.batch - half)
        placements, frames = (np.concatenate(pair) for pair in zip(here, elsewhere, strict=True))
        quarters = rng.integers(QUARTERS, size=self.batch)
        quarters[:half] = quarters[0]
        fresh = self.features.fresh(self.net.scene, room, int(quarters[0]))
        kept = self.features.of(self.train.room_of(placements[half:]), quarters[half:])
        feature = torch.cat([fresh.expand(half, -1), kept])
        body = _frames_of(self.train, placements, frames, quarters)
        shape = self.train.descriptors[self.train.body_of(placements)]
        noise = torch.from_numpy(rng.standard_normal((self.batch, LATENT_SIZE))).to(body)
        found, mean, log_variance = self.net(feature, body[:, STATE], shape, body, noise)
        loss = losses.kl_weight(epoch) * losses.kl_divergence(mean, log_variance)
        loss = loss + losses.RECONSTRUCTION_WEIGHT * losses.subgoal_reconstruction(found, body)
        bodies = self.train.body_of(placements[:half])
        against = self._parts.scene_terms(self.train, found[:half], bodies, room, int(quarters[0]))
        return loss + losses.SUBGOAL_SCENE_WEIGHT * against

    def held_out(self) -> float:
        """Reconstruction of held-out bodies from the mean of their latent."""
        rng = np.random.default_rng(0)
        placements, frames = self.held.subgoals(rng, HELD_OUT_BATCH)
        quarters = np.zeros(len(placements), dtype=np.int64)
        body = _frames_of(self.held, placements, frames, quarters)
        shape = self.held.descriptors[self.held.body_of(placements)]
        with torch.no_grad():
            feature = encoded(self.net.scene, self.held, self.held.room_of(placements))
            noise = torch.zeros((len(placements), LATENT_SIZE), device=body.device)
            found, _, _ = self.net(feature, body[:, STATE], shape, body, noise)
            return float(losses.subgoal_reconstruction(found, body))


def encoded(
    encoder: SceneEncoder, data: TrainingSet, rooms: Integer[np.ndarray, " B"]
) -> Float[Tensor, "B 256"]:
    """Features of unturned rooms, each room encoded once."""
    found = {room: encoder(data.room_points(room, 0)[None])[0] for room in set(rooms.tolist())}
    return torch.stack([found[room] for room in rooms.tolist()])


def held_out_segments(
    data: TrainingSet, at_most: int = HELD_OUT_BATCH
) -> tuple[Float[Tensor, "B 62 135"], Integer[np.ndarray, " B"]]:
    """Vectors and rooms of evenly spread held-out windows."""
    count = min(at_most, len(data.moving))
    chosen = data.moving[np.linspace(0, len(data.moving) - 1, count).round().astype(int)]
    return data.vectors(chosen, np.zeros(count, dtype=np.int64)), data.room_of(chosen)


@dataclass(frozen=True)
class _Segments:
    vectors: Float[Tensor, "B 62 135"]
    rooms: Integer[np.ndarray, " B"]
    quarters: Integer[np.ndarray, " B"]
    feature: Float[Tensor, "B 256"]


def _drawn(
    data: TrainingSet,
    features: RoomFeatures,
    encoder: SceneEncoder,
    batch: int,
    seed: tuple[int, int],
) -> _Segments:
    """Half a batch from one room, encoded with gradient, and half from anywhere."""
    rng = np.random.default_rng(seed)
    half = batch // 2
    rooms = data.room_of(data.moving)
    room = int(rng.choice(np.unique(rooms)))
    here = rng.choice(data.moving[rooms == room], half)
    placements = np.concatenate([here, rng.choice(data.moving, batch - half)])
    quarters = rng.integers(QUARTERS, size=batch)
    quarters[:half] = quarters[0]
    fresh = features.fresh(encoder, room, int(quarters[0]))
    where = data.room_of(placements)
    kept = features.of(where[half:], quarters[half:])
    feature = torch.cat([fresh.expand(half, -1), kept])
    return _Segments(data.vectors(placements, quarters), where, quarters, feature)


def _frames_of(
    data: TrainingSet,
    placements: Integer[np.ndarray, " B"],
    frames: Integer[np.ndarray, " B"],
    quarters: Integer[np.ndarray, " B"],
) -> Float[Tensor, "B 135"]:
    return data.vectors(placements, quarters)[torch.arange(len(frames)), torch.as_tensor(frames)]


class _BodyParts:
    """Vertices for the terms against the scene: a thin sample of the skin and of the contact parts."""

    def __init__(self) -> None:
        self.bodies = [load_body(name) for name in BODY_NAMES]
        regions = [self.bodies[0].regions[name][::12] for name in losses.CONTACT_REGIONS]
        touching = np.unique(np.concatenate(regions))
        self.ids = np.concatenate([touching, self.bodies[0].subset[::4]])
        self.n_touching = len(touching)

    def scene_terms(
        self,
        data: TrainingSet,
        vectors: Float[Tensor, "B 135"],
        bodies: Integer[np.ndarray, " B"],
        room: int,
        quarter: int,
    ) -> Float[Tensor, ""]:
        """Penetration plus contact of bodies in one room; computed on the CPU."""
        held = data.rooms[room]
        spin, anchor = quarter_turns(np.array([quarter]), np.array([held.size]))
        back = about_z(torch.tensor(spin, dtype=torch.float32))[0]
        shift = torch.tensor(anchor[0], dtype=torch.float32)
        distances = []
        for index in np.unique(bodies).tolist():
            pose, transl = to_pose(vectors[torch.as_tensor(bodies == index)].cpu())
            points = self.bodies[index].posed(pose, transl, self.ids).vertices
            distances.append(held.lookup.distance((points - shift) @ back))
        distance = torch.cat(distances)
        touching = losses.contact(distance[:, : self.n_touching])
        return (losses.penetration(distance) + touching).to(vectors.device)

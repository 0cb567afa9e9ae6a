"""The placed windows as tensors, ready for batches: body vectors in the frames of their rooms."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
import torch
from jaxtyping import Float, Integer
from torch import Tensor

from experiments.body.embedded import BODY_NAMES, load_body
from experiments.scene.lookup import SceneLookup
from experiments.synthesis.body_vector import SIZE, body_descriptor, rotations_to_6d
from experiments.synthesis.placed_windows import SUPPORTS, PlacedWindows
from experiments.synthesis.scene_encoder import scene_points
from experiments.synthesis.training_rooms import Split, training_scene

QUARTERS = 4
"""Every room is also seen turned by one, two and three quarters."""
SUBGOAL_SHARES = {"none": 0.4, "seat": 0.4, "hands": 0.2}
"""Shares of standing or walking, seated or lying, and touching bodies in the sub-goals drawn."""


@dataclass(frozen=True)
class Room:
    """What training reads of one room. Frame: origin at the south-west corner of the floor."""

    name: str
    points: Float[Tensor, "N 3"]
    size: tuple[float, float]
    lookup: SceneLookup


@dataclass(frozen=True)
class TrainingSet:
    """One split of the data. `device` is where batches are made."""

    data: PlacedWindows
    split: Split
    device: torch.device = field(default_factory=lambda: torch.device("cpu"))

    @cached_property
    def rooms(self) -> dict[int, Room]:
        """The rooms of the split by their index in the data; their volumes come from the cache."""
        return {
            index: _room(record.name, self.device)
            for index, record in enumerate(self.data.rooms)
            if record.split == self.split
        }

    @cached_property
    def moving(self) -> Integer[np.ndarray, " K"]:
        """Placements for RouteNet and PoseNet."""
        return self.data.moving(self.data.placed(self.split))

    @cached_property
    def descriptors(self) -> Float[Tensor, "4 10"]:
        """Shape descriptors of the embedded bodies."""
        rows = [body_descriptor(load_body(name)) for name in BODY_NAMES]
        return torch.tensor(np.stack(rows), dtype=torch.float32, device=self.device)

    def room_of(self, placements: Integer[np.ndarray, " B"]) -> Integer[np.ndarray, " B"]:
        """Index of the room of each placement."""
        return np.asarray(self.data.room[placements])

    def body_of(self, placements: Integer[np.ndarray, " B"]) -> Integer[np.ndarray, " B"]:
        """Index of the body of each placement."""
        return np.asarray(self.data.body[self.data.window[placements]])

    def vectors(
        self, placements: Integer[np.ndarray, " B"], quarters: Integer[np.ndarray, " B"]
    ) -> Float[Tensor, "B 62 135"]:
        """Body vectors of placed windows in their rooms, each room turned by so many quarters."""
        window = self.data.window[placements]
        values = self._local[window].to(self.device, torch.float32)
        rest = self._rest[self.data.body[window]].to(self.device)
        yaw = self._tensor(self.data.yaw[placements])
        shift = torch.zeros((len(placements), 3), device=self.device)
        shift[:, :2] = self._tensor(self.data.shift[placements])
        turned = turned_vectors(values, rest, yaw, shift)
        sizes = [self.rooms[room].size for room in self.data.room[placements].tolist()]
        spin, anchor = quarter_turns(quarters, np.array(sizes))
        return turned_vectors(turned, rest, self._tensor(spin), self._tensor(anchor))

    def room_points(self, room: int, quarter: int) -> Float[Tensor, "N 3"]:
        """Points of a room turned by so many quarters, its corner at the origin again."""
        held = self.rooms[room]
        spin, anchor = quarter_turns(np.array([quarter]), np.array([held.size]))
        turn = about_z(self._tensor(spin))[0]
        return held.points @ turn.T + self._tensor(anchor)[0]

    def subgoals(
        self, rng: np.random.Generator, count: int, room: int | None = None
    ) -> tuple[Integer[np.ndarray, " B"], Integer[np.ndarray, " B"]]:
        """Random placements and frames for the sub-goal network, kinds mixed by `SUBGOAL_SHARES`."""
        pools = self._subgoal_pools(room)
        kinds = [kind for kind in SUPPORTS if len(pools[kind])]
        share = np.array([SUBGOAL_SHARES[kind] for kind in kinds])
        drawn = rng.choice(len(kinds), size=count, p=share / share.sum())
        placements = np.array([rng.choice(pools[kinds[k]]) for k in drawn])
        still = self.data.frame[self.data.window[placements]]
        frames = np.where(still >= 0, still, rng.integers(0, 62, size=count))
        return placements, frames

    def _subgoal_pools(self, room: int | None) -> dict[str, Integer[np.ndarray, " K"]]:
        every = self.data.placed(self.split)
        if room is not None:
            every = every[self.data.room[every] == room]
        support = self.data.support[self.data.window[every]]
        return {kind: every[support == index] for index, kind in enumerate(SUPPORTS)}

    @cached_property
    def _local(self) -> Float[Tensor, "M 62 135"]:
        """Half-precision vectors of every window before it is placed."""
        values = torch.zeros((len(self.data.pose), 62, SIZE), dtype=torch.float16)
        for start in range(0, len(values), 512):
            part = slice(start, start + 512)
            pose = torch.from_numpy(self.data.pose[part].astype(np.float32))
            values[part, :, :3] = torch.from_numpy(self.data.transl[part]).half()
            values[part, :, 3:] = rotations_to_6d(pose).flatten(2).half()
        return values

    @cached_property
    def _rest(self) -> Float[Tensor, "4 3"]:
        rest = np.stack([load_body(name).rest_joints[0] for name in BODY_NAMES])
        return torch.tensor(rest, dtype=torch.float32)

    def _tensor(self, values: np.ndarray) -> Tensor:
        return torch.as_tensor(values, dtype=torch.float32, device=self.device)


@lru_cache(maxsize=64)
def _room(name: str, device: torch.device) -> Room:
    scene = training_scene(name)
    points = torch.from_numpy(scene_points(scene)).to(device)
    return Room(name, points, scene.room_size[:2], SceneLookup(scene))


def turned_vectors(
    vectors: Float[Tensor, "B T 135"],
    rest: Float[Tensor, "B 3"],
    yaw: Float[Tensor, " B"],
    shift: Float[Tensor, "B 3"],
) -> Float[Tensor, "B T 135"]:
    """Body vectors turned by yaw (rad) about the vertical axis of the world and shifted (m).

    `rest` are the pelvis positions of the zero pose: the pelvis stands at rest + translation.
    """
    turn = about_z(yaw)[:, None]
    pelvis = (turn @ (vectors[..., :3] + rest[:, None])[..., None])[..., 0]
    columns = vectors[..., 3:9].reshape(*vectors.shape[:-1], 2, 3) @ turn.transpose(-1, -2)
    transl = pelvis + shift[:, None] - rest[:, None]
    return torch.cat([transl, columns.flatten(-2), vectors[..., 9:]], dim=-1)


def quarter_turns(
    quarters: Integer[np.ndarray, " B"], sizes: Float[np.ndarray, "B 2"]
) -> tuple[Float[np.ndarray, " B"], Float[np.ndarray, "B 3"]]:
    """Turn (rad) and shift (m) that turn rooms by quarters and put their corner back to the origin."""
    width, depth = sizes[:, 0], sizes[:, 1]
    none = np.zeros(len(sizes))
    x = np.choose(quarters, [none, depth, width, none])
    y = np.choose(quarters, [none, none, depth, width])
    return quarters * (np.pi / 2), np.stack([x, y, none], axis=1)


def about_z(yaw: Float[Tensor, " B"]) -> Float[Tensor, "B 3 3"]:
    """Rotation matrices about the vertical axis."""
    cosine, sine, zero = torch.cos(yaw), torch.sin(yaw), torch.zeros_like(yaw)
    rows = [cosine, -sine, zero, sine, cosine, zero, zero, zero, zero + 1]
    return torch.stack(rows, dim=-1).reshape(-1, 3, 3)

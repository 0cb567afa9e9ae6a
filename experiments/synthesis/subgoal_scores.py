"""Scores of the sub-goal network: bodies for held-out places beside trivial guesses."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Integer
from torch import Tensor

from experiments.body.embedded import BODY_NAMES, load_body
from experiments.synthesis.baselines import angles, matrices
from experiments.synthesis.body_vector import POSE, STATE, to_pose
from experiments.synthesis.subgoal_net import LATENT_SIZE, SubgoalNet
from experiments.synthesis.tasks import encoded
from experiments.synthesis.training_set import TrainingSet

BODIES = 300
"""Held-out sub-goals of each kind that are scored."""
SAMPLES = 10
_TOUCH_M = 0.05


@dataclass(frozen=True)
class SubgoalScore:
    """Bodies for given places: mean over held-out places of one kind."""

    angle_deg: float
    best_angle_deg: float
    """Of the best of `SAMPLES` samples."""
    depth_cm: float
    """Deepest vertex inside something."""
    touching: float
    """Share of bodies that have buttocks, thighs, back or hands within 5 cm of something."""


def subgoal_scores(
    net: SubgoalNet, train: TrainingSet, held: TrainingSet
) -> dict[str, dict[str, Any]]:
    """Samples of the sub-goal network by kind of place, beside the mean pose and the nearest state."""
    rng = np.random.default_rng(7)
    pool = train.subgoals(rng, 4000)
    known = _bodies(train, *pool)
    table: dict[str, dict[str, Any]] = {}
    placements, frames = held.subgoals(rng, 4 * BODIES)
    support = held.data.support[held.data.window[placements]]
    for index, name in enumerate(("standing", "seated or lying", "touching")):
        rows = np.flatnonzero(support == index)[:BODIES]
        if len(rows):
            chosen = placements[rows]
            body = _bodies(held, chosen, frames[rows])
            table[name] = _subgoal_row(net, held, chosen, body, known)
    return table


def sampled_bodies(
    net: SubgoalNet,
    data: TrainingSet,
    placements: Integer[np.ndarray, " B"],
    body: Float[Tensor, "B 135"],
    latent: Float[Tensor, "B 32"],
) -> Float[Tensor, "B 135"]:
    """One body for every root state and room, of these latent vectors."""
    shape = data.descriptors[torch.as_tensor(data.body_of(placements))]
    with torch.no_grad():
        feature = encoded(net.scene, data, data.room_of(placements))
        return net.sample(feature, body[:, STATE], shape, latent)


def _subgoal_row(
    net: SubgoalNet,
    data: TrainingSet,
    placements: Integer[np.ndarray, " B"],
    body: Float[Tensor, "B 135"],
    known: Float[Tensor, "K 135"],
) -> dict[str, Any]:
    generator = torch.Generator().manual_seed(7)
    samples = [
        sampled_bodies(
            net, data, placements, body, torch.randn(len(body), LATENT_SIZE, generator=generator)
        )
        for _ in range(SAMPLES)
    ]
    mean = torch.cat([body[:, STATE], known[:, POSE].mean(0).expand(len(body), -1)], dim=1)
    code, codes = _tilt_code(body), _tilt_code(known)
    near = known[torch.cdist(code, codes).argmin(dim=1)]
    near = torch.cat([body[:, STATE], near[:, POSE]], dim=1)
    rivals = {"network": samples, "mean pose": [mean], "nearest state": [near], "truth": [body]}
    return {
        name: asdict(_subgoal_score(data, placements, body, guesses))
        for name, guesses in rivals.items()
    }


def _subgoal_score(
    data: TrainingSet,
    placements: Integer[np.ndarray, " B"],
    body: Float[Tensor, "B 135"],
    guesses: list[Float[Tensor, "B 135"]],
) -> SubgoalScore:
    errors = torch.stack([angles(guess[:, POSE], body[:, POSE]).mean(-1) for guess in guesses])
    depth, touching = _against_room(data, placements, guesses[0])
    return SubgoalScore(
        angle_deg=float(errors.mean()),
        best_angle_deg=float(errors.amin(dim=0).mean()),
        depth_cm=100 * float(depth.mean()),
        touching=float((touching < _TOUCH_M).float().mean()),
    )


def _against_room(
    data: TrainingSet, placements: Integer[np.ndarray, " B"], vectors: Float[Tensor, "B 135"]
) -> tuple[Float[Tensor, " B"], Float[Tensor, " B"]]:
    """Depth of the deepest vertex, and distance of the touching part nearest to a surface, metres."""
    deepest, nearest = torch.zeros(len(vectors)), torch.zeros(len(vectors))
    regions = ("back", "buttocks", "thigh_backs", "left_hand", "right_hand")
    bodies, rooms = data.body_of(placements), data.room_of(placements)
    for row in range(len(vectors)):
        body = load_body(BODY_NAMES[bodies[row]])
        touching = np.concatenate([body.regions[name][::8] for name in regions])
        ids = np.concatenate([touching, body.subset])
        points = body.posed(*to_pose(vectors[row : row + 1]), ids).vertices[0]
        distance = data.rooms[int(rooms[row])].lookup.distance(points)
        deepest[row] = (-distance.min()).clamp(min=0)
        nearest[row] = distance[: len(touching)].abs().min()
    return deepest, nearest


def _bodies(
    data: TrainingSet, placements: Integer[np.ndarray, " B"], frames: Integer[np.ndarray, " B"]
) -> Float[Tensor, "B 135"]:
    parts = []
    for part in np.array_split(np.arange(len(frames)), max(1, len(frames) // 256)):
        vectors = data.vectors(placements[part], np.zeros(len(part), dtype=np.int64))
        parts.append(vectors[torch.arange(len(part)), torch.as_tensor(frames[part])])
    return torch.cat(parts)


def _tilt_code(vectors: Float[Tensor, "B 135"]) -> Float[Tensor, "B 4"]:
    """What a root state tells of a body without its place and heading: height and tilt."""
    matrix = matrices(vectors[:, 3:9])[:, 0]
    return torch.cat([vectors[:, 2:3], matrix[:, 2]], dim=1)

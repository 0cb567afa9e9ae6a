"""Held-out errors of the synthesis networks beside trivial baselines.

Errors are those of whole segments (60 frames between two given ends) of held-out clips in held-out
rooms. A network that does not beat straight interpolation has learned little: the table says so.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Integer
from torch import Tensor

from experiments.body.embedded import load_body
from experiments.synthesis.baselines import angles, nearest_segments, straight
from experiments.synthesis.body_vector import POSE, STATE, rotations_from_6d
from experiments.synthesis.subgoal_scores import subgoal_scores
from experiments.synthesis.tasks import encoded
from experiments.synthesis.training_set import TrainingSet
from experiments.synthesis.weights import SynthesisNets

SEGMENTS = 600
"""At most so many held-out windows, evenly spread, are scored."""
_ENDS = [0, 61]
_BETWEEN = slice(1, 61)
_BLOCK = 60


@dataclass(frozen=True)
class RouteScore:
    """Errors of the root between two ends, mean over frames and segments."""

    position_cm: float
    middle_cm: float
    """Position error in the middle frame."""
    heading_deg: float
    in_things: float
    """Share of frames whose pelvis is less than 10 cm from something solid."""


@dataclass(frozen=True)
class PoseScore:
    """Errors of the joints, mean over joints, frames and segments."""

    angle_deg: float
    position_cm: float
    """Joint positions relative to the root, root orientation left out."""


@dataclass(frozen=True)
class Segments:
    """Held-out segments and what the networks make of them."""

    placements: Integer[np.ndarray, " B"]
    true: Float[Tensor, "B 62 135"]
    route: Float[Tensor, "B 60 9"]
    pose: Float[Tensor, "B 60 126"]


def held_out_scores(
    nets: SynthesisNets, train: TrainingSet, held: TrainingSet
) -> dict[str, dict[str, dict[str, Any]]]:
    """Scores by network, group and method; every number is a mean over held-out data."""
    segments = predicted_segments(nets, held, spread(held.moving, SEGMENTS))
    near = nearest_segments(train, segments.true)
    groups = kind_groups(held, segments.placements)
    table: dict[str, dict[str, dict[str, Any]]] = {"route": {}, "pose": {}, "subgoal": {}}
    for name, rows in groups.items():
        keep = torch.as_tensor(rows)
        true, placed = segments.true[keep], segments.placements[rows]
        guesses = {"straight line": straight(true), "nearest clip": near[keep]}
        predicted = torch.cat([segments.route, segments.pose], dim=-1)[keep]
        rivals = {"network": predicted, **guesses}
        table["route"][name] = {
            method: asdict(route_score(held, placed, true, guess[..., STATE]))
            for method, guess in {**rivals, "truth": true[:, _BETWEEN]}.items()
        }
        table["pose"][name] = {
            method: asdict(pose_score(true, guess[..., POSE])) for method, guess in rivals.items()
        }
    table["subgoal"] = subgoal_scores(nets.subgoal, train, held)
    return table


def predicted_segments(
    nets: SynthesisNets, data: TrainingSet, placements: Integer[np.ndarray, " B"]
) -> Segments:
    """Routes of RouteNet and poses of PoseNet along them."""
    true = data.vectors(placements, np.zeros(len(placements), dtype=np.int64))
    rooms, ends = data.room_of(placements), true[:, _ENDS]
    with torch.no_grad():
        route = nets.route(encoded(nets.route.scene, data, rooms), ends[..., STATE])
        pose = nets.pose(encoded(nets.pose.scene, data, rooms), ends[..., POSE], route)
    return Segments(placements, true, route, pose)


def spread(values: Integer[np.ndarray, " N"], at_most: int) -> Integer[np.ndarray, " K"]:
    """At most so many of them, evenly spread."""
    index = np.linspace(0, len(values) - 1, min(at_most, len(values)))
    return np.asarray(values[index.round().astype(int)])


def kind_groups(
    data: TrainingSet, placements: Integer[np.ndarray, " B"]
) -> dict[str, Integer[np.ndarray, " K"]]:
    """Rows of all placements and of those of captured, composed and authored clips."""
    clips = data.data.clip[data.data.window[placements]]
    kinds = np.array([data.data.clips[clip].kind for clip in clips.tolist()])
    groups = {"all": np.arange(len(placements))}
    for kind in ("captured", "composed", "authored"):
        rows = np.flatnonzero(kinds == kind)
        if len(rows):
            groups[kind] = rows
    return groups


def route_score(
    data: TrainingSet,
    placements: Integer[np.ndarray, " B"],
    true: Float[Tensor, "B 62 135"],
    route: Float[Tensor, "B 60 9"],
) -> RouteScore:
    """Errors of root states."""
    error = 100 * (route[..., :3] - true[:, _BETWEEN, :3]).norm(dim=-1)
    turn = angles(route[..., 3:9], true[:, _BETWEEN, 3:9])
    rest = data._rest[torch.as_tensor(data.body_of(placements))]
    near = []
    for row, room in enumerate(data.room_of(placements).tolist()):
        pelvis = (route[row, :, :3] + rest[row]).float()
        near.append(data.rooms[room].lookup.distance(pelvis) < 0.1)
    return RouteScore(
        position_cm=float(error.mean()),
        middle_cm=float(error[:, 29:31].mean()),
        heading_deg=float(turn.mean()),
        in_things=float(torch.stack(near).float().mean()),
    )


def pose_score(true: Float[Tensor, "B 62 135"], pose: Float[Tensor, "B 60 126"]) -> PoseScore:
    """Errors of joint rotations, and of joint positions on one body with its root held upright."""
    wanted = true[:, _BETWEEN, POSE]
    angle = angles(pose, wanted)
    gaps = [
        (_joints(pose[part]) - _joints(wanted[part])).norm(dim=-1).mean(dim=(1, 2))
        for part in _blocks(len(true))
    ]
    return PoseScore(float(angle.mean()), 100 * float(torch.cat(gaps).mean()))


def _blocks(count: int) -> list[slice]:
    return [slice(start, start + _BLOCK) for start in range(0, count, _BLOCK)]


def _joints(pose: Float[Tensor, "B T 126"]) -> Float[Tensor, "B T 22 3"]:
    """Joint positions of an upright `male_slim` at the origin, metres."""
    turned = rotations_from_6d(pose.reshape(-1, 21, 6))
    whole = torch.cat([torch.zeros((len(turned), 1, 3)), turned], dim=1)
    body = load_body("male_slim")
    _, positions = body.joint_transforms(whole, torch.zeros((len(turned), 3)))
    return positions.reshape(*pose.shape[:2], 22, 3)

"""Held-out errors of the synthesis networks beside trivial baselines.

Errors are those of whole segments (60 frames between two given ends) of held-out clips in held-out
rooms. A network that does not beat straight interpolation has learned little: the table says so.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import roma
import torch
from jaxtyping import Float, Integer
from torch import Tensor

from experiments.body.embedded import BODY_NAMES, load_body
from experiments.synthesis.body_vector import POSE, STATE, rotations_from_6d, to_pose
from experiments.synthesis.subgoal_net import LATENT_SIZE, SubgoalNet
from experiments.synthesis.tasks import encoded
from experiments.synthesis.training_set import TrainingSet, turned_vectors
from experiments.synthesis.weights import SynthesisNets

SEGMENTS = 600
"""At most so many held-out windows, evenly spread, are scored."""
BODIES = 300
"""Held-out sub-goals of each kind that are scored."""
SAMPLES = 10
_ENDS = [0, 61]
_BETWEEN = slice(1, 61)
_TOUCH_M = 0.05
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
class SubgoalScore:
    """Bodies for given places: mean over held-out places of one kind."""

    angle_deg: float
    best_angle_deg: float
    """Of the best of `SAMPLES` samples."""
    depth_cm: float
    """Deepest vertex inside something."""
    touching: float
    """Share of bodies that have buttocks, thighs, back or hands within 5 cm of something."""


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


def straight(true: Float[Tensor, "B 62 135"]) -> Float[Tensor, "B 60 135"]:
    """The trivial synthesis: translation linear, every rotation on its shortest arc at even speed."""
    share = torch.arange(1, 61, dtype=true.dtype) / 61
    first, last = true[:, :1], true[:, 61:]
    transl = first[..., :3] + share[:, None] * (last[..., :3] - first[..., :3])
    start, end = (_matrices(side[:, 0, 3:]) for side in (first, last))
    arc = roma.rotmat_to_rotvec(start.transpose(-1, -2) @ end)
    steps = roma.rotvec_to_rotmat(share[None, :, None, None] * arc[:, None])
    turned = (start[:, None] @ steps)[..., :2].transpose(-1, -2)
    return torch.cat([transl, turned.flatten(2)], dim=-1)


def nearest_segments(
    train: TrainingSet, true: Float[Tensor, "B 62 135"]
) -> Float[Tensor, "B 60 135"]:
    """The training segment whose two ends are most alike, turned and shifted to start at the start.

    Alike: root way and turn seen from the start, heights, and both end poses.
    """
    windows = np.unique(train.data.window[train.moving])
    local = _at_origin(train._local[torch.as_tensor(windows)].float())
    wanted = _at_origin(true)
    nearest = torch.cdist(_ends_code(wanted), _ends_code(local)).argmin(dim=1)
    found = local[nearest][:, _BETWEEN]
    zero = torch.zeros((len(true), 3))
    moved = turned_vectors(found, zero, _heading(true[:, 0]), zero)
    flat = torch.cat([true[:, 0, :2], zero[:, :1]], dim=1)
    return torch.cat([moved[..., :3] + flat[:, None], moved[..., 3:]], dim=-1)


def route_score(
    data: TrainingSet,
    placements: Integer[np.ndarray, " B"],
    true: Float[Tensor, "B 62 135"],
    route: Float[Tensor, "B 60 9"],
) -> RouteScore:
    """Errors of root states."""
    error = 100 * (route[..., :3] - true[:, _BETWEEN, :3]).norm(dim=-1)
    turn = _angles(route[..., 3:9], true[:, _BETWEEN, 3:9])
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
    angle = _angles(pose, wanted)
    gaps = [
        (_joints(pose[part]) - _joints(wanted[part])).norm(dim=-1).mean(dim=(1, 2))
        for part in _blocks(len(true))
    ]
    return PoseScore(float(angle.mean()), 100 * float(torch.cat(gaps).mean()))


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
    angles = torch.stack([_angles(guess[:, POSE], body[:, POSE]).mean(-1) for guess in guesses])
    depth, touching = _against_room(data, placements, guesses[0])
    return SubgoalScore(
        angle_deg=float(angles.mean()),
        best_angle_deg=float(angles.amin(dim=0).mean()),
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
    matrix = _matrices(vectors[:, 3:9])[:, 0]
    return torch.cat([vectors[:, 2:3], matrix[:, 2]], dim=1)


def _ends_code(local: Float[Tensor, "B 62 135"]) -> Float[Tensor, "B 262"]:
    """Numbers that are alike where two windows begin and end alike."""
    first, last = local[:, 0], local[:, 61]
    states = torch.cat([first[:, 2:3], last[:, :9]], dim=1)
    poses = torch.cat([first[:, 9:], last[:, 9:]], dim=1)
    return torch.cat([2.0 * states, 0.3 * poses], dim=1)


def _at_origin(vectors: Float[Tensor, "B T 135"]) -> Float[Tensor, "B T 135"]:
    """Windows that start at x = y = 0 with heading 0."""
    zero = torch.zeros((len(vectors), 3))
    flat = torch.cat([vectors[:, 0, :2], zero[:, :1]], dim=1)[:, None]
    moved = torch.cat([vectors[..., :3] - flat, vectors[..., 3:]], dim=-1)
    return turned_vectors(moved, zero, -_heading(vectors[:, 0]), zero)


def _heading(vectors: Float[Tensor, "B 135"]) -> Float[Tensor, " B"]:
    """Where the pelvis faces: 0 along -y, counter-clockwise, radians."""
    facing = _matrices(vectors[:, 3:9])[:, 0, :, 2]
    return torch.atan2(facing[:, 0], -facing[:, 1])


def _blocks(count: int) -> list[slice]:
    return [slice(start, start + _BLOCK) for start in range(0, count, _BLOCK)]


def _matrices(columns: Float[Tensor, "B N"]) -> Float[Tensor, "B J 3 3"]:
    pair = columns.reshape(len(columns), -1, 2, 3).transpose(-1, -2)
    matrices: Tensor = roma.special_gramschmidt(pair, epsilon=1e-8)
    return matrices


def _angles(one: Float[Tensor, "*B N"], two: Float[Tensor, "*B N"]) -> Float[Tensor, "*B J"]:
    """Angle between rotations given as 6D columns, degrees."""
    pairs = [
        roma.special_gramschmidt(
            side.reshape(*side.shape[:-1], -1, 2, 3).transpose(-1, -2), epsilon=1e-8
        )
        for side in (one, two)
    ]
    angle: Tensor = torch.rad2deg(roma.rotmat_geodesic_distance(*pairs))
    return angle


def _joints(pose: Float[Tensor, "B T 126"]) -> Float[Tensor, "B T 22 3"]:
    """Joint positions of an upright `male_slim` at the origin, metres."""
    turned = rotations_from_6d(pose.reshape(-1, 21, 6))
    whole = torch.cat([torch.zeros((len(turned), 1, 3)), turned], dim=1)
    body = load_body("male_slim")
    _, positions = body.joint_transforms(whole, torch.zeros((len(turned), 3)))
    return positions.reshape(*pose.shape[:2], 22, 3)

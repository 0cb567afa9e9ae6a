"""Start search: where in the room, and facing where, a motion may begin to be optimised.

All starts of a grid are scored coarsely (some frames, some vertices, nearest-node distances), the
best few exactly, and of neighbours only the best survives.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Integer
from torch import Tensor

from experiments.placement.errors import MotionTooLong, NoAdmissibleStart
from experiments.placement.objectives import placement_terms, total
from experiments.placement.problem import Problem

_LEAST_KEPT = 60
_BATCH_POINTS = 3_000_000


@dataclass(frozen=True)
class Starts:
    """Candidate rigid placements; see `rigid.move`. Axis N."""

    yaw: Float[np.ndarray, " N"]
    translation: Float[np.ndarray, "N 3"]
    score: Float[np.ndarray, " N"]
    """E_p of the unaltered motion; zero while not yet scored."""

    def __len__(self) -> int:
        return len(self.yaw)

    def take(self, index: Integer[np.ndarray, " M"] | Bool[np.ndarray, " N"]) -> Starts:
        """Some of them."""
        return Starts(self.yaw[index], self.translation[index], self.score[index])

    def scored(self, score: Float[np.ndarray, " N"]) -> Starts:
        """The same with other scores."""
        return dataclasses.replace(self, score=score)


def find_starts(problem: Problem) -> Starts:
    """The `n_starts` best distinct starts, best first.

    Raises `MotionTooLong` if no start keeps the pelvis inside the room, `NoAdmissibleStart` if the
    start filter leaves none.
    """
    ranked = rank_starts(problem, start_grid(problem))
    settings = problem.settings
    apart = suppress(ranked, settings.suppress_distance, settings.suppress_angle_deg)
    return apart.take(np.arange(min(settings.n_starts, len(apart))))


def start_grid(problem: Problem) -> Starts:
    """Every grid position, layer and yaw for which the pelvis path stays inside the room."""
    settings = problem.settings
    yaws = np.radians(np.arange(0.0, 360.0, settings.yaw_step_deg))
    x, y = (_ticks(size, settings.inset, settings.grid_step) for size in _ground(problem))
    lifts = np.array(settings.start_layers) + problem.scene.floor_z - problem.floor
    axes = np.meshgrid(yaws, x, y, lifts, indexing="ij")
    yaw, at_x, at_y, lift = (axis.ravel() for axis in axes)
    centre = problem.centre.double().numpy()
    translation = np.stack([at_x - centre[0], at_y - centre[1], lift], axis=-1)
    starts = Starts(yaw, translation, np.zeros(len(yaw)))
    inside = np.array(
        [_stays_inside(problem, *pair) for pair in zip(yaw, translation, strict=True)]
    )
    if not inside.any():
        covered = np.ptp(problem.pelvis[:, :2], axis=0)
        extent = f"{covered[0]:.1f} x {covered[1]:.1f} m"
        width, depth = _ground(problem)
        reason = (
            f"its path covers {extent} and fits the room of {width:.1f} x {depth:.1f} m nowhere"
        )
        raise MotionTooLong(problem.motion.motion_id, problem.scene.scene_id, reason)
    return starts.take(inside)


def rank_starts(problem: Problem, starts: Starts) -> Starts:
    """The share of the starts worth keeping, scored exactly, best first."""
    coarse = _filtered(problem, starts)
    keep = max(_LEAST_KEPT, round(problem.settings.keep_share * len(starts)))
    kept = coarse.take(np.argsort(coarse.score, kind="stable")[:keep])
    exact = kept.scored(exact_scores(problem, kept))
    return exact.take(np.argsort(exact.score, kind="stable"))


def coarse_best(problem: Problem, starts: Starts) -> float:
    """The best coarse score of a start that the filter keeps; raises `NoAdmissibleStart`."""
    return float(_filtered(problem, starts).score.min())


def _filtered(problem: Problem, starts: Starts) -> Starts:
    """Coarsely scored starts that bring the body to what it expects to touch."""
    threshold = problem.settings.start_filter
    if threshold is not None:
        matching = class_match(problem, starts) >= threshold
        if not matching.any():
            names = ", ".join(problem.expected_classes())
            reason = f"no start brings the body to what it expects to touch ({names})"
            raise NoAdmissibleStart(problem.motion.motion_id, problem.scene.scene_id, reason)
        starts = starts.take(matching)
    return starts.scored(coarse_scores(problem, starts))


def suppress(starts: Starts, distance: float, angle_deg: float) -> Starts:
    """Non-maximum suppression: drop starts close in place *and* facing to a better one.

    `starts` must be sorted, best first. Distance in metres on the ground.
    """
    remaining = np.arange(len(starts))
    chosen: list[int] = []
    while len(remaining):
        best = int(remaining[0])
        chosen.append(best)
        apart = starts.translation[remaining, :2] - starts.translation[best, :2]
        turn = starts.yaw[remaining] - starts.yaw[best]
        angle = np.degrees(np.abs((turn + np.pi) % (2 * np.pi) - np.pi))
        same = (np.linalg.norm(apart, axis=1) < distance) & (angle < angle_deg)
        same[0] = True
        remaining = remaining[~same]
    return starts.take(np.array(chosen, dtype=np.int64))


def exact_scores(problem: Problem, starts: Starts) -> Float[np.ndarray, " N"]:
    """E_p of the unaltered motion at every start: all frames, all vertices, trilinear distances."""
    n_frames, n_vertices = problem.contact.shape
    batch = max(1, _BATCH_POINTS // (n_frames * n_vertices))
    scores = []
    for begin in range(0, len(starts), batch):
        part = slice(begin, begin + batch)
        yaw = torch.as_tensor(starts.yaw[part], dtype=problem.k.dtype)
        translation = torch.as_tensor(starts.translation[part], dtype=problem.k.dtype)
        with torch.no_grad():
            scores.append(total(problem.terms(problem.moved(yaw, translation))))
    return torch.cat(scores).double().numpy()


def coarse_scores(problem: Problem, starts: Starts) -> Float[np.ndarray, " N"]:
    """Cheap stand-in for `exact_scores`, good enough to drop the hopeless starts.

    Reads nearest nodes at `coarse_frames` frames, all vertices that are ever in contact and
    `coarse_vertices` others, which count for all the rest.
    """
    sample = _coarse_sample(problem)
    grids = _NodeGrids(problem)
    scores = np.zeros(len(starts))
    for yaw in np.unique(starts.yaw):
        index = np.flatnonzero(starts.yaw == yaw)
        turned = _turned(problem, sample.vertices, float(yaw))
        for part in np.array_split(index, max(1, len(index) // 256)):
            distance, label = grids.read(turned, starts.translation[part], sample.contact)
            terms = placement_terms(
                distance, label, sample.contact, sample.wanted, sample.k, problem.settings
            )
            # Others stand for more vertices than themselves; only the penalty is theirs.
            terms["penetration"] = terms["penetration"] * sample.share
            scores[part] = total(terms).double().numpy()
    return scores


def class_match(problem: Problem, starts: Starts) -> Float[np.ndarray, " N"]:
    """Share of the contact vertices expecting more than floor that stand nearest to their class.

    One where the motion expects nothing but floor.
    """
    beyond = problem.beyond_floor()
    if not beyond.any():
        return np.ones(len(starts))
    picks = beyond.nonzero()
    picks = picks[torch.linspace(0, len(picks) - 1, min(len(picks), 400)).long()]
    points = problem.vertices[picks[:, 0], picks[:, 1]]
    wanted = problem.wanted[picks[:, 0], picks[:, 1]]
    grids, match = _NodeGrids(problem), np.zeros(len(starts))
    for yaw in np.unique(starts.yaw):
        index = np.flatnonzero(starts.yaw == yaw)
        turned = _turned(problem, points[None], float(yaw))
        label = grids.labels(turned, starts.translation[index])[:, 0]
        match[index] = (label == wanted).double().mean(-1).numpy()
    return match


@dataclass(frozen=True)
class _Sample:
    """The frames and vertices of the coarse scoring."""

    vertices: Float[Tensor, "F W 3"]
    contact: Bool[Tensor, "F W"]
    wanted: Integer[Tensor, "F W"]
    k: Float[Tensor, " F"]
    share: float
    """How many vertices each of the others stands for."""


def _coarse_sample(problem: Problem) -> _Sample:
    n_frames = len(problem.contact)
    frames = np.unique(np.linspace(0, n_frames - 1, problem.settings.coarse_frames).round())
    ever = problem.contact.any(0).numpy()
    others = np.flatnonzero(~ever)
    count = min(len(others), problem.settings.coarse_vertices)
    spread = others[np.linspace(0, len(others) - 1, count).round().astype(int)]
    frame = torch.as_tensor(frames.astype(np.int64))
    column = torch.as_tensor(np.concatenate([np.flatnonzero(ever), spread]))
    return _Sample(
        vertices=problem.vertices[frame][:, column],
        contact=problem.contact[frame][:, column],
        wanted=problem.wanted[frame][:, column],
        k=problem.k[frame] * (n_frames / len(frames)),
        share=len(others) / max(count, 1),
    )


class _NodeGrids:
    """Nearest-node reading of the baked volumes for many translations of the same points."""

    def __init__(self, problem: Problem) -> None:
        volumes = problem.scene.volumes
        self._origin = torch.tensor(volumes.origin, dtype=problem.k.dtype)
        self._cell = volumes.cell
        self._shape = volumes.sdf.shape
        # One flat table of both fields: points in contact read the second half.
        both = np.stack([volumes.thickened, volumes.sdf])
        self._distance = torch.as_tensor(both, dtype=problem.k.dtype).reshape(-1)
        self._label = torch.as_tensor(volumes.label).reshape(-1)

    def read(
        self,
        points: Float[Tensor, "F W 3"],
        translation: Float[np.ndarray, "N 3"],
        contact: Bool[Tensor, "F W"],
    ) -> tuple[Float[Tensor, "N F W"], Integer[Tensor, "N F W"]]:
        """Distance, and class where it matters: at vertices in contact (0 elsewhere)."""
        node = self._nodes(points, translation)
        distance = self._distance[node + contact * len(self._label)]
        label = torch.zeros_like(node)
        label[:, contact] = self._label[node[:, contact]].long()
        return distance, label

    def labels(
        self, points: Float[Tensor, "F W 3"], translation: Float[np.ndarray, "N 3"]
    ) -> Integer[Tensor, "N F W"]:
        """Class of the nearest surface."""
        return self._label[self._nodes(points, translation)].long()

    def _nodes(
        self, points: Float[Tensor, "F W 3"], translation: Float[np.ndarray, "N 3"]
    ) -> Integer[Tensor, "N F W"]:
        offset = torch.as_tensor(translation, dtype=points.dtype)
        base = (points - self._origin) / self._cell
        flat = torch.zeros((len(offset), *points.shape[:2]), dtype=torch.int64)
        for axis, size in enumerate(self._shape):
            step = offset[:, axis, None, None] / self._cell
            node = (base[..., axis] + step).round_().clamp_(0, size - 1)
            flat.mul_(size).add_(node.long())
        return flat


def _turned(problem: Problem, points: Float[Tensor, "F W 3"], yaw: float) -> Float[Tensor, "F W 3"]:
    """Points of the clip turned about its centre, not yet translated."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    offset = points[..., :2] - problem.centre
    x = cosine * offset[..., 0] - sine * offset[..., 1]
    y = sine * offset[..., 0] + cosine * offset[..., 1]
    return torch.stack([x + problem.centre[0], y + problem.centre[1], points[..., 2]], dim=-1)


def _stays_inside(problem: Problem, yaw: float, translation: Float[np.ndarray, "3"]) -> bool:
    offset = problem.pelvis[:, :2] - problem.centre.double().numpy()
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    path = offset @ turn.T + problem.centre.double().numpy() + translation[:2]
    margin = problem.settings.wall_clearance
    return bool((path >= margin).all() and (path <= np.array(_ground(problem)) - margin).all())


def _ground(problem: Problem) -> tuple[float, float]:
    return problem.scene.room_size[0], problem.scene.room_size[1]


def _ticks(size: float, inset: float, step: float) -> Float[np.ndarray, " N"]:
    """Positions every `step` between the insets, centred in the room."""
    span = max(size - 2 * inset, 0.0)
    count = int(span / step + 1e-9) + 1
    ticks: Float[np.ndarray, " N"] = size / 2 + step * (np.arange(count) - (count - 1) / 2)
    return ticks

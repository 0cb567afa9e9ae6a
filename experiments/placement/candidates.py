"""Start search: where in the room, and facing where, a motion may begin to be optimised.

All starts of a grid are scored coarsely (some frames, some vertices), the best few exactly, and of
neighbours only the best survives.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from jaxtyping import Bool, Float, Integer
from torch import Tensor

from experiments.placement.batched import batched_terms
from experiments.placement.engines import engine_of
from experiments.placement.errors import MotionTooLong, NoAdmissibleStart
from experiments.placement.objectives import total
from experiments.placement.problem import Problem, RigidProblem
from experiments.placement.rigid import move

_LEAST_KEPT = 60
_BATCH_POINTS = 500_000


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


def find_starts(problem: Problem, spare: int = 0) -> Starts:
    """The `n_starts` best distinct starts, best first, and as many more as `spare` asks for.

    Raises `MotionTooLong` if no start keeps the pelvis inside the room, `NoAdmissibleStart` if the
    start filter leaves none.
    """
    ranked = rank_starts(problem, start_grid(problem))
    settings = problem.settings
    apart = suppress(ranked, settings.suppress_distance, settings.suppress_angle_deg)
    return apart.take(np.arange(min(settings.n_starts + spare, len(apart))))


def start_grid(problem: Problem) -> Starts:
    """Every grid position, layer and yaw for which the pelvis path stays inside the room."""
    settings = problem.settings
    yaws = np.radians(np.arange(0.0, 360.0, settings.yaw_step_deg))
    x, y = (_ticks(size, settings.inset, settings.grid_step) for size in _ground(problem))
    lifts = np.array(settings.start_layers) + problem.scene.floor_z - problem.floor
    axes = np.meshgrid(yaws, x, y, lifts, indexing="ij")
    yaw, at_x, at_y, lift = (axis.ravel() for axis in axes)
    centre = problem.centre.double().cpu().numpy()
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
    """The share of the starts worth keeping, scored exactly, best first.

    The reference engine keeps and scores all of them.
    """
    kept = _admissible(problem, starts)
    if engine_of(problem.settings).prunes:
        coarse = coarse_scores(problem, kept)
        keep = max(_LEAST_KEPT, round(problem.settings.keep_share * len(starts)))
        kept = kept.take(np.argsort(coarse, kind="stable")[:keep])
    exact = kept.scored(exact_scores(problem, kept))
    return exact.take(np.argsort(exact.score, kind="stable"))


def coarse_best(problem: Problem, starts: Starts) -> float:
    """The best coarse score of a start that the filter keeps; raises `NoAdmissibleStart`."""
    return float(coarse_scores(problem, _admissible(problem, starts)).min())


def _admissible(problem: Problem, starts: Starts) -> Starts:
    """Starts that bring the body to what it expects to touch and no bone through anything."""
    threshold = problem.settings.start_filter
    if threshold is not None:
        matching = class_match(problem, starts) >= threshold
        if not matching.any():
            names = ", ".join(problem.expected_classes(floor=True))
            reason = f"no start brings the body to what it expects to touch ({names})"
            raise NoAdmissibleStart(problem.motion.motion_id, problem.scene.scene_id, reason)
        starts = starts.take(matching)
    if problem.settings.bone_clearance is not None:
        clear = bone_clearance(problem, starts) >= problem.settings.bone_clearance
        if not clear.any():
            reason = (
                "every start that reaches what it expects to touch puts a bone through something"
            )
            raise NoAdmissibleStart(problem.motion.motion_id, problem.scene.scene_id, reason)
        starts = starts.take(clear)
    return starts


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


def exact_scores(problem: RigidProblem, starts: Starts) -> Float[np.ndarray, " N"]:
    """E_p of the unaltered motion at every start: all frames and all vertices."""
    engine = engine_of(problem.settings)
    if engine.prunes:
        return _batched(problem, starts, lambda bodies: total(batched_terms(problem, bodies)))
    yaws = torch.as_tensor(starts.yaw).to(problem.k)
    translations = torch.as_tensor(starts.translation).to(problem.k)
    pairs = zip(yaws, translations, strict=True)
    with torch.no_grad():
        bodies = (engine.moved(problem, *pair) for pair in pairs)
        energies = [total(engine.terms(problem, body, 0.0, True)) for body in bodies]
    return np.array([float(energy) for energy in energies])


def coarse_scores(problem: RigidProblem, starts: Starts) -> Float[np.ndarray, " N"]:
    """Cheap stand-in for `exact_scores`, good enough to drop the hopeless starts.

    Reads `coarse_frames` frames, all vertices that are ever in contact and `coarse_vertices`
    others, which stand for all the rest.
    """
    frames = _spread(len(problem.k), problem.settings.coarse_frames)
    ever = problem.contact.any(0).cpu().numpy()
    others = np.flatnonzero(~ever)
    chosen = others[_spread(len(others), problem.settings.coarse_vertices)]
    thin = problem.thinned(frames, np.concatenate([np.flatnonzero(ever), chosen]))
    share = len(others) / max(len(chosen), 1)

    def score(bodies: Float[Tensor, "B T V 3"]) -> Float[Tensor, " B"]:
        terms = batched_terms(thin, bodies)
        # Only the penalty is summed over the vertices that were thinned out.
        return total({**terms, "penetration": terms["penetration"] * share})

    return _batched(thin, starts, score)


def class_match(problem: RigidProblem, starts: Starts) -> Float[np.ndarray, " N"]:
    """Share of the contact vertices that stand nearest to the class they expect.

    Floor and everything else are counted apart and the lower share is the answer, because soles
    outnumber a seat; one where the motion expects nothing. Uses `coarse_frames` frames.
    """
    match = np.ones(len(starts))
    if problem.field.semantics_off:
        return match
    beyond = problem.beyond_floor()
    for group in (beyond, problem.contact & ~beyond):
        frames = np.flatnonzero(group.any(1).cpu())
        if len(frames) == 0:
            continue
        frames = frames[_spread(len(frames), problem.settings.coarse_frames)]
        columns = np.flatnonzero(group[frames].any(0).cpu())
        thin, asked = problem.thinned(frames, columns), group[frames][:, columns]
        found = _batched(thin, starts, partial(_share_right, thin, asked))
        match = np.minimum(match, found)
    return match


def bone_clearance(problem: Problem, starts: Starts) -> Float[np.ndarray, " N"]:
    """Least distance of any bone from any surface, over twice `coarse_frames` frames, metres."""
    bones = problem.bones[_spread(len(problem.bones), 2 * problem.settings.coarse_frames)]
    batch = max(1, _BATCH_POINTS // bones[..., 0].numel())
    least = np.zeros(len(starts))
    for begin in range(0, len(starts), batch):
        part = slice(begin, begin + batch)
        yaw = torch.as_tensor(starts.yaw[part]).to(bones)
        translation = torch.as_tensor(starts.translation[part]).to(bones)
        placed = move(bones, yaw, translation, problem.centre)
        least[part] = problem.field.clearance(placed).amin(-1).double().cpu().numpy()
    return least


def _share_right(
    problem: RigidProblem, asked: Bool[Tensor, "T V"], bodies: Float[Tensor, "B T V 3"]
) -> Float[Tensor, " B"]:
    right = problem.field.label(bodies, asked) == problem.wanted
    return right[:, asked].to(bodies.dtype).mean(-1)


def _batched(
    problem: RigidProblem,
    starts: Starts,
    score: Callable[[Float[Tensor, "B T V 3"]], Float[Tensor, " B"]],
) -> Float[np.ndarray, " N"]:
    """Score the unaltered motion at every start, as many at a time as fit in memory."""
    batch = max(1, _BATCH_POINTS // problem.contact.numel())
    scores = np.zeros(len(starts))
    for begin in range(0, len(starts), batch):
        part = slice(begin, begin + batch)
        yaw = torch.as_tensor(starts.yaw[part]).to(problem.k)
        translation = torch.as_tensor(starts.translation[part]).to(problem.k)
        with torch.no_grad():
            scores[part] = score(problem.moved(yaw, translation)).double().cpu().numpy()
    return scores


def _spread(length: int, count: int) -> Integer[np.ndarray, " M"]:
    """Up to `count` indices spread evenly over a range."""
    spread = np.linspace(0, length - 1, min(count, length)).round()
    return spread.astype(np.int64)


def _stays_inside(problem: Problem, yaw: float, translation: Float[np.ndarray, "3"]) -> bool:
    offset = problem.pelvis[:, :2] - problem.centre.double().cpu().numpy()
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    path = offset @ turn.T + problem.centre.double().cpu().numpy() + translation[:2]
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

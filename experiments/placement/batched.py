"""The batched engine: E_p of all frames, and of many starts, at once.

Only vertices that can cost anything are interpolated: those in contact, and of the others those in
a cell of the volume with a corner inside something. `reference` computes the same the plain way.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from experiments.placement.losses import smoothed_depth
from experiments.placement.problem import Problem, RigidProblem
from experiments.placement.rigid import move


def batched_terms(
    problem: RigidProblem,
    bodies: Float[Tensor, "*B T V 3"],
    huber: float = 0.0,
    semantics: bool = True,
) -> dict[str, Float[Tensor, "*B"]]:
    """E_p by terms for bodies in the scene's frame, for any number of starts at once.

    Fastest where `bodies` is a view of coordinate-major memory, as `move` and skinning leave it.
    """
    starts, settings, volumes = bodies.shape[:-3], problem.settings, problem.field.packed
    points = bodies.movedim(-1, 0).reshape(3, -1)
    touching = _touching(problem, points.shape[1])
    inside = _inside(problem, points.detach())
    read = torch.cat([touching, inside])
    first = torch.zeros_like(read, dtype=torch.int32)
    first[len(touching) :] = volumes.thick_from
    distance = volumes.distance(points, read, first)
    gap, depth = distance[: len(touching)], distance[len(touching) :]

    n_frames, n_vertices = problem.contact.shape
    n_starts, k = points.shape[1] // problem.contact.numel(), problem.touching_k
    gap = gap.reshape(n_starts, len(k))
    per_frame = gap.new_zeros(n_starts * n_frames).index_add(
        0, inside // n_vertices, smoothed_depth(-depth, huber)
    )
    penetration = per_frame.reshape(n_starts, n_frames) @ problem.k
    if settings.contact_tolerance is not None:
        penetration = penetration + smoothed_depth(-gap - settings.contact_tolerance, huber) @ k
    terms = {
        "contact": settings.contact_weight * (gap.square() @ k),
        "penetration": settings.penetration_weight * penetration,
    }
    if semantics and not problem.field.semantics_off:
        label = volumes.nearest_label(points.detach(), touching).reshape(gap.shape)
        misses = (label != problem.touching_wanted).to(k.dtype)
        terms["semantics"] = settings.semantic_weight * (misses @ k)
    return {name: value.reshape(starts) for name, value in terms.items()}


def batched_bodies(
    problem: Problem,
    placed: Float[Tensor, "4"],
    delta: Float[Tensor, "T 22 3"],
    shift: Float[Tensor, "T 3"],
) -> Float[Tensor, "T V 3"]:
    """The vertices of the energy for an altered motion, in the scene's frame."""
    mesh = problem.body.posed(problem.pose + delta, problem.transl + shift, problem.vertex_ids)
    return move(mesh.vertices, placed[0], placed[1:], problem.centre)


def batched_moved(
    problem: RigidProblem, yaw: Float[Tensor, "*B"], translation: Float[Tensor, "*B 3"]
) -> Float[Tensor, "*R 3"]:
    """The unaltered body moved rigidly into the scene's frame."""
    return problem.moved(yaw, translation)


def _touching(problem: RigidProblem, n_points: int) -> Int64[Tensor, " C"]:
    """Columns of the contact vertices, start after start."""
    size = problem.contact.numel()
    begin = torch.arange(0, n_points, size, device=problem.touching.device)
    return (begin[:, None] + problem.touching).flatten()


def _inside(problem: RigidProblem, points: Float[Tensor, "3 P"]) -> Int64[Tensor, " M"]:
    """Columns of the vertices without contact that may be inside something."""
    possible = problem.field.packed.possibly_inside(points)
    free = ~problem.contact.flatten()
    return _places((possible.reshape(-1, len(free)) & free).flatten())


def _places(mask: Bool[Tensor, " P"]) -> Int64[Tensor, " M"]:
    """Where a mask holds."""
    if mask.is_cpu:  # numpy finds them six times as fast
        return torch.from_numpy(np.flatnonzero(mask.numpy()))
    return mask.nonzero().squeeze(1)

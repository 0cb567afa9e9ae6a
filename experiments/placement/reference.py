"""The reference engine: POSA's loss one frame after the other, vectorised within a frame alone.

Slow and plain, for comparison: every frame is skinned, moved, read and summed on its own, and every
vertex reads the scene whether it can cost anything or not.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from experiments.placement.objectives import placement_terms
from experiments.placement.problem import Problem, RigidProblem
from experiments.placement.rigid import move


def reference_terms(
    problem: RigidProblem,
    bodies: Float[Tensor, "T V 3"],
    huber: float = 0.0,
    semantics: bool = True,
) -> dict[str, Float[Tensor, ""]]:
    """E_p by terms, as `RigidProblem.terms` gives it, for one placement."""
    sums: dict[str, Float[Tensor, ""]] = {}
    for frame in range(len(problem.k)):
        for name, value in _frame_terms(problem, frame, bodies[frame], huber, semantics).items():
            sums[name] = sums[name] + value if name in sums else value
    return sums


def reference_bodies(
    problem: Problem,
    placed: Float[Tensor, "4"],
    delta: Float[Tensor, "T 22 3"],
    shift: Float[Tensor, "T 3"],
) -> Float[Tensor, "T V 3"]:
    """The vertices of the energy for an altered motion, skinned and moved frame by frame."""
    frames = []
    for frame in range(len(delta)):
        pose = problem.pose[frame : frame + 1] + delta[frame : frame + 1]
        transl = problem.transl[frame : frame + 1] + shift[frame : frame + 1]
        vertices = problem.body.posed(pose, transl, problem.vertex_ids).vertices
        frames.append(move(vertices, placed[0], placed[1:], problem.centre))
    return torch.cat(frames)


def reference_moved(
    problem: RigidProblem, yaw: Float[Tensor, ""], translation: Float[Tensor, "3"]
) -> Float[Tensor, "T V 3"]:
    """The unaltered body moved rigidly, frame by frame."""
    frames = [move(frame, yaw, translation, problem.centre) for frame in problem.vertices]
    return torch.stack(frames)


def _frame_terms(
    problem: RigidProblem, frame: int, body: Float[Tensor, "V 3"], huber: float, semantics: bool
) -> dict[str, Float[Tensor, ""]]:
    """POSA's three terms of one body, weighted."""
    only = slice(frame, frame + 1)
    contact, wanted = problem.contact[only], problem.wanted[only]
    plain, thick = problem.field.plain, problem.field.thick
    distance = torch.where(contact, plain.distance(body), thick.distance(body))
    compare = semantics and not problem.field.semantics_off
    label = plain.label(body)[None] if compare else None
    return placement_terms(
        distance, label, contact, wanted, problem.k[only], problem.settings, huber
    )

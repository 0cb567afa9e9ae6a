"""Whole-sequence refinement: Adam on the body vectors of all frames (Wang et al., CVPR 2021, 3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from experiments.body.model import JOINT_NAMES, BodyMesh, BodyModel
from experiments.interaction.mesh import feature_vertices
from experiments.scene.lookup import SceneLookup
from experiments.scene.scene import Scene
from experiments.synthesis.body_vector import to_pose
from experiments.synthesis.losses import CONTACT_REGIONS, contact, motion, penetration
from experiments.synthesis.stance import Stances, find_stances, skating

LEARNING_RATE = 0.02
TERMS = ("contact", "collision", "motion", "skating")
_ANKLES = [JOINT_NAMES.index(name) for name in ("left_ankle", "right_ankle")]
_TOES = [JOINT_NAMES.index(name) for name in ("left_foot", "right_foot")]


@dataclass(frozen=True)
class Phase:
    """A number of iterations with one set of weights, in the order of `TERMS`."""

    iterations: int
    weights: tuple[float, float, float, float]


PHASES = (Phase(20, (2.0, 2.0, 0.5, 0.0)), Phase(50, (1.0, 1.0, 0.5, 1.0)))
"""The published schedule; the reconstruction weight is 0 in it."""


@dataclass(frozen=True)
class Refined:
    """A refined sequence and how it came about."""

    vectors: Float[Tensor, "T 135"]
    terms: dict[str, float]
    """Unweighted terms of these vectors."""
    iterations: int
    trace: tuple[float, ...]
    """Weighted loss before every step."""
    stopped: str
    """"done", or why the last finite state was taken."""


def refine(
    vectors: Float[Tensor, "T 135"],
    subgoals: list[int],
    body: BodyModel,
    scene: Scene,
    phases: tuple[Phase, ...] = PHASES,
) -> Refined:
    """Lower contact, collision, motion and skating over the whole sequence at once.

    `subgoals` are the frames whose bodies are held to where the sub-goal network put them. If a
    loss or gradient stops being finite, the vectors of the last finite loss are the answer.
    """
    objective = _Objective(vectors, subgoals, body, scene)
    current = vectors.clone()
    trace: list[float] = []
    for phase in phases:
        if phase.weights[-1] > 0 and objective.stances is None:
            objective.find_stances(current)
        current, steps, finite = _descend(objective, current, phase)
        trace += steps
        if not finite:
            reason = f"not finite at iteration {len(trace)}: last finite state taken"
            return Refined(current, objective.values(current), len(trace), tuple(trace), reason)
    return Refined(current, objective.values(current), len(trace), tuple(trace), "done")


def _descend(
    objective: _Objective, start: Float[Tensor, "T 135"], phase: Phase
) -> tuple[Float[Tensor, "T 135"], list[float], bool]:
    """One phase of Adam: the last vectors of finite loss, the losses, and whether all were finite."""
    variables = start.clone().requires_grad_(True)
    optimiser = torch.optim.Adam([variables], lr=LEARNING_RATE)
    weights = dict(zip(TERMS, phase.weights, strict=True))
    finite, trace = start, list[float]()
    for _ in range(phase.iterations):
        optimiser.zero_grad()
        terms = objective.terms(variables)
        loss = torch.stack([weights[name] * value for name, value in terms.items()]).sum()
        (gradient,) = torch.autograd.grad(loss, variables)
        if not bool(torch.isfinite(loss)) or not bool(torch.isfinite(gradient).all()):
            return finite, trace, False
        finite = variables.detach().clone()
        trace.append(float(loss.detach()))
        variables.grad = gradient
        optimiser.step()
    last = variables.detach()
    return (last, trace, True) if objective.finite(last) else (finite, trace, False)


class _Objective:
    """The four terms of a sequence in a room."""

    def __init__(
        self, vectors: Float[Tensor, "T 135"], subgoals: list[int], body: BodyModel, scene: Scene
    ) -> None:
        self._body, self._lookup = body, SceneLookup(scene)
        self._floor_z, self._subgoals = scene.floor_z, subgoals
        self._ids = feature_vertices(body)
        touching = np.concatenate([body.regions[name] for name in CONTACT_REGIONS])
        soles = np.concatenate([body.regions[f"{side}_sole"] for side in ("left", "right")])
        self._contact = torch.as_tensor(np.flatnonzero(np.isin(self._ids, touching)))
        self._feet = torch.as_tensor(np.flatnonzero(np.isin(self._ids, soles)))
        self.stances: Stances | None = None
        with torch.no_grad():
            self._wanted = self._posed(vectors[subgoals]).vertices

    def terms(self, vectors: Float[Tensor, "T 135"]) -> dict[str, Float[Tensor, ""]]:
        """The terms by name, in the order of `TERMS`."""
        mesh = self._posed(vectors)
        vertices = mesh.vertices
        distance = self._lookup.distance(vertices)
        ends = vertices[self._subgoals]
        return {
            "contact": contact(distance[:, self._contact]),
            "collision": penetration(distance),
            "motion": motion(vertices, vertices[:, self._feet], ends, self._wanted),
            "skating": self._skating(mesh.joints),
        }

    def values(self, vectors: Float[Tensor, "T 135"]) -> dict[str, float]:
        """The terms as numbers."""
        with torch.no_grad():
            return {name: float(value) for name, value in self.terms(vectors).items()}

    def finite(self, vectors: Float[Tensor, "T 135"]) -> bool:
        """Whether every term of the vectors is a number."""
        return bool(np.isfinite(list(self.values(vectors).values())).all())

    def find_stances(self, vectors: Float[Tensor, "T 135"]) -> None:
        """Fix which foot stands when, once, from the ankles' speeds in these vectors."""
        with torch.no_grad():
            self.stances = find_stances(self._posed(vectors).joints[:, _ANKLES])

    def _skating(self, joints: Float[Tensor, "T 22 3"]) -> Float[Tensor, ""]:
        if self.stances is None:
            return joints.new_zeros(())
        return skating(joints[:, _ANKLES], joints[:, _TOES], self.stances, self._floor_z)

    def _posed(self, vectors: Float[Tensor, "T 135"]) -> BodyMesh:
        pose, transl = to_pose(vectors)
        return self._body.posed(pose, transl, self._ids)

"""Whole-sequence refinement: Adam on the body vectors of all frames (Wang et al., CVPR 2021, 3.4).

Terms, weights and schedule are those of the published code, but for what
`docs/decisions/synthesis-refinement.md` says.
"""

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
from experiments.synthesis.body_vector import POSE, SIZE, to_pose
from experiments.synthesis.losses import contact
from experiments.synthesis.stance import Soles, Stance, find_stances, skating

LEARNING_RATE = 0.02
POSE_SPREAD = 0.1
"""Standard deviation of the numbers of a pose over the motion library. The published variables of a
pose are a latent code of unit spread; measuring ours in its spread gives Adam's steps the same reach."""
TERMS = ("contact", "collision", "motion", "skating")
CONTACT_REGIONS = (
    *("back", "buttocks", "thigh_backs", "left_hand", "right_hand", "left_sole", "right_sole"),
)
"""Parts that the contact term draws to the scene."""
_ANKLES = [JOINT_NAMES.index(name) for name in ("left_ankle", "right_ankle")]


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
    ends: Float[Tensor, "2 135"],
    body: BodyModel,
    scene: Scene,
    phases: tuple[Phase, ...] = PHASES,
) -> Refined:
    """Lower contact, collision, motion and skating over the whole sequence at once.

    `ends` are the bodies of the first and the last sub-goal, to which the sequence is tied and which
    stay as they are. If a loss or gradient stops being finite, the vectors of the last finite loss
    are the answer.
    """
    objective = _Objective(ends, body, scene)
    current = vectors.clone()
    trace: list[float] = []
    for phase in phases:
        objective.fix_stances(current)
        current, steps, finite = _descend(objective, current, phase)
        trace += steps
        if not finite:
            reason = f"not finite at iteration {len(trace)}: last finite state taken"
            return Refined(current, objective.values(current), len(trace), tuple(trace), reason)
    return Refined(current, objective.values(current), len(trace), tuple(trace), "done")


def collision(distance: Float[Tensor, "T V"]) -> Float[Tensor, ""]:
    """Mean depth of the vertices that are inside something, metres, averaged over frames.

    The published code sums over frames; why this does not is in the decision note.
    """
    inside = distance < 0
    depth = torch.where(inside, -distance, torch.zeros_like(distance)).sum(dim=1)
    return (depth / inside.sum(dim=1).clamp(min=1)).mean()


def motion(
    body: Float[Tensor, "T V 3"],
    soles: Soles,
    end_bodies: Float[Tensor, "2 V 3"],
    end_soles: tuple[Float[Tensor, "2 L 3"], Float[Tensor, "2 R 3"]],
) -> Float[Tensor, ""]:
    """Squared steps of body, left and right sole, mean over coordinates and summed over frames, m².

    The steps from the first sub-goal's body to the first frame and from the last frame to the last
    sub-goal's body are counted alike, there for the sole that has moved less.
    """
    parts = (body, *soles)
    steps = sum((part[1:] - part[:-1]).square().mean(dim=(1, 2)).sum() for part in parts)
    total = body.new_zeros(()) + steps
    for frame in (0, -1):
        total = total + (body[frame] - end_bodies[frame]).square().mean()
        pairs = zip(soles, end_soles, strict=True)
        total = total + torch.stack([(s[frame] - e[frame]).square().mean() for s, e in pairs]).min()
    return total


def _descend(
    objective: _Objective, start: Float[Tensor, "T 135"], phase: Phase
) -> tuple[Float[Tensor, "T 135"], list[float], bool]:
    """One phase of Adam: the last vectors of finite loss, the losses, and whether all were finite."""
    scale = torch.ones(SIZE).index_fill(0, torch.arange(SIZE)[POSE], POSE_SPREAD)
    variables = (start / scale).requires_grad_(True)
    optimiser = torch.optim.Adam([variables], lr=LEARNING_RATE)
    weights = dict(zip(TERMS, phase.weights, strict=True))
    finite, trace = start, list[float]()
    for _ in range(phase.iterations):
        optimiser.zero_grad()
        terms = objective.terms(variables * scale)
        loss = torch.stack([weights[name] * value for name, value in terms.items()]).sum()
        (gradient,) = torch.autograd.grad(loss, variables)
        if not bool(torch.isfinite(loss)) or not bool(torch.isfinite(gradient).all()):
            return finite, trace, False
        finite = variables.detach() * scale
        trace.append(float(loss.detach()))
        variables.grad = gradient
        optimiser.step()
    last = variables.detach() * scale
    return (last, trace, True) if objective.finite(last) else (finite, trace, False)


class _Objective:
    """The four terms of a sequence in a room."""

    def __init__(self, ends: Float[Tensor, "2 135"], body: BodyModel, scene: Scene) -> None:
        self._body, self._lookup = body, SceneLookup(scene)
        self._ids = feature_vertices(body)
        self._contact = self._columns(*CONTACT_REGIONS)
        self._soles = self._columns("left_sole"), self._columns("right_sole")
        self._stances: tuple[Stance, ...] = ()
        with torch.no_grad():
            self._ends = self._posed(ends).vertices

    def terms(self, vectors: Float[Tensor, "T 135"]) -> dict[str, Float[Tensor, ""]]:
        """The terms by name, in the order of `TERMS`."""
        mesh = self._posed(vectors)
        soles = self._soles_of(mesh.vertices)
        distance = self._lookup.distance(mesh.vertices)
        return {
            "contact": contact(distance[:, self._contact]),
            "collision": collision(distance),
            "motion": motion(mesh.vertices, soles, self._ends, self._soles_of(self._ends)),
            "skating": skating(mesh.joints[:, _ANKLES], soles, self._stances),
        }

    def values(self, vectors: Float[Tensor, "T 135"]) -> dict[str, float]:
        """The terms as numbers."""
        with torch.no_grad():
            return {name: float(value) for name, value in self.terms(vectors).items()}

    def finite(self, vectors: Float[Tensor, "T 135"]) -> bool:
        """Whether every term of the vectors is a number."""
        return bool(np.isfinite(list(self.values(vectors).values())).all())

    def fix_stances(self, vectors: Float[Tensor, "T 135"]) -> None:
        """Fix which foot stands when, and where, from these vectors."""
        with torch.no_grad():
            mesh = self._posed(vectors)
            self._stances = find_stances(mesh.joints[:, _ANKLES], self._soles_of(mesh.vertices))

    def _soles_of(self, vertices: Float[Tensor, "T V 3"]) -> Soles:
        return vertices[:, self._soles[0]], vertices[:, self._soles[1]]

    def _columns(self, *regions: str) -> Tensor:
        vertices = np.concatenate([self._body.regions[name] for name in regions])
        return torch.as_tensor(np.flatnonzero(np.isin(self._ids, vertices)))

    def _posed(self, vectors: Float[Tensor, "T 135"]) -> BodyMesh:
        pose, transl = to_pose(vectors)
        return self._body.posed(pose, transl, self._ids)

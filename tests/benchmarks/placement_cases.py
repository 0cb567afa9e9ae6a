"""The (motion, room) cases of the placement benchmark."""

from __future__ import annotations

import dataclasses

import numpy as np

from experiments.body.embedded import load_body
from experiments.body.model import BodyMesh, BodyModel
from experiments.interaction.registry import INTERACTIONS
from experiments.motion.library import default_motions, load_motion
from experiments.motion.motion import Motion
from experiments.placement.candidates import Starts, start_grid
from experiments.placement.problem import Problem, build_problem
from experiments.placement.settings import PlacementSettings
from experiments.scene.baking import load_room
from experiments.scene.scene import Scene
from experiments.weighting.geometric import geometric_weights

PLAIN = PlacementSettings(
    interaction="geometric", start_filter=None, bone_clearance=None, max_gap=None, max_depth=None
)
"""No filter: every start is scored. The rule for contacts, so that figures stay comparable."""


def clip(motion_id: str, n_frames: int, begin: int = 0) -> Motion:
    """`n_frames` frames of a library motion from `begin`, walked to and fro where it is shorter."""
    motion = load_motion(motion_id)
    last = motion.n_frames - 1
    to_and_fro = np.abs((np.arange(begin, begin + n_frames) + last) % (2 * last) - last)
    return dataclasses.replace(
        motion,
        pose=motion.pose[to_and_fro],
        transl=motion.transl[to_and_fro],
        times=np.arange(n_frames) / motion.fps,
    )


def problem_of(motion: Motion, scene: Scene, settings: PlacementSettings) -> Problem:
    """The problem that PACE solves: geometric frame weights, the likeliest feature map."""
    body = load_body()
    features = INTERACTIONS[settings.interaction](motion, body, scene.class_names())[0]
    problem = build_problem(motion, scene, body, settings, features)
    weights = geometric_weights(problem.vertices.double().numpy(), motion.times, features)
    return problem.weighted(weights)


def random_case(
    rng: np.random.Generator, rooms: dict[str, Scene], n_frames: int, n_starts: int
) -> tuple[Problem, Starts]:
    """A random stretch of a random motion, a random room, and random starts of a fine grid."""
    motions = [spec.motion_id for spec in default_motions()]
    settings = dataclasses.replace(PLAIN, yaw_step_deg=15.0)
    while True:
        room = rooms[list(rooms)[rng.integers(len(rooms))]]
        motion = clip(motions[rng.integers(len(motions))], n_frames, int(rng.integers(0, 200)))
        problem = problem_of(motion, room, settings)
        grid = start_grid(problem)
        if len(grid) >= n_starts:
            return problem, grid.take(rng.permutation(len(grid))[:n_starts])


def rooms_of(names: tuple[str, ...]) -> dict[str, Scene]:
    """Rooms by name, baked or read from the cache."""
    return {name: load_room(name) for name in names}


@dataclasses.dataclass(frozen=True)
class WholeBody:
    """A body that skins its full mesh and then keeps what was asked for, as POSA's code does."""

    inner: BodyModel

    def posed(self, pose, transl, vertex_ids):  # type: ignore[no-untyped-def]
        """Skin all vertices, keep some."""
        mesh = self.inner.posed(pose, transl)
        return BodyMesh(mesh.vertices[:, vertex_ids], mesh.joints, np.zeros((0, 3), dtype=int))

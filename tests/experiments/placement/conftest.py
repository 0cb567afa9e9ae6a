"""Small problems: a few frames in the room with one seat."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch

from experiments.interaction.geometric import geometric_features
from experiments.placement.problem import Problem, build_problem
from experiments.placement.settings import PlacementSettings
from experiments.weighting.geometric import geometric_weights


@pytest.fixture(scope="session")
def make_problem(slim, sit, seat_room) -> Callable[..., Problem]:
    """make_problem(n_frames, dtype, fps, **settings): the sit in the room with the seat."""

    def make(n_frames=40, dtype=torch.float32, fps=30.0, **changes) -> Problem:
        motion = sit(n_frames, stand=0.2, fps=fps)
        settings = PlacementSettings(**changes)
        features = geometric_features(motion, slim, seat_room.class_names())[0]
        problem = build_problem(motion, seat_room, slim, settings, features, dtype=dtype)
        vertices = problem.vertices.double().numpy()
        return problem.weighted(geometric_weights(vertices, motion.times, features))

    return make

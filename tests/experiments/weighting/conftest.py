"""Small inputs of the network g, and a network with seeded random weights."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch

from experiments.weighting.inputs import MotionInputs
from experiments.weighting.network import N_BINS, FrameWeightNetwork
from experiments.weighting.training import TrainingSettings, begin_run


@pytest.fixture(scope="session")
def network() -> FrameWeightNetwork:
    centres = np.linspace(0.5, 1.6, N_BINS)
    run = begin_run(centres, TrainingSettings("geometric", seed=3))
    return run.network.requires_grad_(False)


@pytest.fixture(scope="session")
def some_inputs() -> Callable[..., MotionInputs]:
    """some_inputs(n_frames, seed): random points, classes and velocities at 30 fps."""

    def make(n_frames: int = 12, seed: int = 0, stride: int = 1) -> MotionInputs:
        generator = torch.Generator().manual_seed(seed)
        return MotionInputs(
            points=torch.randn(n_frames, 20, 4, generator=generator),
            classes=torch.randint(0, 42, (n_frames, 20), generator=generator),
            velocity=torch.randn(n_frames, 66, generator=generator),
            stride=stride,
        )

    return make

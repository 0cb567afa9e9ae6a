"""A body, closed-form motions of it, and a room with one seat: shared by the placement tests."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch

from experiments.body.embedded import load_body
from experiments.body.model import BodyModel
from experiments.motion.motion import Motion
from experiments.scene.scene import Scene
from experiments.scene.synthetic import synthetic_room

MakeMotion = Callable[..., Motion]


@pytest.fixture(scope="session")
def slim() -> BodyModel:
    return load_body("male_slim")


@pytest.fixture(scope="session")
def seat_room() -> Scene:
    """3 x 3 m, one chair-like box 0.45 m high from (1.2, 1.5) to (1.8, 2.0)."""
    return synthetic_room()


@pytest.fixture(scope="session")
def empty_room() -> Scene:
    return synthetic_room(boxes={}, scene_id="empty")


@pytest.fixture(scope="session")
def sit(slim: BodyModel) -> MakeMotion:
    """sit(n_frames, stand): stands for that share of the clip, sits down, stays. Feet on z = 0."""

    def make(n_frames: int = 60, stand: float = 0.4, fps: float = 30.0) -> Motion:
        progress = np.clip((np.arange(n_frames) / n_frames - stand) / 0.25, 0, 1)
        bend = np.pi / 2 * progress**2 * (3 - 2 * progress)
        pose = _standing_pose(n_frames)
        pose[:, 1:3, 0] = -bend[:, None]
        pose[:, 4:6, 0] = bend[:, None]
        return _feet_at_origin(slim, pose, fps, "sit")

    return make


@pytest.fixture(scope="session")
def walk(slim: BodyModel) -> MakeMotion:
    """walk(metres, n_frames): stride-like swinging legs while gliding along -y at constant speed."""

    def make(metres: float = 1.5, n_frames: int = 60, fps: float = 30.0) -> Motion:
        pose = _standing_pose(n_frames)
        swing = 0.35 * np.sin(2 * np.pi * np.arange(n_frames) / 30)
        pose[:, 1, 0], pose[:, 2, 0] = swing, -swing
        motion = _feet_at_origin(slim, pose, fps, "walk")
        transl = motion.transl.copy()
        transl[:, 1] = -np.linspace(0, metres, n_frames)
        return Motion(pose, transl, motion.times, fps, "walk", "walk", "test")

    return make


def _standing_pose(n_frames: int) -> np.ndarray:
    pose = np.zeros((n_frames, 22, 3))
    pose[:, 0, 0] = np.pi / 2
    pose[:, 16, 2], pose[:, 17, 2] = -1.2, 1.2
    return pose


def _feet_at_origin(body: BodyModel, pose: np.ndarray, fps: float, name: str) -> Motion:
    """Root translation that keeps the soles on z = 0 and their middle where frame 0 has it."""
    soles = np.union1d(body.regions["left_sole"], body.regions["right_sole"])
    zero = torch.zeros((len(pose), 3), dtype=torch.float64)
    feet = body.posed(torch.as_tensor(pose), zero, soles).vertices.numpy()
    transl = np.zeros((len(pose), 3))
    transl[:, 2] = -feet[..., 2].min(1)
    transl[:, :2] = -feet[..., :2].mean(1)
    return Motion(pose, transl, np.arange(len(pose)) / fps, fps, name, name, "test")

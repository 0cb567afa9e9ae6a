"""Bodies, random poses and a small file of the SMPL-X format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from experiments.body.embedded import BODY_FILE, read_body
from experiments.body.model import PARENTS
from experiments.body.skinned_body import SkinnedBody


@pytest.fixture(scope="session")
def male() -> SkinnedBody:
    return read_body(BODY_FILE, "male_slim")


@pytest.fixture
def random_pose() -> Callable[[int, int], tuple[torch.Tensor, torch.Tensor]]:
    def draw(seed: int, n_frames: int) -> tuple[torch.Tensor, torch.Tensor]:
        rng = np.random.default_rng(seed)
        pose, transl = rng.normal(size=(n_frames, 22, 3)), rng.normal(size=(n_frames, 3))
        return torch.as_tensor(pose), torch.as_tensor(transl)

    return draw


@pytest.fixture(scope="session")
def smplx_arrays(male: SkinnedBody) -> dict[str, Any]:
    """The arrays of an SMPL-X file with 615 vertices: our own small mesh under 55 joints."""
    rng = np.random.default_rng(3)
    vertices, count = male.rest_vertices[male.subset], len(male.subset)
    weights = np.zeros((count, 55))
    weights[:, :22] = male.weights[male.subset]
    weights /= weights.sum(axis=1, keepdims=True)
    joints = np.concatenate([male.rest_joints, rng.normal(scale=0.02, size=(33, 3))])
    parents = np.array([*PARENTS, 15, 15, 15, *_finger_parents(20, 25), *_finger_parents(21, 40)])
    joints[22:] += joints[
        np.where(parents[22:] == 15, 15, np.where(np.arange(22, 55) < 40, 20, 21))
    ]
    for wrist, first in ((20, 25), (21, 40)):
        hand = np.flatnonzero(weights[:, wrist] > 0.999)
        fingers = first + rng.integers(0, 15, size=len(hand))
        weights[hand, wrist], weights[hand, fingers] = 0.4, weights[hand, wrist] - 0.4
    affine = np.concatenate([vertices, np.ones((count, 1))], axis=1)
    regressor = np.concatenate([joints, np.ones((55, 1))], axis=1) @ np.linalg.pinv(affine)
    table = np.stack([parents, np.arange(55)]).astype(np.uint32)
    return {
        "v_template": vertices,
        "shapedirs": rng.normal(scale=2e-3, size=(count, 3, 12)),
        "posedirs": rng.normal(scale=2e-3, size=(count, 3, 486)),
        "J_regressor": regressor,
        "weights": weights,
        "kintree_table": table,
        "f": male.subset_faces.astype(np.uint32),
        "hands_meanl": rng.normal(scale=0.3, size=45),
        "hands_meanr": rng.normal(scale=0.3, size=45),
    }


@pytest.fixture
def smplx_file(
    smplx_arrays: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Path]:
    """Write the file, with some arrays changed (or left out, if None)."""
    monkeypatch.setenv("PACE_CACHE", str(tmp_path / "cache"))

    def write(**changes: Any) -> Path:
        arrays = {k: v for k, v in (smplx_arrays | changes).items() if v is not None}
        np.savez(tmp_path / "SMPLX_TINY.npz", **arrays)
        return tmp_path / "SMPLX_TINY.npz"

    return write


def _finger_parents(wrist: int, first: int) -> list[int]:
    return [wrist if i % 3 == 0 else first + i - 1 for i in range(15)]

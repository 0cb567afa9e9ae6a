"""Small data sets of the interaction model."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.interaction.contact_dataset import ClipRecord, ContactDataset

N_VERTICES = 6


def small_dataset(seed: int, split: str = "train") -> ContactDataset:
    """Three clips of eight random bodies with six vertices."""
    rng = np.random.default_rng(seed)
    clips = tuple(
        ClipRecord(f"{split}{index}", kind, split, "male_slim", index, family)
        for index, (kind, family) in enumerate(
            [("captured", "walk"), ("authored", "stand"), ("authored", "sit_thighs")]
        )
    )
    n = 24
    return ContactDataset(
        vertex_ids=np.arange(N_VERTICES),
        vertices=rng.normal(size=(n, N_VERTICES, 3)).astype(np.float16),
        height=rng.uniform(0, 0.2, (n, N_VERTICES)).astype(np.float16),
        distance=rng.uniform(0, 0.08, (n, N_VERTICES)).astype(np.float16),
        nearest=rng.choice(np.array([2, 3, 5], dtype=np.uint8), (n, N_VERTICES)),
        clip=np.repeat(np.arange(3), 8),
        frame=np.tile(np.arange(8), 3),
        clips=clips,
    )


@pytest.fixture
def train_bodies() -> ContactDataset:
    """Random bodies to learn from."""
    return small_dataset(0)


@pytest.fixture
def test_bodies() -> ContactDataset:
    """Random bodies to predict for."""
    return small_dataset(1, "test")

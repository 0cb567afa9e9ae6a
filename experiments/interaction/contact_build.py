"""Building the data sets of the interaction model: poses, one scene a clip, labels; cached."""

from __future__ import annotations

from experiments.interaction.contact_dataset import ContactDataset, Progress


def build_dataset(seed: int = 0, progress: Progress | None = None) -> ContactDataset:
    """Training and test clips, each with supports built to fit it. Cached by recipe and seed."""
    raise NotImplementedError


def build_free_dataset(seed: int = 0, progress: Progress | None = None) -> ContactDataset:
    """The second test set: held-out clips placed in furnished rooms by geometry alone. Cached."""
    raise NotImplementedError


def build_second_draw(seed: int = 0, progress: Progress | None = None) -> ContactDataset:
    """The test clips of `build_dataset` again, frame by frame the same, with other scenes drawn."""
    raise NotImplementedError

"""The test sets of the interaction model, all from one seed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from experiments.interaction.contact_build import (
    build_dataset,
    build_second_draw,
    cached_dataset,
    held_out_clips,
    joined,
)
from experiments.interaction.contact_dataset import ContactDataset, Progress
from experiments.interaction.contact_report import TestSets
from experiments.interaction.free_placement import free_rooms, place_freely

Show = Callable[[str, int, int], None]
"""(stage, done, of how many)."""


def held_out_sets(seed: int, show: Show) -> TestSets:
    """What `report` needs: training bodies, both test sets, the second draw and the motions.

    Built on first use (five minutes, most of it the furnished rooms), cached afterwards.
    """
    whole = build_dataset(seed, partial(show, "bodies and scenes"))
    second = build_second_draw(seed, partial(show, "other scenes"))
    free = build_free_dataset(seed, partial(show, "furnished rooms"))
    fitted = whole.select(whole.bodies_of(split="test"))
    motions = {clip.name: clip.motion for clip in held_out_clips(seed)}
    # A clip in a room is the same motion, moved: the rule is given it unmoved.
    motions |= {clip.name: motions[clip.name.split("@")[0]] for clip in free.clips}
    train = whole.select(whole.bodies_of(split="train"))
    return TestSets(train, fitted, second, free, motions)


def build_free_dataset(seed: int = 0, progress: Progress | None = None) -> ContactDataset:
    """Held-out clips placed in furnished rooms by geometry alone. Cached by recipe and seed."""
    return cached_dataset("free", seed, lambda: _placed(seed, progress))


def _placed(seed: int, progress: Progress | None) -> ContactDataset:
    clips = [clip for clip in held_out_clips(seed) if clip.name.endswith("/0")]
    return joined(list(place_freely(clips, free_rooms(seed), seed, progress)))

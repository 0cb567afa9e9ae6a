"""Rooms of the training data."""

from __future__ import annotations

import numpy as np

from experiments.scene.furnish import furnish
from experiments.scene.rooms import TEST_ROOMS
from experiments.scene.scene import MPCAT40
from experiments.synthesis.training_rooms import random_layout, room_records


def test_no_room_is_in_both_splits_and_no_test_room_in_either() -> None:
    records = room_records(12, 5, seed=3)
    names = [record.name for record in records]
    assert len(set(names)) == len(names) == 17
    assert [record.split for record in records] == ["train"] * 12 + ["held_out"] * 5
    assert not [name for name in names if name.startswith(TEST_ROOMS)]


def test_a_random_room_is_the_same_for_the_same_seed_and_another_for_another() -> None:
    assert random_layout(5) == random_layout(5)
    assert random_layout(5) != random_layout(6)


def test_random_rooms_offer_beds_or_sofas_chairs_and_tables() -> None:
    labels = [{MPCAT40[item.label] for item in random_layout(seed).items} for seed in range(40)]
    shares = [
        np.mean([bool(found & wanted) for found in labels])
        for wanted in ({"bed", "sofa"}, {"chair", "stool"}, {"table", "cabinet", "shelving"})
    ]
    assert min(shares) > 0.9


def test_furniture_of_a_random_room_stands_apart_and_inside() -> None:
    for seed in range(4):
        layout = random_layout(seed)
        boxes = [placed.triangles().reshape(-1, 3)[:, :2] for placed in furnish(layout)]
        low, high = (np.array([f(box, axis=0) for box in boxes]) for f in (np.min, np.max))
        assert (low > -0.05).all() and (high < np.array(layout.size[:2]) + 0.05).all()
        apart = (low[:, None] >= high[None] - 0.02) | (high[:, None] <= low[None] + 0.02)
        assert (apart.any(axis=2) | np.eye(len(boxes), dtype=bool)).all()

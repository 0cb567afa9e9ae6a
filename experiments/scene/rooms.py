"""The rooms that come with the project: four to test in, two to train on."""

from __future__ import annotations

TEST_ROOMS: tuple[str, ...] = ("bedroom", "library", "booth", "living")
"""After the four PROX test scenes: a bedroom, a library, a sitting booth, an open sofa area."""

TRAINING_ROOMS: tuple[str, ...] = ("office", "dining")
"""Never shown in a study; learned models see these and their variations only."""

ROOMS: tuple[str, ...] = TEST_ROOMS + TRAINING_ROOMS

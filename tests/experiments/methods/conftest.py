"""One short sit, placed by every method that places a given motion."""

from __future__ import annotations

import dataclasses

import pytest

from experiments.methods import METHODS
from experiments.placement.settings import PRESETS

PLACING = ("posa_t", "paak", "pace", "pace_no_pose", "pace_no_motion", "posa_t_plus", "paak_plus",
           "pace_plus")  # fmt: skip


@pytest.fixture(scope="session")
def placed(sit, slim, seat_room):
    """(motion, {method: placement}) in the room with one seat, preset fast, contacts by rule."""
    motion = sit(45, stand=0.3)
    settings = dataclasses.replace(PRESETS["fast"], interaction="geometric")
    return motion, {
        name: METHODS[name].place(motion, seat_room, slim, settings, 1) for name in PLACING
    }

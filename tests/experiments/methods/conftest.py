"""One short sit, placed by every method that places a given motion."""

from __future__ import annotations

import pytest

from experiments.methods import METHODS
from experiments.placement.settings import PRESETS

PLACING = ("posa_t", "paak", "pace", "pace_no_pose", "pace_no_motion", "posa_t_plus", "paak_plus",
           "pace_plus")  # fmt: skip


@pytest.fixture(scope="session")
def placed(sit, slim, seat_room):
    """(motion, {method: placement}) in the room with one seat, preset fast."""
    motion = sit(45, stand=0.3)
    settings = PRESETS["fast"]
    return motion, {
        name: METHODS[name].place(motion, seat_room, slim, settings, 1) for name in PLACING
    }

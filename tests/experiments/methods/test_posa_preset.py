"""POSA's own settings, frame by frame: the slow preset goes the whole way."""

from __future__ import annotations

import dataclasses

import pytest

from experiments.methods import METHODS
from experiments.placement.settings import PRESETS

POSA = dataclasses.replace(PRESETS["posa"], interaction="geometric")
pytestmark = pytest.mark.slow


def test_the_preset_of_posa_ends_where_the_batched_engine_ends(sit, slim, seat_room) -> None:
    motion = sit(12)
    by_frame, batched = (
        METHODS["posa_t"].place(
            motion, seat_room, slim, dataclasses.replace(POSA, engine=engine), 0
        )
        for engine in ("reference", "batched")
    )
    assert by_frame.info["preset"] == "posa" and by_frame.info["starts"] == 10
    # The same search by two engines; twenty line searches let rounding grow to some per mille.
    assert by_frame.terms["total"] == pytest.approx(batched.terms["total"], rel=0.02)


def test_pace_under_the_preset_of_posa_ends_no_higher_than_posa_t(sit, slim, seat_room) -> None:
    motion = sit(12)
    placed = METHODS["pace"].place(motion, seat_room, slim, POSA, 0)
    assert placed.altered
    rigid = placed.info["rigid_energies"][placed.info["chosen_start"]]
    assert placed.terms["total"] <= rigid * (1 + 1e-6)

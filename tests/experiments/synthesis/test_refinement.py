from __future__ import annotations

import numpy as np
import pytest
import torch

from experiments.synthesis import refinement
from experiments.synthesis.body_vector import to_vectors
from experiments.synthesis.refinement import LEARNING_RATE, PHASES, Phase, refine


@pytest.fixture(scope="module")
def sunk(walk) -> torch.Tensor:
    """A walk through the seat room, 5 cm too low."""
    vectors = torch.tensor(to_vectors(walk(1.5, 40))).float()
    return vectors + torch.tensor([0.6, 2.4, -0.05] + [0.0] * 132)


def test_the_schedule_is_the_published_one() -> None:
    assert LEARNING_RATE == 0.02
    first, second = PHASES
    assert (first.iterations, first.weights) == (20, (2.0, 2.0, 0.5, 0.0))
    assert (second.iterations, second.weights) == (50, (1.0, 1.0, 0.5, 1.0))


def test_refinement_lifts_a_sunk_body_out_of_the_floor(sunk, slim, seat_room) -> None:
    before = refine(sunk, [0, 39], slim, seat_room, ())
    after = refine(sunk, [0, 39], slim, seat_room)
    assert after.stopped == "done" and after.iterations == 70 and len(after.trace) == 70
    assert after.terms["collision"] < 0.3 * before.terms["collision"]
    assert torch.equal(before.vectors, sunk)


def test_every_phase_ends_below_its_start(sunk, slim, seat_room) -> None:
    trace = refine(sunk, [0, 39], slim, seat_room).trace
    assert min(trace[15:20]) < trace[0] and min(trace[60:]) < trace[20]


def test_the_first_steps_are_those_of_adam_on_the_sum_of_the_terms(sunk, slim, seat_room) -> None:
    # Without collision, whose mean jumps where a vertex comes out.
    phase = Phase(3, (2.0, 0.0, 0.5, 0.0))
    found = refine(sunk, [0], slim, seat_room, (phase,)).vectors
    # Adam's first step is the learning rate against the sign of the gradient (Kingma and Ba 2015).
    one = refine(sunk, [0], slim, seat_room, (Phase(1, phase.weights),)).vectors
    assert float((one - sunk).abs().max()) == pytest.approx(LEARNING_RATE, rel=1e-3)
    step = torch.zeros_like(sunk)
    step[5, 2] = 2e-3
    values = []
    for sign in (1, -1):
        terms = refine(sunk + sign * step, [0], slim, seat_room, ()).terms
        values.append(2 * terms["contact"] + 0.5 * terms["motion"])
    assert np.sign(values[1] - values[0]) == np.sign(float((one - sunk)[5, 2]))
    assert float((found - sunk).abs().max()) <= 3 * LEARNING_RATE * 1.01


@pytest.mark.parametrize("broken", [0, 1, 4, 19])
def test_a_loss_that_is_not_finite_ends_it_with_the_last_finite_state(
    sunk, slim, seat_room, monkeypatch, broken
) -> None:
    sound = refine(sunk, [0, 39], slim, seat_room, (Phase(max(broken - 1, 0), PHASES[0].weights),))
    calls = iter(range(1000))
    contact = refinement.contact
    monkeypatch.setattr(
        refinement, "contact", lambda d: contact(d) * (float("nan") if next(calls) == broken else 1)
    )
    found = refine(sunk, [0, 39], slim, seat_room)
    assert found.stopped == f"not finite at iteration {broken}: last finite state taken"
    assert torch.equal(found.vectors, sound.vectors)
    assert all(np.isfinite(value) for value in found.terms.values())


def test_subgoal_bodies_are_held_while_others_are_free(sunk, slim, seat_room) -> None:
    phase = (Phase(40, (0.0, 1.0, 0.0, 0.0)), Phase(40, (0.0, 0.0, 1.0, 0.0)))
    found = refine(sunk, [0, 39], slim, seat_room, phase[1:]).vectors
    moved = (found - sunk)[:, :3].norm(dim=-1)
    assert float(moved[[0, 39]].max()) < float(moved[[1, 38]].max())


def test_the_same_input_gives_the_same_bits(sunk, slim, seat_room) -> None:
    first, second = (refine(sunk, [0], slim, seat_room, PHASES[:1]) for _ in range(2))
    assert torch.equal(first.vectors, second.vectors) and first.trace == second.trace

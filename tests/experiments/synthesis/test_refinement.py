from __future__ import annotations

import numpy as np
import pytest
import torch
from torch.autograd import gradcheck

from experiments.synthesis import refinement
from experiments.synthesis.body_vector import to_vectors
from experiments.synthesis.refinement import (
    LEARNING_RATE,
    PHASES,
    POSE_SPREAD,
    Phase,
    collision,
    motion,
    refine,
)


@pytest.fixture(scope="module")
def sunk(walk) -> torch.Tensor:
    """A walk through the seat room, 5 cm too low."""
    vectors = torch.tensor(to_vectors(walk(1.5, 40))).float()
    return vectors + torch.tensor([0.6, 2.4, -0.05] + [0.0] * 132)


@pytest.fixture
def refined(sunk, slim, seat_room):
    """refined(phases, vectors): the sunk walk, or other vectors, tied to its own ends."""

    def run(phases=PHASES, vectors=sunk):
        return refine(vectors, sunk[[0, -1]], slim, seat_room, phases)

    return run


def draws(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.tensor(np.random.default_rng(seed).normal(size=shape), requires_grad=True)


def test_the_schedule_is_the_published_one() -> None:
    first, second = PHASES
    assert LEARNING_RATE == 0.02
    assert (first.iterations, first.weights) == (20, (2.0, 2.0, 0.5, 0.0))
    assert (second.iterations, second.weights) == (50, (1.0, 1.0, 0.5, 1.0))


def test_collision_averages_the_mean_depth_of_each_frame() -> None:
    distance = torch.tensor([[-0.1, -0.3, 1.0], [1.0, 1.0, 1.0], [2.0, -0.5, 0.0]])
    assert float(collision(distance)) == pytest.approx((0.2 + 0.0 + 0.5) / 3)
    assert gradcheck(collision, (draws(4, 6),))


def test_motion_sums_squared_steps_and_the_steps_to_the_ends() -> None:
    body = torch.zeros(5, 4, 3)
    body[..., 0] = 0.3 * torch.arange(5)[:, None]
    soles = body[:, :1], body[:, 1:2]
    ends = body[[0, 4]]
    tied = motion(body, soles, ends, (ends[:, :1], ends[:, 1:2]))
    # Three parts, four steps, one of three coordinates.
    assert float(tied) == pytest.approx(3 * 4 * 0.3**2 / 3)
    away = ends + torch.tensor([0.0, 0.6, 0.0])
    loose = motion(body, soles, away, (away[:, :1], ends[:, 1:2]))
    # The right sole has not moved, so only the body counts at the ends.
    assert float(loose - tied) == pytest.approx(2 * 0.6**2 / 3)


def test_the_gradient_of_motion_is_right() -> None:
    parts = [draws(4, 5, 3), draws(4, 2, 3), draws(4, 3, 3), draws(2, 5, 3), draws(2, 2, 3)]
    last = draws(2, 3, 3, seed=1)
    assert gradcheck(lambda b, s, t, e, f, g: motion(b, (s, t), e, (f, g)), (*parts, last))


def test_refinement_lifts_a_sunk_body_out_of_the_floor(refined, sunk) -> None:
    before, after = refined(()), refined()
    assert after.stopped == "done" and after.iterations == 70 and len(after.trace) == 70
    assert after.terms["collision"] < 0.5 * before.terms["collision"]
    assert torch.equal(before.vectors, sunk)


def test_both_phases_end_below_their_start(refined) -> None:
    trace = refined().trace
    assert min(trace[15:20]) < trace[0] and min(trace[60:]) < trace[20]


def test_the_first_step_is_adams_and_shorter_for_poses(refined, sunk) -> None:
    # Adam's first step is the learning rate against the sign of the gradient (Kingma and Ba 2015).
    weights = (2.0, 0.0, 0.5, 0.0)  # without collision, whose mean jumps where a vertex comes out
    step = refined((Phase(1, weights),)).vectors - sunk
    assert float(step[:, :9].abs().max()) == pytest.approx(LEARNING_RATE, rel=1e-3)
    assert float(step[:, 9:].abs().max()) == pytest.approx(LEARNING_RATE * POSE_SPREAD, rel=1e-3)
    values = []
    for sign in (1, -1):
        nudged = sunk.clone()
        nudged[5, 2] += sign * 2e-3
        terms = refined((), nudged).terms
        values.append(2 * terms["contact"] + 0.5 * terms["motion"])
    assert np.sign(values[1] - values[0]) == np.sign(float(step[5, 2]))


@pytest.mark.parametrize("broken", [0, 1, 4, 19])
def test_a_loss_that_is_not_finite_ends_it_with_the_last_finite_state(
    refined, monkeypatch, broken
) -> None:
    sound = refined((Phase(max(broken - 1, 0), PHASES[0].weights),))
    calls = iter(range(1000))
    contact = refinement.contact
    monkeypatch.setattr(
        refinement, "contact", lambda d: contact(d) * (float("nan") if next(calls) == broken else 1)
    )
    found = refined()
    assert found.stopped == f"not finite at iteration {broken}: last finite state taken"
    assert torch.allclose(found.vectors, sound.vectors, atol=1e-6)
    assert all(np.isfinite(value) for value in found.terms.values())


def test_the_ends_draw_the_sequence_towards_them(refined, sunk, slim, seat_room) -> None:
    phase = (Phase(30, (0.0, 0.0, 1.0, 0.0)),)
    ahead = sunk[[0, -1]] + torch.tensor([0.3, 0.0, 0.0] + [0.0] * 132)
    shift = refine(sunk, ahead, slim, seat_room, phase).vectors - refined(phase).vectors
    assert float(shift[[0, -1], 0].min()) > 0.02
    assert float(shift[15:25, 0].abs().max()) < float(shift[[0, -1], 0].min())


def test_the_same_input_gives_the_same_bits(refined) -> None:
    first, second = refined(PHASES[:1]), refined(PHASES[:1])
    assert torch.equal(first.vectors, second.vectors) and first.trace == second.trace

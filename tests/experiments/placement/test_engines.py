"""The batched engine equals the reference engine, whatever the body, the room and the placement."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.body.embedded import BODY_NAMES, load_body
from experiments.interaction.features import InteractionFeatures
from experiments.interaction.mesh import feature_vertices
from experiments.motion.motion import Motion
from experiments.placement.candidates import Starts, exact_scores, find_starts
from experiments.placement.engines import ENGINES
from experiments.placement.problem import build_problem
from experiments.placement.settings import PlacementSettings
from experiments.placement.solver import fit_altered, fit_rigid
from experiments.scene.synthetic import synthetic_room
from experiments.weighting.weights import FrameWeights


def random_problem(seed: int, body_name: str):
    """Random poses of an adult with random contacts and weights in a room of random boxes."""
    rng, body = np.random.default_rng(seed), load_body(body_name)
    n_frames = int(rng.integers(1, 5))
    pose = 0.4 * rng.normal(size=(n_frames, 22, 3))
    pose[:, 0] += [np.pi / 2, 0, 0]
    transl = np.column_stack([rng.uniform(0, 1, (n_frames, 2)), rng.uniform(0.6, 1.1, n_frames)])
    times = np.cumsum(rng.uniform(0.02, 0.1, n_frames))
    motion = Motion(pose, transl, times, 30.0, "random", "random", "test")
    ids = feature_vertices(body)
    share = rng.uniform(0, 0.4)
    contact = rng.uniform(size=(n_frames, len(ids))) * 0.5 / (1 - share)
    features = InteractionFeatures(contact, rng.uniform(size=(*contact.shape, 42)), ids, "random")
    k = rng.uniform(0.05, 3.0, n_frames)
    weights = FrameWeights(k / k.mean(), "random")
    changes = {
        "contact_tolerance": [None, 0.003, 0.02][rng.integers(3)],
        "semantic_weight": float(rng.uniform(0, 1)),
        "penetration_weight": float(rng.uniform(0.1, 20)),
    }
    settings = PlacementSettings(**changes)
    room = random_room(rng)
    return build_problem(motion, room, body, settings, features, weights, torch.float64), rng


def random_room(rng: np.random.Generator):
    boxes = {}
    for index in range(int(rng.integers(0, 5))):
        low = np.append(rng.uniform(0, 2.2, 2), 0.0)
        high = low + rng.uniform(0.05, 0.8, 3)
        name = ("chair", "table", "sofa", "cabinet")[rng.integers(4)]
        boxes[f"box{index}"] = (tuple(low), tuple(high), name)
    return synthetic_room(boxes, cell=0.1)


def terms_and_gradient(problem, engine, state, huber):
    """E_p by terms and its gradient in placement, pose and translation."""
    leaves = [part.clone().requires_grad_(True) for part in state]
    terms = engine.terms(problem, engine.bodies(problem, *leaves), huber, True)
    sum(terms.values()).backward()
    return {name: float(value.detach()) for name, value in terms.items()}, [
        leaf.grad for leaf in leaves
    ]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(BODY_NAMES), st.sampled_from([0.0, 0.003, 0.01]))
def test_both_engines_agree_on_terms_and_gradients(seed, body_name, huber) -> None:
    problem, rng = random_problem(seed, body_name)
    placed = torch.tensor([rng.uniform(-4, 4), *rng.uniform(-1.5, 3.5, 2), rng.normal(0, 0.1)])
    delta = torch.as_tensor(0.1 * rng.normal(size=problem.pose.shape))
    shift = torch.as_tensor(0.05 * rng.normal(size=problem.transl.shape))
    state = (placed.double(), delta, shift)
    slow, slow_slope = terms_and_gradient(problem, ENGINES["reference"], state, huber)
    fast, fast_slope = terms_and_gradient(problem, ENGINES["batched"], state, huber)
    assert fast == pytest.approx(slow, rel=1e-5, abs=1e-12)
    for one, other in zip(slow_slope, fast_slope, strict=True):
        torch.testing.assert_close(other, one, rtol=1e-5, atol=1e-8)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(BODY_NAMES))
def test_both_engines_score_every_start_alike(seed, body_name) -> None:
    problem, rng = random_problem(seed, body_name)
    translation = np.column_stack([rng.uniform(-1, 3, (5, 2)), rng.normal(0, 0.1, 5)])
    starts = Starts(rng.uniform(-4, 4, 5), translation, np.zeros(5))
    slow = exact_scores(by_reference(problem), starts)
    assert exact_scores(problem, starts) == pytest.approx(slow, rel=1e-5, abs=1e-12)


def by_reference(problem):
    return dataclasses.replace(
        problem, settings=dataclasses.replace(problem.settings, engine="reference")
    )


def test_a_whole_optimisation_ends_in_the_same_place_with_either_engine(make_problem) -> None:
    changes = {"yaw_step_deg": 90.0, "grid_step": 0.6, "outer_steps": 2, "inner_iterations": 5}
    problem = make_problem(4, torch.float64, n_starts=1, keep_share=1.0, **changes)
    ends = []
    for item in (problem, by_reference(problem)):
        start = find_starts(item)
        rigid = fit_rigid(item, float(start.yaw[0]), start.translation[0])
        ends.append(fit_altered(item, rigid))
    fast, slow = ends
    assert fast.terms == pytest.approx(slow.terms, rel=1e-5)
    assert (fast.yaw, *fast.translation) == pytest.approx((slow.yaw, *slow.translation), abs=1e-6)
    assert torch.allclose(fast.delta, slow.delta, atol=1e-6)

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.placement.objectives import alteration_terms, total
from experiments.placement.settings import PlacementSettings
from experiments.placement.whitening import alteration_basis, quadratic_form

ONES = np.ones(61)


def energy(delta: np.ndarray, k: np.ndarray, weights: PlacementSettings) -> float:
    """E_alt of one pose coordinate that follows `delta`."""
    full = np.zeros((len(delta), 22, 3))
    full[:, 5, 1] = delta
    scale = torch.ones(len(delta), dtype=torch.float64)
    terms = alteration_terms(
        torch.as_tensor(full),
        torch.zeros(len(delta), 3).double(),
        torch.as_tensor(k),
        scale,
        weights,
    )
    return float(total(terms))


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_the_quadratic_form_is_the_alteration_energy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    delta, k = rng.normal(size=12), rng.uniform(0.1, 2, 12)
    form = quadratic_form(k, np.ones(12), 0.1, 10.0)
    assert delta @ form @ delta == pytest.approx(energy(delta, k, PlacementSettings()))


def test_whitened_pose_variables_cost_half_their_squared_length() -> None:
    rng = np.random.default_rng(1)
    k, weights = rng.uniform(0.5, 1.5, 40), PlacementSettings()
    u = rng.normal(size=40)
    delta = alteration_basis(k, np.ones(40), weights).pose @ u
    # The small floor on the diagonal takes its share of |u|²/2.
    floor = 1e-3 * float(delta @ delta) / 2
    assert energy(delta, k, weights) + floor == pytest.approx(float(u @ u) / 2)


@pytest.mark.parametrize("name", ["whitened", "raw", "dct"])
def test_every_basis_pins_the_shift_of_frame_zero(name: str) -> None:
    weights = PlacementSettings(parameterisation=name)
    basis = alteration_basis(ONES, ONES, weights)
    assert np.abs(basis.translation[0]).max() < 1e-12
    assert np.linalg.matrix_rank(basis.translation) == basis.translation.shape[1]


def test_whitened_and_raw_variables_span_the_same_alterations() -> None:
    k = np.random.default_rng(2).uniform(0.2, 2, 25)
    basis = alteration_basis(k, np.ones(25), PlacementSettings())
    wanted = np.random.default_rng(3).normal(size=25)
    u = np.linalg.solve(basis.pose, wanted)
    assert basis.pose @ u == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("name", ["whitened", "raw", "dct"])
def test_the_same_alteration_costs_the_same_in_every_basis(name: str) -> None:
    rng = np.random.default_rng(4)
    k, weights = rng.uniform(0.2, 2, 40), PlacementSettings(dct_per_frame=0.25)
    smooth = alteration_basis(k, np.ones(40), replace(weights, parameterisation="dct")).pose
    change = smooth @ rng.normal(size=smooth.shape[1])
    basis = alteration_basis(k, np.ones(40), replace(weights, parameterisation=name)).pose
    u = np.linalg.lstsq(basis, change, rcond=None)[0]
    assert energy(basis @ u, k, weights) == pytest.approx(energy(change, k, weights), rel=1e-9)


def test_the_smooth_basis_holds_no_frequency_above_its_limit() -> None:
    weights = PlacementSettings(parameterisation="dct", dct_per_frame=0.1)
    basis = alteration_basis(ONES, ONES, weights)
    spectrum = np.abs(np.fft.rfft(np.concatenate([basis.pose, basis.pose[::-1]]), axis=0))
    assert basis.pose.shape == (61, 6)
    assert spectrum[7:].max() < 1e-9 * spectrum.max()


@pytest.mark.parametrize("ratio", [1.0, 6.25, 100.0, 225.0])
def test_spreading_an_offset_is_cheaper_than_a_jump_as_the_closed_form_says(ratio: float) -> None:
    # Least E_alt with delta forced to d at one frame, a long way from both ends:
    # d² sqrt(p² + 4 p m), reached by d exp(-|i| / tau), tau = 1 / arccosh(1 + p / (2 m)).
    pose, motion, size = 0.1, 0.1 * ratio, 0.3
    weights = PlacementSettings(lambda_pose=pose, lambda_mot=motion)
    tau = 1.0 / math.acosh(1.0 + pose / (2.0 * motion))
    frames = np.arange(-300, 301)
    spread = energy(size * np.exp(-np.abs(frames) / tau), np.ones(601), weights)
    jump = energy(size * (frames == 0), np.ones(601), weights)
    assert spread == pytest.approx(size**2 * math.sqrt(pose**2 + 4 * pose * motion), rel=1e-6)
    assert jump == pytest.approx(size**2 * (pose + 2 * motion))
    form = quadratic_form(np.ones(601), np.ones(601), pose, motion)
    assert spread == pytest.approx(size**2 / np.linalg.inv(form)[300, 300], rel=1e-6)
    assert spread < jump

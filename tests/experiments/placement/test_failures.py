"""What a placement does where energies break, classes are unknown or a device is missing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from experiments.methods import METHODS, rigid
from experiments.placement.devices import require_device
from experiments.placement.errors import OptimisationFailed
from experiments.placement.problem import Problem
from experiments.placement.scene_field import semantics_off
from experiments.placement.settings import PRESETS
from renderer.files import InputError

QUICK = dataclasses.replace(
    PRESETS["fast"], interaction="geometric", outer_steps=1, inner_iterations=3, yaw_step_deg=90.0
)


def with_labels(scene, label: np.ndarray):
    return dataclasses.replace(scene, volumes=dataclasses.replace(scene.volumes, label=label))


def test_an_energy_that_is_never_finite_is_a_recorded_failure(sit, slim, seat_room) -> None:
    broken = dataclasses.replace(QUICK, contact_weight=1e39)  # beyond single precision
    with pytest.raises(OptimisationFailed, match="motion sit in scene synthetic: no start"):
        METHODS["posa_t"].place(sit(20), seat_room, slim, broken, 0)


def test_a_start_that_breaks_is_replaced_by_the_next_and_reported(
    sit, slim, seat_room, monkeypatch
) -> None:
    true_fit, calls = rigid.fit_rigid, []

    def first_one_breaks(problem, yaw, translation):
        calls.append(yaw)
        fit = true_fit(problem, yaw, translation)
        return fit if len(calls) > 1 else dataclasses.replace(fit, reason="diverged")

    monkeypatch.setattr(rigid, "fit_rigid", first_one_breaks)
    placed = METHODS["posa_t"].place(sit(20), seat_room, slim, QUICK, 0)
    assert len(calls) > QUICK.n_starts
    broken = placed.info["broken_starts"]
    assert [item["reason"] for item in broken] == ["diverged"]
    assert placed.info["chosen_start"] != broken[0]["start"]


def test_terms_by_name_are_recorded_for_every_outer_step(sit, slim, seat_room) -> None:
    settings = dataclasses.replace(QUICK, outer_steps=2)
    placed = METHODS["pace"].place(sit(20), seat_room, slim, settings, 0)
    history = placed.info["history"]
    assert 2 <= len(history) <= 3
    assert all(step.keys() == placed.terms.keys() - {"total"} for step in history)
    assert min(sum(step.values()) for step in history) == pytest.approx(placed.terms["total"])


def test_an_unlabelled_room_switches_the_semantic_term_off_and_says_so(
    sit, slim, seat_room
) -> None:
    blank = with_labels(seat_room, np.zeros_like(seat_room.volumes.label))
    placed = METHODS["posa_t"].place(sit(20), blank, slim, QUICK, 0)
    assert placed.info["semantics_off"] == "no object of the scene has a label"
    assert "semantics" not in placed.terms
    labelled = METHODS["posa_t"].place(sit(20), seat_room, slim, QUICK, 0)
    assert labelled.info["semantics_off"] == "" and "semantics" in labelled.terms


def test_only_rooms_without_known_classes_lose_the_semantic_term(seat_room, empty_room) -> None:
    label = seat_room.volumes.label
    assert semantics_off(seat_room) == semantics_off(empty_room) == ""
    shell_only = np.where(label == 3, 41, label).astype(np.uint8)
    assert semantics_off(with_labels(seat_room, shell_only)) != ""
    unknown = np.where(label == 3, 77, label).astype(np.uint8)
    assert "outside mpcat40 (77)" in semantics_off(with_labels(seat_room, unknown))


def test_every_tensor_of_a_problem_lies_on_the_device_asked_for(make_problem) -> None:
    problem: Problem = make_problem(3, device="cpu")
    packed = problem.field.packed
    held = [getattr(problem, item.name) for item in dataclasses.fields(problem)]
    held += [problem.touching, problem.touching_k, packed.solid, packed.label, packed.distances]
    tensors = [item for item in held if isinstance(item, torch.Tensor)]
    assert len(tensors) >= 14
    assert {tensor.device.type for tensor in tensors} == {problem.settings.device}


def test_the_device_decides_nothing_about_the_hash_of_settings() -> None:
    elsewhere = dataclasses.replace(QUICK, device="cuda")
    assert elsewhere.config_hash() == QUICK.config_hash()


def test_a_device_that_is_not_there_is_refused_in_one_line(monkeypatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    require_device("cpu")
    with pytest.raises(InputError, match="--device: got 'cuda', wanted cpu: torch finds no CUDA"):
        require_device("cuda")
    with pytest.raises(InputError, match="wanted one of cpu, cuda"):
        require_device("tpu")

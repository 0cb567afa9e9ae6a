from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from experiments.interaction import contact_training
from experiments.interaction.contact_dataset import ClipRecord, ContactDataset
from experiments.interaction.contact_network import build_network
from experiments.interaction.contact_selection import micro_f1, score_samples
from experiments.interaction.contact_training import (
    PRESETS,
    labelled,
    named,
    network_shape,
    one_cycle,
    performance,
    split_validation,
    train_network,
)
from experiments.interaction.mesh import feature_vertices
from experiments.interaction.network import NetworkShape
from experiments.interaction.training_state import CurveRow, TrainingState, write_curve
from experiments.interaction.weights_file import (
    WeightsNote,
    load_weights,
    save_weights,
    vertex_hash,
)
from renderer.files import InputError, file_sha256

SMALL = named("default", epochs=2, batch=16, width=16, latent=4, seed=7)


@pytest.fixture(scope="module")
def floor_data(slim) -> ContactDataset:
    """240 random bodies: what is low touches the floor, and what is far left a wall."""
    rng = np.random.default_rng(0)
    ids = feature_vertices(slim)
    vertices = rng.normal(0, 0.4, (240, len(ids), 3))
    height = vertices[..., 2] - vertices[..., 2].min(1, keepdims=True)
    to_wall = np.abs(vertices[..., 0].max(1, keepdims=True) - vertices[..., 0])
    distance = np.minimum(np.minimum(height, to_wall), 0.5)
    nearest = np.where(to_wall < height, np.uint8(1), np.uint8(2))
    clips = tuple(
        ClipRecord(
            f"play{index // 3}/{index % 3}",
            "captured" if index < 36 else "authored",
            "test" if index % 12 > 8 else "train",
            "male_slim",
            index,
            "any",
        )
        for index in range(60)
    )
    arrays = [array.astype(np.float16) for array in (vertices, height, distance)]
    clip, frame = np.repeat(np.arange(60), 4), np.tile(np.arange(4), 60)
    return ContactDataset(ids, *arrays, nearest, clip, frame, clips)


@pytest.fixture
def note(floor_data) -> WeightsNote:
    shape = network_shape(floor_data, SMALL)
    hashed = vertex_hash(floor_data.vertex_ids)
    return WeightsNote("default", 0.02, 3e-3, 7, 1, 0, 30, hashed, shape)


def test_classes_of_a_network_are_those_of_its_data_with_void_first(floor_data) -> None:
    assert network_shape(floor_data, SMALL).classes == (0, 1, 2)
    spiral = network_shape(floor_data, PRESETS["spiral"])
    assert spiral.classes == tuple(range(42)) and spiral.latent == 256


def test_labels_count_in_the_classes_of_the_network(floor_data) -> None:
    contact, label = floor_data.labels(0.05)
    bodies = labelled(floor_data, NetworkShape("point", (0, 2), 703), 0.05)
    assert np.array_equal(bodies.label.numpy() == 1, label == 2)
    assert np.array_equal(bodies.label.numpy() == 0, (label == 1) | ~contact)


def test_versions_of_a_performance_stay_on_one_side_of_the_validation_split(floor_data) -> None:
    learn, check = split_validation(floor_data)
    sides = [
        {performance(floor_data.clips[index].name) for index in floor_data.clip[mask]}
        for mask in (learn, check)
    ]
    assert sides[0].isdisjoint(sides[1]) and all(sides)
    assert np.array_equal(learn | check, floor_data.bodies_of(split="train"))


def test_the_learning_rate_rises_to_its_peak_and_ends_near_nothing() -> None:
    rates = np.array([one_cycle(step, 200, 2e-3) for step in range(200)])
    assert rates.argmax() == 20 and rates.max() == pytest.approx(2e-3)
    assert (np.diff(rates[:20]) > 0).all() and (np.diff(rates[20:]) < 0).all()
    assert rates[0] == pytest.approx(2e-3 / 25) and rates[-1] < 2e-6


def test_training_lowers_the_loss_and_writes_a_curve(floor_data, tmp_path) -> None:
    network, curve = train_network(floor_data, named("default", epochs=3, batch=16), tmp_path)
    assert [row.epoch for row in curve] == [1, 2, 3]
    assert curve[-1].training < 0.5 * curve[0].training
    assert curve[-1].validation < curve[0].validation
    write_curve(curve, tmp_path)
    lines = (tmp_path / "curve.csv").read_text().splitlines()
    assert len(lines) == 4 and lines[0].startswith("epoch,steps,training,validation")
    assert (tmp_path / "curve.png").stat().st_size > 10_000
    assert not network.training


def test_a_run_stopped_and_resumed_ends_with_the_very_same_weights(
    floor_data, tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr(contact_training, "SAVE_EVERY", 4)
    whole, curve = train_network(floor_data, SMALL, tmp_path / "whole")

    def stop(step: int, total: int) -> None:
        if step == total // 2 + 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_network(floor_data, SMALL, tmp_path / "halves", progress=stop)
    resumed, again = train_network(floor_data, SMALL, tmp_path / "halves", resume=True)
    for name, value in whole.state_dict().items():
        assert torch.equal(resumed.state_dict()[name], value), name
    assert again == curve


def test_a_checkpoint_of_other_settings_is_refused(floor_data, tmp_path) -> None:
    TrainingState(build_network(network_shape(floor_data, SMALL), 0), SMALL, floor_data).save(
        tmp_path
    )
    other = dataclasses.replace(SMALL, w_kl=0.5)
    with pytest.raises(InputError, match=r"checkpoint\.safetensors: run: got \"another run's\""):
        train_network(floor_data, other, tmp_path, resume=True)
    with pytest.raises(InputError, match=r"checkpoint\.safetensors: file: got 'missing'"):
        train_network(floor_data, SMALL, tmp_path / "nowhere", resume=True)


def test_training_stops_when_validation_no_longer_gets_better(floor_data) -> None:
    network = build_network(network_shape(floor_data, SMALL), 0)
    state = TrainingState(network, SMALL, floor_data)
    for epoch, validation in enumerate((0.5, 0.4, 0.41, 0.40), start=1):
        state.step = 10 * epoch
        state.end_epoch(epoch, CurveRow(validation=validation))
    assert state.best_step == 20
    assert state.is_stale(2) and not state.is_stale(3)


def test_a_diverged_run_says_at_which_step(floor_data) -> None:
    network = build_network(network_shape(floor_data, SMALL), 0)
    state = TrainingState(network, SMALL, floor_data, step=12)
    with pytest.raises(FloatingPointError, match="nan at step 12"):
        state.note_loss(float("nan"))


def test_scores_of_samples_are_bounded_and_repeatable(floor_data) -> None:
    network = build_network(network_shape(floor_data, SMALL), 0).eval()
    rows = np.flatnonzero(floor_data.bodies_of(split="test"))
    one, again = (score_samples(network, floor_data, 0.02, rows, samples=3) for _ in range(2))
    assert one == again
    assert 0 <= one.prior <= one.best <= 1
    assert one.gap == one.posterior - one.prior


def test_f1_counts_found_missed_and_invented_contacts() -> None:
    truth = np.array([[True, True, True, False]])
    found = np.array([[True, False, False, True]])
    assert micro_f1(found, truth) == pytest.approx(2 * 1 / (2 * 1 + 1 + 2))
    assert micro_f1(~truth & ~found & False, ~truth & truth) == 1.0


def test_weights_come_back_as_they_were_saved_in_half_precision(note, tmp_path) -> None:
    network = build_network(note.shape, seed=1)
    target = tmp_path / "model.safetensors"
    save_weights(network, note, target)
    loaded, found = load_weights(target, file_sha256(target))
    assert found == note
    for name, value in network.state_dict().items():
        expected = value.half().to(value.dtype) if value.is_floating_point() else value
        assert torch.equal(loaded.state_dict()[name], expected), name


def test_the_temperature_of_the_classes_survives_the_file_and_flattens_classes_alone(
    note, tmp_path
) -> None:
    target, network = tmp_path / "model.safetensors", build_network(note.shape, seed=1)
    loaded = []
    for temperature in (1.0, 2.5):
        save_weights(network, dataclasses.replace(note, class_temperature=temperature), target)
        loaded.append(load_weights(target)[0])
    size = note.shape.n_vertices
    vertices, height = torch.ones((1, size, 3)), torch.full((1, size), 0.3)
    plain, flat = (
        net.decode(vertices, height, torch.zeros(1, note.shape.latent)) for net in loaded
    )
    assert torch.equal(plain[0], flat[0])
    assert plain[1].any() and torch.allclose(plain[1] / 2.5, flat[1])


def test_damaged_or_foreign_weights_are_refused_by_name(note, tmp_path) -> None:
    target = tmp_path / "model.safetensors"
    save_weights(build_network(note.shape, seed=1), note, target)
    with pytest.raises(InputError, match=r"model\.safetensors: sha256: got .*damaged"):
        load_weights(target, "0" * 64)
    with pytest.raises(InputError, match="file: got 'missing'"):
        load_weights(tmp_path / "absent.safetensors")
    target.write_bytes(b"\x80\x04cos\nsystem\n(S'true'\ntR.")
    with pytest.raises(InputError, match=r"content: .* wanted a readable safetensors file"):
        load_weights(target)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema_version": 2}, "schema_version: got 2, wanted the number 1"),
        ({"shape": {"architecture": "cube"}}, "architecture: got 'cube', wanted one of point"),
        ({"shape": {"width": 10**9}}, "shape: .* wanted whole numbers from 1 to 4096"),
        ({"shape": {"edge_m": 0.0}}, "edge_m: got 0.0, wanted a number of metres from 0 to 1"),
        ({"shape": {"edge_m": 2.0}}, "edge_m: got 2.0, wanted a number of metres"),
        ({"class_temperature": 0.0}, "class_temperature: got 0.0, wanted a number from 0.1 to 100"),
        ({"class_temperature": 1e3}, "class_temperature: got 1000.0, wanted a number"),
        ({"shape": {"classes": [2, 1]}}, "classes: .* wanted indices of mpcat40"),
        ({"seed": None, "what": 1}, "note: .* wanted the note of an interaction model"),
    ],
)
def test_a_note_that_does_not_hold_is_refused(note, tmp_path, change, message) -> None:
    target = tmp_path / "model.safetensors"
    record = json.loads(json.dumps(dataclasses.asdict(note)))
    record["shape"] |= change.get("shape", {})
    record |= {key: value for key, value in change.items() if key != "shape"}
    tensors = build_network(note.shape, seed=1).state_dict()
    save_file({"embedding": tensors["embedding"]}, target, {"note": json.dumps(record)})
    with pytest.raises(InputError, match=message):
        load_weights(target)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.pop("embedding"), "embedding: got 'nothing', wanted a tensor of shape"),
        (lambda t: t.update(embedding=t["embedding"][:9]), r"embedding: got \(9, 16\)"),
        (lambda t: t["embedding"].fill_(torch.nan), "embedding: got 'not a number'"),
        (lambda t: t["parts"].add_(1), "parts: got 'other indices'"),
        (lambda t: t.update(more=t["parts"].clone()), "more: got 'a tensor', wanted none"),
    ],
)
def test_a_wrong_tensor_is_refused_by_its_name(note, tmp_path, change, message) -> None:
    target = tmp_path / "model.safetensors"
    save_weights(build_network(note.shape, seed=1), note, target)
    tensors = load_file(target)
    change(tensors)
    record = json.dumps(dataclasses.asdict(note))
    save_file(tensors, target, {"note": record})
    with pytest.raises(InputError, match=message):
        load_weights(target)

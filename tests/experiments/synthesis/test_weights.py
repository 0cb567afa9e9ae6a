from __future__ import annotations

import dataclasses
import shutil

import pytest
import torch
from safetensors.torch import load_file, save_file

from experiments.synthesis.route_net import RouteNet
from experiments.synthesis.weights import (
    TrainingNote,
    load_nets,
    read_note,
    read_weights,
    weights_file,
    write_weights,
)
from renderer.files import InputError

NOTE = TrainingNote(recipe="7", seed=3, capture_minutes=2.25)


@pytest.fixture
def saved(tmp_path):
    """(network, file) of a route network just written."""
    torch.manual_seed(1)
    net, path = RouteNet(), tmp_path / "synthesis_route.safetensors"
    write_weights(net, "route", NOTE, path)
    return net, path


def rewritten(path, change, **metadata):
    """The file again after `change(values)`, with its own metadata but for the fields given."""
    import json
    import struct

    with path.open("rb") as stream:
        (length,) = struct.unpack("<Q", stream.read(8))
        kept = json.loads(stream.read(length))["__metadata__"]
    values = load_file(path)
    change(values)
    save_file(values, path, {**kept, **metadata})


def test_weights_survive_in_half_precision(saved) -> None:
    net, path = saved
    other = RouteNet()
    digest = read_weights(other, "route", path)
    for name, value in other.state_dict().items():
        assert torch.equal(value, net.state_dict()[name].half().float())
    assert len(digest) == 64 and not other.training
    assert read_note(path) == NOTE


def test_three_files_stay_under_forty_mebibytes(untrained_folder, untrained) -> None:
    size = sum(path.stat().st_size for path in untrained_folder.iterdir())
    assert size < 40 * 2**20
    assert untrained.note.capture_minutes == 1.5 and len(untrained.sha256) == 3


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (lambda v: v.update({"out.bias": v["out.bias"][:-1].clone()}),
         r"out.bias: got 'shape \(539,\)', wanted shape \(540,\)"),
        (lambda v: v.pop("hidden.weight"), "hidden.weight: got 'nothing'"),
        (lambda v: v.update({"extra": v["out.bias"].clone()}), "extra: got .*no tensor of this name"),
        (lambda v: v["out.bias"].add_(1.0), "sha256: .*altered or damaged"),
    ],
)  # fmt: skip
def test_a_tensor_that_does_not_belong_is_refused_by_name(saved, change, wanted) -> None:
    rewritten(saved[1], change)
    with pytest.raises(InputError, match=wanted):
        read_weights(RouteNet(), "route", saved[1])


def test_another_network_or_schema_is_refused_by_name(saved, tmp_path) -> None:
    with pytest.raises(InputError, match="network: got 'synthesis_route', wanted synthesis_pose"):
        read_weights(RouteNet(), "pose", saved[1])
    rewritten(saved[1], lambda values: None, schema_version="9")
    with pytest.raises(InputError, match="schema_version: got '9', wanted 1"):
        read_note(saved[1])


def test_missing_and_damaged_files_are_one_line(tmp_path) -> None:
    broken = tmp_path / "synthesis_route.safetensors"
    with pytest.raises(
        InputError, match=r"route.safetensors: file: got 'missing'.*train synthesis"
    ):
        read_weights(RouteNet(), "route", broken)
    for content in (b"", b"short", b"\xff" * 64, b"\x02\x00\x00\x00\x00\x00\x00\x00[]"):
        broken.write_bytes(content)
        with pytest.raises(InputError, match=r"route.safetensors"):
            read_weights(RouteNet(), "route", broken)


def test_a_file_cut_off_in_its_tensors_is_refused(saved) -> None:
    saved[1].write_bytes(saved[1].read_bytes()[:-100])
    with pytest.raises(InputError, match="content: got"):
        read_weights(RouteNet(), "route", saved[1])


def test_networks_of_two_recipes_are_not_mixed(untrained_folder, tmp_path) -> None:
    shutil.copytree(untrained_folder, tmp_path / "mixed")
    note = dataclasses.replace(NOTE, recipe="other")
    write_weights(RouteNet(), "route", note, weights_file("route", tmp_path / "mixed"))
    with pytest.raises(
        InputError, match="recipe: got 'other', wanted test, as in synthesis_subgoal"
    ):
        load_nets(tmp_path / "mixed")


def test_weights_that_are_not_finite_are_not_written(tmp_path) -> None:
    net, path = RouteNet(), tmp_path / "synthesis_route.safetensors"
    with torch.no_grad():
        net.out.bias[3] = 1e6  # beyond half precision
    with pytest.raises(InputError, match=r"out.bias: got 'not finite in half precision'"):
        write_weights(net, "route", NOTE, path)
    assert not list(tmp_path.iterdir())

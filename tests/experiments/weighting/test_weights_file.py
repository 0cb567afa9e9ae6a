from __future__ import annotations

import json
import struct

import pytest
import torch
from safetensors.torch import save_file

from experiments.weighting.weights_file import load_network, save_network, tensors_sha256
from renderer.files import InputError


def write(path, tensors, **changes) -> None:
    about = {"kind": "frame weights", "schema_version": "1", "sha256": tensors_sha256(tensors)}
    save_file(tensors, path, {**about, **changes})


@pytest.fixture
def tensors(network):
    return {name: value.half().contiguous() for name, value in network.state_dict().items()}


def test_a_network_survives_its_file_to_half_precision(network, some_inputs, tmp_path) -> None:
    save_network(network, tmp_path / "g.safetensors", {"seed": "3"})
    back = load_network(tmp_path / "g.safetensors")
    assert back(some_inputs()).numpy() == pytest.approx(network(some_inputs()).numpy(), abs=5e-3)


def test_a_missing_file_is_one_clear_line(tmp_path) -> None:
    with pytest.raises(InputError, match=r"none\.safetensors.*file: got 'missing'"):
        load_network(tmp_path / "none.safetensors")


def test_something_else_than_safetensors_is_refused(tmp_path) -> None:
    (tmp_path / "g.safetensors").write_bytes(b"\x80\x04 a pickle would begin like this")
    with pytest.raises(InputError, match="content"):
        load_network(tmp_path / "g.safetensors")


@pytest.mark.parametrize(
    ("field", "value"), [("kind", "interaction"), ("schema_version", "0"), ("sha256", "00")]
)
def test_other_metadata_are_refused_by_name(tensors, tmp_path, field: str, value: str) -> None:
    write(tmp_path / "g.safetensors", tensors, **{field: value})
    with pytest.raises(InputError, match=f"{field}: got '{value}'"):
        load_network(tmp_path / "g.safetensors")


def test_a_wrong_shape_a_lack_and_a_surplus_are_refused_by_name(tensors, tmp_path) -> None:
    path = tmp_path / "{}.safetensors"
    wrong = {**tensors, "head.bias": torch.zeros(9).half()}
    lacking = {name: value for name, value in tensors.items() if name != "head.bias"}
    surplus = {**tensors, "tail.bias": torch.zeros(2).half()}
    cases = {"wrong": (wrong, "head.bias: got 'shape \\(9,\\)'"), "lack": (lacking, "head.bias"),
             "more": (surplus, "tail.bias")}  # fmt: skip
    for name, (changed, message) in cases.items():
        target = path.with_stem(name)
        write(target, changed)
        with pytest.raises(InputError, match=message):
            load_network(target)


def test_one_flipped_bit_is_noticed(network, tmp_path) -> None:
    path = tmp_path / "g.safetensors"
    save_network(network, path, {})
    content = bytearray(path.read_bytes())
    (header,) = struct.unpack("<Q", content[:8])
    assert "__metadata__" in json.loads(content[8 : 8 + header])
    content[-3] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match="sha256"):
        load_network(path)

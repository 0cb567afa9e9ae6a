"""The weights of the network g in a file: float16 safetensors, checked by name when read."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from experiments.weighting.network import N_BINS, FrameWeightNetwork
from renderer.files import InputError, atomic_path

WEIGHTS_FILE = Path(__file__).resolve().parents[1] / "assets" / "weights" / "paak.safetensors"
SCHEMA_VERSION = "1"
KIND = "frame weights"


def save_network(network: FrameWeightNetwork, target: Path, about: dict[str, str]) -> None:
    """Write the weights with what `about` says of their making, whole or not at all."""
    tensors = {name: value.half().contiguous() for name, value in network.state_dict().items()}
    metadata = {
        **about,
        "kind": KIND,
        "schema_version": SCHEMA_VERSION,
        "sha256": tensors_sha256(tensors),
    }
    with atomic_path(target) as temporary:
        save_file(tensors, temporary, metadata)


@lru_cache(maxsize=2)
def load_network(source: Path = WEIGHTS_FILE) -> FrameWeightNetwork:
    """The network with the weights of a file, ready to be asked.

    Raises `InputError` naming what is wrong: kind, version, a tensor's name or shape, the hash.
    """
    tensors, metadata = _read(source)
    for field, wanted in (("kind", KIND), ("schema_version", SCHEMA_VERSION)):
        if metadata.get(field) != wanted:
            raise InputError(source, field, metadata.get(field), wanted)
    network = FrameWeightNetwork(torch.zeros(N_BINS))
    for name, own in network.state_dict().items():
        if name not in tensors:
            raise InputError(source, name, "nothing", f"a tensor of shape {tuple(own.shape)}")
        if tensors[name].shape != own.shape:
            shape = f"shape {tuple(own.shape)}"
            raise InputError(source, name, f"shape {tuple(tensors[name].shape)}", shape)
    for name in tensors.keys() - network.state_dict().keys():
        raise InputError(source, name, "a tensor", "no tensor of this name")
    if tensors_sha256(tensors) != metadata.get("sha256"):
        raise InputError(source, "sha256", metadata.get("sha256"), "the hash of the tensors")
    network.load_state_dict({name: value.float() for name, value in tensors.items()})
    return network.eval().requires_grad_(False)


def network_metadata(source: Path = WEIGHTS_FILE) -> dict[str, str]:
    """What a weights file says of its own making."""
    return _read(source)[1]


def tensors_sha256(tensors: dict[str, Tensor]) -> str:
    """Hash over names, shapes and values, in the order of the names."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        digest.update(f"{name} {tuple(tensors[name].shape)} {tensors[name].dtype}".encode())
        digest.update(tensors[name].contiguous().numpy().tobytes())
    return digest.hexdigest()


def _read(source: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    try:
        with safe_open(source, framework="pt") as archive:
            names, metadata = list(archive.keys()), archive.metadata() or {}
            return {name: archive.get_tensor(name) for name in names}, dict(metadata)
    except FileNotFoundError:
        raise InputError(source, "file", "missing", "the weights of the network g") from None
    except (SafetensorError, OSError) as error:
        raise InputError(source, "content", str(error), "a safetensors file") from None

"""Files of trained interaction models: safetensors with a note of what they are; nothing is unpickled."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Integer
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from experiments.interaction.contact_network import ARCHITECTURES, build_network
from experiments.interaction.network import ContactNetwork, NetworkShape
from experiments.scene.scene import N_CLASSES
from renderer.files import InputError, atomic_path, file_sha256, value_sha256

SCHEMA_VERSION = 1
_LARGEST = 4096
"""No latent space or layer of ours is wider: a damaged note must not ask for a huge network."""


@dataclass(frozen=True)
class WeightsNote:
    """What a weights file says about itself."""

    preset: str
    thickness_m: float
    """Label thickness: a vertex nearer to something than this was in contact."""
    w_kl: float
    seed: int
    recipe_version: int
    """Of the training data (`contact_dataset.RECIPE_VERSION`)."""
    data_seed: int
    steps: int
    """Optimiser steps behind these weights."""
    vertex_sha256: str
    """Of the vertex ids that the network was trained on."""
    shape: NetworkShape
    class_temperature: float = 1.0
    """Of `ContactNetwork`; fitted on validation clips."""
    schema_version: int = SCHEMA_VERSION


def vertex_hash(vertex_ids: Integer[np.ndarray, " V"]) -> str:
    """Hash of a list of vertex ids."""
    return value_sha256([int(vertex) for vertex in vertex_ids])


def save_weights(network: ContactNetwork, note: WeightsNote, target: Path) -> None:
    """Write a network's weights in half precision and their note, whole or not at all."""
    tensors = {
        name: (value.half() if value.is_floating_point() else value).contiguous().cpu()
        for name, value in network.state_dict().items()
    }
    with atomic_path(target) as temporary:
        save_file(tensors, temporary, {"note": json.dumps(asdict(note), sort_keys=True)})


def load_weights(source: Path, sha256: str | None = None) -> tuple[ContactNetwork, WeightsNote]:
    """Read what `save_weights` wrote, in single precision, ready for use.

    Raises `InputError` that names what is wrong: file, hash (if one is given), version, note, or a
    tensor's name, shape or values.
    """
    if sha256 is not None and source.is_file() and (found := file_sha256(source)) != sha256:
        raise InputError(source, "sha256", found, f"{sha256} (the file was altered or damaged)")
    metadata, tensors = read_tensors(source)
    note = _note(source, metadata.get("note", ""))
    network = build_network(note.shape, seed=0)
    network.load_state_dict(_checked(source, tensors, network.state_dict()))
    network.class_temperature = note.class_temperature
    return network.eval(), note


def read_tensors(source: Path) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Metadata and tensors of a safetensors file. Raises `InputError` for anything else."""
    if not source.is_file():
        raise InputError(source, "file", "missing", "an existing safetensors file")
    try:
        with safe_open(source, framework="pt") as archive:
            tensors = {name: archive.get_tensor(name) for name in archive.keys()}  # noqa: SIM118
            return archive.metadata() or {}, tensors
    except (SafetensorError, OSError, ValueError) as error:
        raise InputError(source, "content", str(error), "a readable safetensors file") from None


def _note(source: Path, text: str) -> WeightsNote:
    try:
        record: dict[str, Any] = json.loads(text)
        version = record.get("schema_version")
        shape = NetworkShape(**{**record["shape"], "classes": tuple(record["shape"]["classes"])})
        note = WeightsNote(**{**record, "shape": shape})
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        wanted = "the note of an interaction model: " + ", ".join(
            x.name for x in fields(WeightsNote)
        )
        raise InputError(source, "note", str(error), wanted) from None
    if version != SCHEMA_VERSION:
        raise InputError(source, "schema_version", version, f"the number {SCHEMA_VERSION}")
    _check_shape(source, shape)
    temperature = note.class_temperature
    if not isinstance(temperature, float) or not 0.1 <= temperature <= 100.0:
        raise InputError(source, "class_temperature", temperature, "a number from 0.1 to 100")
    return note


def _check_shape(source: Path, shape: NetworkShape) -> None:
    if shape.architecture not in ARCHITECTURES:
        wanted = "one of " + ", ".join(ARCHITECTURES)
        raise InputError(source, "architecture", shape.architecture, wanted)
    sizes = (shape.n_vertices, shape.latent, shape.width)
    if not all(isinstance(size, int) and 0 < size <= _LARGEST for size in sizes):
        raise InputError(source, "shape", sizes, f"whole numbers from 1 to {_LARGEST}")
    if not isinstance(shape.edge_m, float) or not 0 < shape.edge_m < 1:
        raise InputError(source, "edge_m", shape.edge_m, "a number of metres from 0 to 1")
    classes = shape.classes
    if not classes or classes[0] != 0 or list(classes) != sorted({*classes} & {*range(N_CLASSES)}):
        raise InputError(source, "classes", classes, "indices of mpcat40, ascending, 0 the first")


def _checked(
    source: Path, tensors: dict[str, Tensor], wanted: dict[str, Tensor]
) -> dict[str, Tensor]:
    for name, value in wanted.items():
        if name not in tensors:
            raise InputError(source, name, "nothing", f"a tensor of shape {tuple(value.shape)}")
        if tensors[name].shape != value.shape:
            found = tuple(tensors[name].shape)
            raise InputError(source, name, found, f"the shape {tuple(value.shape)}")
        if not torch.isfinite(tensors[name]).all():
            raise InputError(source, name, "not a number", "finite values")
        if not value.is_floating_point() and not torch.equal(tensors[name], value):
            raise InputError(source, name, "other indices", "those of the embedded bodies")
    surplus = sorted(set(tensors) - set(wanted))
    if surplus:
        raise InputError(source, surplus[0], "a tensor", "none of this name")
    return {name: tensors[name].to(value.dtype) for name, value in wanted.items()}

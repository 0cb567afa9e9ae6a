"""Weights of the synthesis networks: safetensors files in half precision, checked before use."""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from experiments.synthesis.pose_net import PoseNet
from experiments.synthesis.route_net import RouteNet
from experiments.synthesis.subgoal_net import SubgoalNet
from renderer.files import InputError, atomic_path

Kind = Literal["subgoal", "route", "pose"]
KINDS: tuple[Kind, ...] = ("subgoal", "route", "pose")
FOLDER = Path(__file__).resolve().parents[1] / "assets" / "weights"
SCHEMA_VERSION = "1"
Net = TypeVar("Net", bound=nn.Module)


@dataclass(frozen=True)
class TrainingNote:
    """What the file says of its training."""

    recipe: str
    """Version of data and training recipe."""
    seed: int
    capture_minutes: float
    """Minutes of real motion capture in the training set, before augmentation; the same in all three."""


@dataclass(frozen=True)
class SynthesisNets:
    """The three networks, ready to be used."""

    subgoal: SubgoalNet
    route: RouteNet
    pose: PoseNet
    note: TrainingNote
    sha256: dict[str, str]
    """Hash of each network's values."""


def load_nets(folder: Path = FOLDER) -> SynthesisNets:
    """The three networks in evaluation mode. Raises `InputError` naming file, field and fault."""
    files = {kind: weights_file(kind, folder) for kind in KINDS}
    notes = {kind: read_note(path) for kind, path in files.items()}
    for kind, note in notes.items():
        if note.recipe != notes["subgoal"].recipe:
            wanted = f"{notes['subgoal'].recipe}, as in {files['subgoal'].name}"
            raise InputError(files[kind], "recipe", note.recipe, wanted)
    subgoal, route, pose = SubgoalNet(), RouteNet(), PoseNet()
    nets: dict[Kind, nn.Module] = {"subgoal": subgoal, "route": route, "pose": pose}
    hashes: dict[str, str] = {}
    for kind, net in nets.items():
        hashes[kind] = read_weights(net, kind, files[kind])
    return SynthesisNets(subgoal, route, pose, notes["subgoal"], hashes)


def weights_file(kind: Kind, folder: Path = FOLDER) -> Path:
    """Where the weights of a network lie."""
    return folder / f"synthesis_{kind}.safetensors"


def write_weights(net: nn.Module, kind: Kind, note: TrainingNote, target: Path) -> None:
    """Write a network in half precision, whole or not at all. Refuses values that are not finite."""
    values = {name: value.detach().cpu().half() for name, value in net.state_dict().items()}
    for name, value in values.items():
        if not bool(torch.isfinite(value).all()):
            raise InputError(target, name, "not finite in half precision", "finite weights")
    metadata = {
        "schema_version": SCHEMA_VERSION,
        "network": f"synthesis_{kind}",
        "recipe": note.recipe,
        "seed": str(note.seed),
        "capture_minutes": repr(float(note.capture_minutes)),
        "sha256": _hash(values),
    }
    with atomic_path(target) as temporary:
        save_file({name: v.contiguous() for name, v in values.items()}, temporary, metadata)


def read_weights(net: nn.Module, kind: Kind, source: Path) -> str:
    """Fill a network from its file, put it in evaluation mode and return the hash of its values.

    Refused, by name: a missing or damaged file, another network, schema or hash, and any tensor that
    is missing, unknown, or of another shape.
    """
    metadata = _metadata(source)
    found = metadata.get("network")
    if found != f"synthesis_{kind}":
        raise InputError(source, "network", found, f"synthesis_{kind}")
    try:
        with safe_open(source, framework="pt") as archive:
            values = {name: archive.get_tensor(name) for name in archive.keys()}  # noqa: SIM118
    except SafetensorError as error:
        raise InputError(source, "content", str(error), "a safetensors file") from None
    _check_shapes(net, values, source)
    digest = _hash(values)
    if digest != metadata.get("sha256"):
        raise InputError(source, "sha256", digest, f"{metadata.get('sha256')} (altered or damaged)")
    net.load_state_dict({name: value.float() for name, value in values.items()})
    net.eval().requires_grad_(False)
    return digest


def read_note(source: Path) -> TrainingNote:
    """What a weights file says of its training; reads its header only."""
    metadata = _metadata(source)
    try:
        return TrainingNote(
            recipe=metadata["recipe"],
            seed=int(metadata["seed"]),
            capture_minutes=float(metadata["capture_minutes"]),
        )
    except (KeyError, ValueError) as error:
        wanted = "recipe, seed and capture_minutes"
        raise InputError(source, "metadata", str(error), wanted) from None


def _metadata(source: Path) -> dict[str, str]:
    """The header's free-text part, read without loading the tensors."""
    try:
        with source.open("rb") as stream:
            (length,) = struct.unpack("<Q", stream.read(8))
            header: Any = json.loads(stream.read(min(length, 1 << 24)))
        metadata = dict(header.get("__metadata__", {}))
    except FileNotFoundError:
        wanted = "the weights of the project (`pace-study train synthesis` makes them)"
        raise InputError(source, "file", "missing", wanted) from None
    except (OSError, ValueError, struct.error, AttributeError) as error:
        raise InputError(source, "content", str(error), "a safetensors file") from None
    version = metadata.get("schema_version")
    if version != SCHEMA_VERSION:
        raise InputError(source, "schema_version", version, SCHEMA_VERSION)
    return metadata


def _check_shapes(net: nn.Module, values: dict[str, Tensor], source: Path) -> None:
    wanted = {name: tuple(value.shape) for name, value in net.state_dict().items()}
    for name in sorted(wanted.keys() | values.keys()):
        if name not in values:
            raise InputError(source, name, "nothing", f"a tensor of shape {wanted[name]}")
        if name not in wanted:
            raise InputError(source, name, tuple(values[name].shape), "no tensor of this name")
        if tuple(values[name].shape) != wanted[name]:
            found = tuple(values[name].shape)
            raise InputError(source, name, f"shape {found}", f"shape {wanted[name]}")


def _hash(values: dict[str, Tensor]) -> str:
    digest = hashlib.sha256()
    for name in sorted(values):
        digest.update(name.encode())
        digest.update(values[name].contiguous().numpy().tobytes())
    return digest.hexdigest()

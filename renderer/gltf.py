"""glTF 2.0 in one binary file: the container, and a skinned, animated body in it.

Source: Khronos Group, glTF 2.0 Specification (2021). Arrays in, bytes out; the root node turns our z up
into glTF's y up, so that any viewer shows the scene upright. Units are metres and seconds.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int16, Integer, Shaped

from renderer.files import InputError

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
Z_UP_TO_Y_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Quaternion (x, y, z, w)."""
_COMPONENT = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


@dataclass(frozen=True)
class SkinnedMesh:
    """A mesh, its skeleton and a motion of it. World frame z up, metres.

    Joints are sorted parents first. The first A of them are animated; the others are rigid children.
    Vertex v of frame t is sum_k w_vk G_k (v - h_k), with G_k the world transform of joint k.
    """

    name: str
    vertices: Float[np.ndarray, "V 3"]
    normals: Float[np.ndarray, "V 3"]
    faces: Integer[np.ndarray, "F 3"]
    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    """Parent of each joint, -1 for the root, which comes first."""
    offsets: Float[np.ndarray, "J 3"]
    """Position of each joint in its parent's frame; that of the root is animated."""
    binds: Float[np.ndarray, "J 3"]
    """h_k, the rest position of each joint."""
    joints: Integer[np.ndarray, "V K"]
    weights: Float[np.ndarray, "V K"]
    """Rows sum to one."""
    rotations: Float[np.ndarray, "T A 4"]
    """Unit quaternions (x, y, z, w) of the animated joints in their parents' frames."""
    root_positions: Float[np.ndarray, "T 3"]
    times: Float[np.ndarray, " T"]
    """Seconds, increasing, from 0."""
    colour: tuple[float, float, float] = (0.36, 0.53, 0.72)
    """sRGB."""
    distances: Int16[np.ndarray, "T V"] | None = None
    """Signed distance to the scene in tenths of a millimetre where it matters, else `UNMARKED`."""


UNMARKED = 32767
"""Value of `distances` for a vertex that neither touches nor penetrates anything."""


def skinned_glb(mesh: SkinnedMesh) -> bytes:
    """A binary glTF file of the animated body.

    The animation turns every animated joint and moves the root, linearly between frames. Contact
    and penetration stand beside it as sparse arrays that `extras.marks` of the mesh names.
    Raises InputError for values that are no numbers.
    """
    _refuse_bad_numbers(mesh)
    glb = Glb()
    joint_count = len(mesh.joint_names)
    skeleton_node, body_node, first_joint = 0, 1, 2
    glb.put(
        "nodes",
        {"name": "z_up", "rotation": Z_UP_TO_Y_UP, "children": [first_joint]},
        {"name": mesh.name, "mesh": 0, "skin": 0},
        *_joint_nodes(mesh, first_joint),
    )
    # A skinned mesh follows its joints alone, so the format wants its node to have no parent.
    glb.put("scenes", {"nodes": [skeleton_node, body_node]})
    glb.put("meshes", _mesh(glb, mesh))
    glb.put("materials", matt_material(None, mesh.colour))
    glb.put(
        "skins",
        {
            "joints": list(range(first_joint, first_joint + joint_count)),
            "skeleton": first_joint,
            "inverseBindMatrices": glb.accessor(_bind_matrices(mesh.binds)),
        },
    )
    glb.put("animations", _animation(glb, mesh, first_joint))
    return glb.to_bytes()


class Glb:
    """A binary glTF file under construction: its tables and its binary chunk."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.tables: dict[str, list[dict[str, Any]]] = {}

    def put(self, table: str, *entries: dict[str, Any]) -> int:
        """Append entries to a table; returns the index of the first."""
        rows = self.tables.setdefault(table, [])
        rows.extend(entries)
        return len(rows) - len(entries)

    def view(self, content: bytes, **more: int) -> int:
        """Append raw bytes, aligned to four; returns the index of the buffer view."""
        self.data += bytes(-len(self.data) % 4)
        place = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content), **more}
        self.data += content
        return self.put("bufferViews", place)

    def accessor(
        self, values: Shaped[np.ndarray, "..."], target: int | None = None, normalized: bool = False
    ) -> int:
        """Append rows of numbers (doubles become float32); returns the accessor's index.

        With a `target` (vertex data or indices) rows are padded to four bytes and bounds are given.
        """
        rows = values.astype("<f4") if values.dtype.kind == "f" else values
        rows = np.ascontiguousarray(rows.reshape(len(rows), -1))
        width, code = rows.shape[1], rows.dtype.str[1:]
        more: dict[str, int] = {} if target is None else {"target": target}
        padding = -rows.itemsize * width % 4 if target == ARRAY_BUFFER else 0
        raw = rows
        if padding:
            raw = np.pad(rows.view(np.uint8).reshape(len(rows), -1), ((0, 0), (0, padding)))
            more["byteStride"] = raw.shape[1]
        entry: dict[str, Any] = {
            "bufferView": self.view(raw.tobytes(), **more),
            "componentType": _COMPONENT[code],
            "type": _KINDS[width],
            "count": len(rows),
        }
        if normalized:
            entry["normalized"] = True
        else:
            entry |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        return self.put("accessors", entry)

    def to_bytes(self) -> bytes:
        """The whole file: header, JSON chunk, binary chunk."""
        data = bytes(self.data) + bytes(-len(self.data) % 4)
        document = {
            "asset": {"version": "2.0", "generator": "pace-study"},
            "scene": 0,
            **{name: rows for name, rows in self.tables.items() if rows},
            "buffers": [{"byteLength": len(data)}],
        }
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        header = (b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
        chunk = struct.pack("<II", len(data), 0x004E4942)
        return struct.pack("<4sIIII", *header) + text + chunk + data


def matt_material(
    texture: int | None, colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> dict[str, Any]:
    """A matt surface of one sRGB colour, times the texture of this index."""
    linear = [*(float(c) for c in to_linear(np.array(colour))), 1.0]
    surface: dict[str, Any] = {
        "metallicFactor": 0.0,
        "roughnessFactor": 0.9,
        "baseColorFactor": linear,
    }
    if texture is not None:
        surface["baseColorTexture"] = {"index": texture}
    return {"pbrMetallicRoughness": surface}


def to_linear(srgb: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """sRGB transfer function (IEC 61966-2-1), inverted."""
    linear: Float[np.ndarray, "*n 3"] = np.where(
        srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4
    )
    return linear


def _refuse_bad_numbers(mesh: SkinnedMesh) -> None:
    for field in ("vertices", "normals", "weights", "rotations", "root_positions", "times"):
        values = getattr(mesh, field)
        if len(values) == 0:
            raise InputError(f"body {mesh.name}", field, "nothing", "at least one row")
        if not np.isfinite(values).all():
            row = int(np.argwhere(~np.isfinite(values))[0][0])
            raise InputError(
                f"body {mesh.name}", f"{field}[{row}]", "not a number", "finite values"
            )


def _joint_nodes(mesh: SkinnedMesh, first: int) -> list[dict[str, Any]]:
    nodes: list[dict[str, Any]] = [
        {"name": name, "translation": offset.tolist()}
        for name, offset in zip(mesh.joint_names, mesh.offsets, strict=True)
    ]
    for joint, parent in enumerate(mesh.parents):
        if parent >= 0:
            nodes[parent].setdefault("children", []).append(first + joint)
    return nodes


def _mesh(glb: Glb, mesh: SkinnedMesh) -> dict[str, Any]:
    attributes = {
        "POSITION": glb.accessor(mesh.vertices, ARRAY_BUFFER),
        "NORMAL": glb.accessor(mesh.normals, ARRAY_BUFFER),
    }
    joints, weights = _influence_sets(mesh)
    for number in range(joints.shape[1] // 4):
        four = slice(4 * number, 4 * number + 4)
        attributes[f"JOINTS_{number}"] = glb.accessor(joints[:, four], ARRAY_BUFFER)
        attributes[f"WEIGHTS_{number}"] = glb.accessor(weights[:, four], ARRAY_BUFFER, True)
    indices = glb.accessor(smallest_indices(mesh.faces.reshape(-1)), ELEMENT_ARRAY_BUFFER)
    entry: dict[str, Any] = {
        "name": mesh.name,
        "primitives": [{"attributes": attributes, "indices": indices, "material": 0}],
    }
    if mesh.distances is not None:
        entry["extras"] = {"marks": _marks(glb, mesh.distances)}
    return entry


def smallest_indices(values: Integer[np.ndarray, " N"]) -> Integer[np.ndarray, " N"]:
    """Indices as 16-bit numbers where they fit (65535 is kept free, as the format demands)."""
    return values.astype(np.uint16 if values.max(initial=0) < 65535 else np.uint32)


def _influence_sets(
    mesh: SkinnedMesh,
) -> tuple[Integer[np.ndarray, "V K"], Integer[np.ndarray, "V K"]]:
    """Joints and 16-bit weights, filled up to whole sets of four; every row sums to 65535."""
    spare = -mesh.weights.shape[1] % 4
    weights = np.pad(mesh.weights, ((0, 0), (0, spare)))
    whole = np.floor(weights * 65535).astype(np.int64)
    # Largest remainders get the units that rounding down left over.
    order = np.argsort(-(weights * 65535 - whole), axis=1, kind="stable")
    rank = np.argsort(order, axis=1, kind="stable")
    whole += rank < (65535 - whole.sum(1))[:, None]
    joints = np.where(whole > 0, np.pad(mesh.joints, ((0, 0), (0, spare))), 0)
    kind = np.uint8 if len(mesh.joint_names) < 256 else np.uint16
    return joints.astype(kind), whole.astype(np.uint16)


def _bind_matrices(binds: Float[np.ndarray, "J 3"]) -> Float[np.ndarray, "J 16"]:
    matrices = np.tile(np.eye(4), (len(binds), 1, 1))
    matrices[:, :3, 3] = -binds
    columns: Float[np.ndarray, "J 16"] = matrices.transpose(0, 2, 1).reshape(-1, 16)
    return columns


def _animation(glb: Glb, mesh: SkinnedMesh, first_joint: int) -> dict[str, Any]:
    times = glb.accessor(mesh.times)
    samplers = [{"input": times, "output": glb.accessor(mesh.root_positions)}]
    targets = [{"node": first_joint, "path": "translation"}]
    for joint in range(mesh.rotations.shape[1]):
        turns = glb.accessor(mesh.rotations[:, joint])
        samplers.append({"input": times, "output": turns})
        targets.append({"node": first_joint + joint, "path": "rotation"})
    channels = [{"sampler": i, "target": target} for i, target in enumerate(targets)]
    return {"name": mesh.name, "samplers": samplers, "channels": channels}


def _marks(glb: Glb, distances: Int16[np.ndarray, "T V"]) -> dict[str, int]:
    """Marked vertices frame after frame: where each frame starts, the vertices, their distances."""
    frame, vertex = np.nonzero(distances != UNMARKED)
    starts = np.searchsorted(frame, np.arange(len(distances) + 1)).astype(np.uint32)
    if len(vertex) == 0:  # an accessor may not be empty; no frame reaches this one
        vertex, values = np.zeros(1, np.int64), np.full(1, UNMARKED, np.int16)
    else:
        values = distances[frame, vertex]
    return {
        "starts": glb.accessor(starts),
        "vertices": glb.accessor(smallest_indices(vertex)),
        "distances": glb.accessor(values),
    }

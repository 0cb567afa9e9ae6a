"""Binary PLY with a class and an instance per vertex."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int32, UInt8

from renderer.files import InputError, write_bytes

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "<i2", "int16": "<i2",
    "ushort": "<u2", "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4",
    "float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8",
}  # fmt: skip
_VERTEX = np.dtype([*((axis, "<f4") for axis in "xyz"), ("label", "u1"), ("instance", "<i4")])
_FACE = np.dtype([("count", "u1"), ("index", "<i4", 3)])


@dataclass(frozen=True)
class LabelledMesh:
    """A triangle mesh with mpcat40 class and instance index per vertex; metres."""

    vertices: Float32[np.ndarray, "V 3"]
    faces: Int32[np.ndarray, "F 3"]
    label: UInt8[np.ndarray, " V"]
    instance: Int32[np.ndarray, " V"]


def write_ply(target: Path, mesh: LabelledMesh) -> None:
    """Write little-endian binary PLY: x, y, z, label, instance; triangles."""
    vertex = np.zeros(len(mesh.vertices), dtype=_VERTEX)
    for column, axis in enumerate("xyz"):
        vertex[axis] = mesh.vertices[:, column]
    vertex["label"], vertex["instance"] = mesh.label, mesh.instance
    face = np.zeros(len(mesh.faces), dtype=_FACE)
    face["count"], face["index"] = 3, mesh.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment metres, z up; label = mpcat40 class",
        f"element vertex {len(vertex)}",
        *(f"property float {axis}" for axis in "xyz"),
        "property uchar label",
        "property int instance",
        f"element face {len(face)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    write_bytes(target, "\n".join(header).encode() + vertex.tobytes() + face.tobytes())


def read_ply(source: Path) -> LabelledMesh:
    """Read such a file; further vertex properties are allowed and dropped.

    Raises InputError for any other format, for missing labels or faces, and for broken content.
    """
    try:
        content = source.read_bytes()
    except OSError as error:
        raise InputError(source, "file", str(error), "a readable PLY file") from None
    start, counts, vertex_type = _header(source, content)
    for column in ("x", "y", "z", "label", "instance"):
        if column not in (vertex_type.names or ()):
            raise InputError(source, column, "missing", f"a vertex property {column}")
    if counts["face"] == 0:
        raise InputError(source, "faces", 0, "at least one triangle")
    middle = start + counts["vertex"] * vertex_type.itemsize
    end = middle + counts["face"] * _FACE.itemsize
    if len(content) != end:
        raise InputError(source, "size", len(content), f"{end} bytes as its header says")
    vertex = np.frombuffer(content[start:middle], dtype=vertex_type)
    face = np.frombuffer(content[middle:end], dtype=_FACE)
    if (face["count"] != 3).any():
        raise InputError(source, "faces", int(face["count"].max()), "triangles only")
    mesh = LabelledMesh(
        vertices=np.stack([vertex[axis] for axis in "xyz"], axis=1).astype(np.float32),
        faces=np.ascontiguousarray(face["index"], dtype=np.int32),
        label=vertex["label"].astype(np.uint8),
        instance=vertex["instance"].astype(np.int32),
    )
    if not np.isfinite(mesh.vertices).all():
        raise InputError(source, "vertices", "not a number", "finite coordinates")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise InputError(source, "faces", int(mesh.faces.max()), "indices of existing vertices")
    return mesh


def _header(source: Path, content: bytes) -> tuple[int, dict[str, int], np.dtype[np.void]]:
    """Length of the header, element counts, and the record type of a vertex."""
    head, mark, _ = content.partition(b"end_header\n")
    lines = head.decode("ascii", errors="replace").split("\n")
    if not mark or lines[0].strip() != "ply":
        raise InputError(source, "content", lines[0][:40], "a PLY header")
    if "format binary_little_endian 1.0" not in lines:
        raise InputError(source, "format", lines[1], "format binary_little_endian 1.0")
    counts, properties, element = {"vertex": 0, "face": 0}, [], ""
    for words in (line.split() for line in lines):
        if words[:1] == ["element"] and len(words) == 3 and words[2].isdigit():
            element, counts[words[1]] = words[1], int(words[2])
        elif words[:1] == ["property"] and element == "vertex":
            if len(words) != 3 or words[1] not in _TYPES:
                raise InputError(source, "property", " ".join(words), "a scalar vertex property")
            properties.append((words[2], _TYPES[words[1]]))
        elif words[:1] == ["property"] and element == "face" and words[1:4] != _FACE_LIST:
            raise InputError(source, "property", " ".join(words), "property list uchar int")
    if set(counts) != {"vertex", "face"}:
        raise InputError(source, "elements", sorted(counts), "vertex and face only")
    return len(head) + len(mark), counts, np.dtype(properties)


_FACE_LIST = ["list", "uchar", "int"]

"""Stage parts as binary glTF 2.0, upright in any viewer, read back without loss of geometry.

Beside the standard attributes every primitive carries `_OCCLUSION` and, per tall object that may be
hidden, `_RELEASED_n`; names, groups and walls stand in the node's `extras`. The root node turns the
rooms' z up into glTF's y up. glTF colours are linear.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from renderer.files import InputError, write_bytes
from renderer.stage import StagePart

_FLOAT, _ARRAY_BUFFER = 5126, 34962
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}
_WIDTHS = {kind: width for width, kind in _KINDS.items()}


def write_glb(target: Path, parts: Sequence[StagePart]) -> None:
    """Write the parts of a room, one node and mesh each."""
    binary = _Binary()
    z_up_to_y_up = {"name": "room", "rotation": [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]}
    nodes: list[dict[str, Any]] = [
        {**z_up_to_y_up, "children": list(range(1, len(parts) + 1))},
        *(
            {"name": part.instance, "mesh": i, "extras": _extras(part)}
            for i, part in enumerate(parts)
        ),
    ]
    materials = [binary.material(part.texture) for part in parts]
    meshes = [
        {"primitives": [{"attributes": _attributes(binary, part), "material": material}]}
        for part, material in zip(parts, materials, strict=True)
    ]
    document = {
        "asset": {"version": "2.0", "generator": "pace-study"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": meshes,
        **binary.tables(),
    }
    text = json.dumps(
        {k: v for k, v in document.items() if v != []}, separators=(",", ":")
    ).encode()
    text += b" " * (-len(text) % 4)
    data = bytes(binary.data) + bytes(-len(binary.data) % 4)
    length = 12 + 8 + len(text) + 8 + len(data)
    write_bytes(
        target,
        struct.pack("<4sIIII", b"glTF", 2, length, len(text), 0x4E4F534A)
        + text
        + struct.pack("<II", len(data), 0x004E4942)
        + data,
    )


def read_glb(source: Path) -> tuple[StagePart, ...]:
    """Read a file that `write_glb` wrote; InputError if it is anything else."""
    try:
        content = source.read_bytes()
        magic, version, length, text_length, kind = struct.unpack_from("<4sIIII", content)
        if (magic, version, length, kind) != (b"glTF", 2, len(content), 0x4E4F534A):
            raise ValueError("not a whole binary glTF 2.0 file")
        document = json.loads(content[20 : 20 + text_length])
        data = content[28 + text_length :]
        return tuple(_part(document, data, node) for node in document["nodes"][1:])
    except OSError as error:
        raise InputError(source, "file", str(error), "a readable glTF file") from None
    except (ValueError, KeyError, IndexError, TypeError, struct.error) as error:
        raise InputError(
            source, "content", str(error), "a glTF file written by this program"
        ) from None


class _Binary:
    """The binary chunk under construction, with the tables that describe it."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._images: dict[bytes, int] = {}
        self._materials: dict[int | None, int] = {}

    def accessor(self, values: Float[np.ndarray, "..."]) -> int:
        """Append float32 rows; returns the accessor's index."""
        rows = np.ascontiguousarray(values, dtype="<f4")
        rows = rows.reshape(-1, rows.shape[-1])
        view = self._view(rows.tobytes(), target=_ARRAY_BUFFER)
        bounds = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        kind = {"componentType": _FLOAT, "type": _KINDS[rows.shape[1]], "count": len(rows)}
        self._accessors.append({"bufferView": view, **kind, **bounds})
        return len(self._accessors) - 1

    def material(self, texture: UInt8[np.ndarray, "h w 3"] | None) -> int:
        """Index of the matt material with this texture (PNG, shared if seen before)."""
        image = None
        if texture is not None:
            stream = io.BytesIO()
            Image.fromarray(texture).save(stream, format="png", compress_level=4)
            image = self._images.setdefault(stream.getvalue(), len(self._images))
        return self._materials.setdefault(image, len(self._materials))

    def tables(self) -> dict[str, Any]:
        """Buffers, views, accessors, images, textures and materials of the document."""
        images = [{"bufferView": self._view(png), "mimeType": "image/png"} for png in self._images]
        return {
            "materials": [_material(image) for image in self._materials],
            "images": images,
            "samplers": [{"wrapS": 10497, "wrapT": 10497}] if images else [],
            "textures": [{"source": i, "sampler": 0} for i in range(len(images))],
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self.data) + (-len(self.data) % 4)}],
        }

    def _view(self, content: bytes, **more: int) -> int:
        self.data += bytes(-len(self.data) % 4)
        place = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)}
        self._views.append({**place, **more})
        self.data += content
        return len(self._views) - 1


def _material(image: int | None) -> dict[str, Any]:
    surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.85}
    if image is not None:
        surface["baseColorTexture"] = {"index": image}
    return {"pbrMetallicRoughness": surface, "doubleSided": False}


def _attributes(binary: _Binary, part: StagePart) -> dict[str, int]:
    attributes = {
        "POSITION": binary.accessor(part.corners),
        "NORMAL": binary.accessor(part.normals),
        "COLOR_0": binary.accessor(_to_linear(part.colours)),
        "_OCCLUSION": binary.accessor(part.occlusion[..., None]),
    }
    if part.uv is not None:
        attributes["TEXCOORD_0"] = binary.accessor(_flipped(part.uv))
    for number, group in enumerate(sorted(part.released)):
        attributes[f"_RELEASED_{number}"] = binary.accessor(part.released[group][..., None])
    return attributes


def _flipped(uv: Float[np.ndarray, "F 3 2"]) -> Float[np.ndarray, "F 3 2"]:
    """Images start at the top in glTF, at the bottom in our texture coordinates; and back."""
    flipped: Float[np.ndarray, "F 3 2"] = (uv * (1, -1) + (0, 1)).astype(np.float32)
    return flipped


def _extras(part: StagePart) -> dict[str, Any]:
    return {"group": part.group, "wall": part.wall, "released": sorted(part.released)}


def _part(document: dict[str, Any], data: bytes, node: dict[str, Any]) -> StagePart:
    primitive = document["meshes"][node["mesh"]]["primitives"][0]
    attributes, extras = primitive["attributes"], node["extras"]

    def read(name: str) -> np.ndarray:
        return _rows(document, data, attributes[name]).reshape(
            -1, 3, _width(document, attributes[name])
        )

    surface = document["materials"][primitive["material"]]["pbrMetallicRoughness"]
    texture = None
    if "baseColorTexture" in surface:
        texture = _image(document, data, surface["baseColorTexture"]["index"])
    uv = _flipped(read("TEXCOORD_0")) if "TEXCOORD_0" in attributes else None
    return StagePart(
        corners=read("POSITION"),
        normals=read("NORMAL"),
        colours=_to_srgb(read("COLOR_0")),
        occlusion=read("_OCCLUSION")[..., 0],
        instance=node["name"],
        group=extras["group"],
        uv=uv,
        texture=texture,
        wall=extras["wall"],
        released={g: read(f"_RELEASED_{i}")[..., 0] for i, g in enumerate(extras["released"])},
    )


def _width(document: dict[str, Any], accessor: int) -> int:
    return _WIDTHS[document["accessors"][accessor]["type"]]


def _rows(document: dict[str, Any], data: bytes, accessor: int) -> np.ndarray:
    about = document["accessors"][accessor]
    return np.frombuffer(_slice(document, data, about["bufferView"]), dtype="<f4").copy()


def _image(document: dict[str, Any], data: bytes, texture: int) -> UInt8[np.ndarray, "h w 3"]:
    image = document["images"][document["textures"][texture]["source"]]
    with Image.open(io.BytesIO(_slice(document, data, image["bufferView"]))) as opened:
        return np.asarray(opened.convert("RGB"))


def _slice(document: dict[str, Any], data: bytes, view: int) -> bytes:
    place = document["bufferViews"][view]
    return data[place["byteOffset"] : place["byteOffset"] + place["byteLength"]]


def _to_linear(srgb: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """sRGB transfer function (IEC 61966-2-1), inverted."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _to_srgb(linear: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)

"""Reader of a Sweet Home 3D furniture library (`.sh3f`: a ZIP of a catalogue, OBJ, MTL, textures).

Used only by `build_furniture.py`. Pieces come out in metres, z up, standing on z = 0 with the
centre of their footprint at the origin and their front towards -y.
"""

from __future__ import annotations

import io
import posixpath
import re
import zipfile
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from renderer.files import InputError

_PROPERTY = re.compile(r"(\w+)#(\d+)=(.*)")


@dataclass(frozen=True)
class SourcePart:
    """The triangles of one material as the library holds them."""

    material: str
    colour: tuple[float, float, float]
    """Diffuse colour of the MTL file, read as sRGB."""
    corners: Float[np.ndarray, "F 3 3"]
    uv: Float[np.ndarray, "F 3 2"] | None
    texture: UInt8[np.ndarray, "h w 3"] | None


@dataclass(frozen=True)
class SourcePiece:
    """One catalogue entry at its catalogue size."""

    number: int
    title: str
    creator: str
    drop_height: float | None
    """Height at which the catalogue puts things on top of the piece, metres; None where unset."""
    parts: tuple[SourcePart, ...]


class Library:
    """An open `.sh3f` file."""

    def __init__(self, path: Path) -> None:
        try:
            self._zip = zipfile.ZipFile(path)
            text = self._zip.read("PluginFurnitureCatalog.properties").decode("latin-1")
        except (OSError, KeyError, zipfile.BadZipFile) as error:
            raise InputError(path, "file", str(error), "a Sweet Home 3D library") from None
        self.path = path
        self._entries: dict[int, dict[str, str]] = {}
        for line in text.splitlines():
            if match := _PROPERTY.match(line):
                self._entries.setdefault(int(match[2]), {})[match[1]] = match[3].strip()

    def piece(self, number: int) -> SourcePiece:
        """Read one piece, turned to z up and scaled to its catalogue size."""
        entry = self._entries.get(number)
        if entry is None:
            raise InputError(self.path, "piece", number, f"1 to {max(self._entries)}")
        model = entry["model"].lstrip("/")
        parts = self._read_obj(model)
        rotation = np.array(entry.get("modelRotation", "1 0 0 0 1 0 0 0 1").split(), float)
        size = np.array([float(entry[key]) / 100.0 for key in ("width", "depth", "height")])
        drop = float(entry.get("dropOnTopElevation", -1.0))
        return SourcePiece(
            number=number,
            title=entry["name"],
            creator=entry["creator"],
            drop_height=drop / 100.0 if drop > 0 else None,
            parts=_stood_up(parts, rotation.reshape(3, 3), size),
        )

    def _read_obj(self, model: str) -> tuple[SourcePart, ...]:
        folder = posixpath.dirname(model)
        obj = _parse_obj(self._zip.read(model).decode("latin-1").splitlines())
        materials: dict[str, _Material] = {}
        for name in obj.libraries:
            text = self._zip.read(posixpath.join(folder, name)).decode("latin-1")
            materials |= _parse_mtl(text.splitlines())
        parts = []
        for name, faces in obj.groups.items():
            material = materials.get(name, _Material())
            corners = np.array([[obj.vertices[v] for v, _ in face] for face in faces], float)
            uv = _corner_uv(obj, faces) if material.texture else None
            texture = self._texture(folder, material.texture) if uv is not None else None
            parts.append(SourcePart(name, material.colour, corners, uv, texture))
        return tuple(parts)

    def _texture(self, folder: str, name: str | None) -> UInt8[np.ndarray, "h w 3"]:
        """A texture's colours; where it is transparent, on white."""
        assert name is not None
        image = Image.open(io.BytesIO(self._zip.read(posixpath.join(folder, name))))
        rgba = image.convert("RGBA")
        flat = Image.new("RGBA", rgba.size, (255, 255, 255, 255))
        return np.asarray(Image.alpha_composite(flat, rgba).convert("RGB"))


@dataclass
class _Material:
    colour: tuple[float, float, float] = (0.7, 0.7, 0.7)
    texture: str | None = None


@dataclass
class _Obj:
    vertices: list[list[float]]
    texcoords: list[list[float]]
    groups: dict[str, list[list[tuple[int, int]]]]
    """Per material: triangles of (vertex, texture coordinate or -1)."""
    libraries: list[str]


def _parse_obj(lines: list[str]) -> _Obj:
    """Vertices, texture coordinates and fan-triangulated faces grouped by material."""
    obj = _Obj([], [], {}, [])
    material = ""
    for line in lines:
        word, _, rest = line.strip().partition(" ")
        if word == "v":
            obj.vertices.append([float(value) for value in rest.split()[:3]])
        elif word == "vt":
            obj.texcoords.append([float(value) for value in rest.split()[:2]])
        elif word == "f":
            corners = [_corner(token, obj) for token in rest.split()]
            triangles = [[corners[0], b, c] for b, c in pairwise(corners[1:])]
            obj.groups.setdefault(material, []).extend(triangles)
        elif word == "usemtl":
            material = rest.strip()
        elif word == "mtllib":
            obj.libraries.append(rest.strip())
    return obj


def _corner(token: str, obj: _Obj) -> tuple[int, int]:
    """`v/vt/vn` with one-based or negative indices; a missing `vt` becomes -1."""
    fields = [*token.split("/"), ""]
    vertex = int(fields[0])
    vertex += len(obj.vertices) if vertex < 0 else -1
    if not fields[1]:
        return vertex, -1
    texcoord = int(fields[1])
    return vertex, texcoord + (len(obj.texcoords) if texcoord < 0 else -1)


def _parse_mtl(lines: list[str]) -> dict[str, _Material]:
    materials: dict[str, _Material] = {}
    current = _Material()
    for line in lines:
        word, _, rest = line.strip().partition(" ")
        if word == "newmtl":
            current = materials.setdefault(rest.strip(), _Material())
        elif word == "Kd":
            red, green, blue = (min(max(float(value), 0.0), 1.0) for value in rest.split()[:3])
            current.colour = (red, green, blue)
        elif word == "map_Kd":
            current.texture = rest.split()[-1]
    return materials


def _corner_uv(obj: _Obj, faces: list[list[tuple[int, int]]]) -> Float[np.ndarray, "F 3 2"] | None:
    """Texture coordinates per corner; None where a face has none (the texture is unusable then)."""
    if any(texcoord < 0 for face in faces for _, texcoord in face):
        return None
    return np.array([[obj.texcoords[t] for _, t in face] for face in faces], float)


def _stood_up(
    parts: tuple[SourcePart, ...],
    rotation: Float[np.ndarray, "3 3"],
    size: Float[np.ndarray, " 3"],
) -> tuple[SourcePart, ...]:
    """Turn y up into z up, front to -y; scale the box to `size` (width, depth, height)."""
    turned = [np.stack([p[..., 0], -p[..., 2], p[..., 1]], -1) for p in _rotated(parts, rotation)]
    every = np.concatenate([corners.reshape(-1, 3) for corners in turned])
    low, high = every.min(0), every.max(0)
    origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    scale = size / np.maximum(high - low, 1e-9)
    return tuple(
        SourcePart(part.material, part.colour, (corners - origin) * scale, part.uv, part.texture)
        for part, corners in zip(parts, turned, strict=True)
    )


def _rotated(
    parts: tuple[SourcePart, ...], rotation: Float[np.ndarray, "3 3"]
) -> list[Float[np.ndarray, "F 3 3"]]:
    return [part.corners @ rotation.T for part in parts]

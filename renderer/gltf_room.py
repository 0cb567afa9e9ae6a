"""A room as compact binary glTF 2.0 for viewing: shared vertices, small numbers, JPEG textures.

Parts of one group (a wall with all that hangs on it, a tall object) are the children of one node, so
that a viewer can hide them together.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Integer, Shaped, UInt8
from PIL import Image

from renderer.gltf import (
    ARRAY_BUFFER,
    ELEMENT_ARRAY_BUFFER,
    Z_UP_TO_Y_UP,
    Glb,
    matt_material,
    smallest_indices,
    to_linear,
)
from renderer.stage import StagePart

JPEG_QUALITY = 90


def room_glb(parts: Sequence[StagePart]) -> bytes:
    """A binary glTF file of the room; `_OCCLUSION` carries the baked occlusion, 1 = open.

    `_RELEASED_n` is how much that grows where the n-th group of the node's `extras.released` is hidden.
    """
    glb = Glb()
    groups = sorted({part.group for part in parts})
    first_part = 1 + len(groups)
    materials: dict[bytes | None, int] = {}
    for part in parts:
        glb.put("meshes", _mesh(glb, part, _material(glb, part.texture, materials)))
    members: dict[str, list[int]] = {group: [] for group in groups}
    for index, part in enumerate(parts):
        members[part.group].append(first_part + index)
    walls = {part.group: part.wall for part in parts}
    glb.put("scenes", {"nodes": [0]})
    glb.put(
        "nodes",
        {"name": "room", "rotation": Z_UP_TO_Y_UP, "children": list(range(1, first_part))},
        *(
            {"name": group, "children": members[group], "extras": {"wall": walls[group]}}
            for group in groups
        ),
        *(
            {"name": part.instance, "mesh": index, "extras": {"released": sorted(part.released)}}
            for index, part in enumerate(parts)
        ),
    )
    return glb.to_bytes()


def _mesh(glb: Glb, part: StagePart, material: int) -> dict[str, Any]:
    count = 3 * len(part.corners)
    columns: dict[str, Shaped[np.ndarray, "N _"]] = {
        "POSITION": part.corners.reshape(count, 3).astype("<f4"),
        "NORMAL": _unit(part.normals.reshape(count, 3)),
        "COLOR_0": _colours(part.colours.reshape(count, 3)),
        "_OCCLUSION": _eighth(part.occlusion),
    }
    for number, group in enumerate(sorted(part.released)):
        columns[f"_RELEASED_{number}"] = _eighth(part.released[group])
    if part.uv is not None:
        # Images start at the top in glTF, at the bottom in our texture coordinates.
        columns["TEXCOORD_0"] = (part.uv.reshape(count, 2) * (1, -1) + (0, 1)).astype("<f4")
    first, index = _shared(list(columns.values()))
    attributes = {
        name: glb.accessor(rows[first], ARRAY_BUFFER, rows.dtype.kind == "u")
        for name, rows in columns.items()
    }
    triangles = index.reshape(-1, 3)
    lines = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    index = triangles[~lines].reshape(-1)
    indices = glb.accessor(smallest_indices(index), ELEMENT_ARRAY_BUFFER)
    return {"primitives": [{"attributes": attributes, "indices": indices, "material": material}]}


def _eighth(share: Float[np.ndarray, "F 3"]) -> UInt8[np.ndarray, "N 1"]:
    """Shares in [0, 1] in eight bits."""
    return np.round(share.reshape(-1, 1).clip(0, 1) * 255).astype(np.uint8)


def _shared(
    columns: list[Shaped[np.ndarray, "N _"]],
) -> tuple[Integer[np.ndarray, " U"], Integer[np.ndarray, " N"]]:
    """Rows that occur (in order of first use), and for every row the one that equals it."""
    raw = np.concatenate(
        [np.ascontiguousarray(c).view(np.uint8).reshape(len(c), -1) for c in columns], axis=1
    )
    keys = np.ascontiguousarray(raw).view(np.dtype((np.void, raw.shape[1]))).reshape(-1)
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.argsort(order)
    return first[order], rank[inverse]


def _unit(normals: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    sound = np.where(length > 1e-6, normals / np.maximum(length, 1e-6), [0.0, 0.0, 1.0])
    # Rounded so that corners that share a smooth normal also share its bytes.
    rounded = np.round(sound, 3)
    unit: Float[np.ndarray, "N 3"] = rounded / np.linalg.norm(rounded, axis=1, keepdims=True)
    return unit.astype("<f4")


def _colours(srgb: Float[np.ndarray, "N 3"]) -> UInt8[np.ndarray, "N 3"]:
    linear: UInt8[np.ndarray, "N 3"] = np.round(
        to_linear(srgb.astype(np.float64).clip(0, 1)) * 255
    ).astype(np.uint8)
    return linear


def _material(
    glb: Glb, texture: UInt8[np.ndarray, "h w 3"] | None, known: dict[bytes | None, int]
) -> int:
    """Index of the matt material with this texture; textures seen before are shared."""
    if texture is None:
        content = None
    else:
        stream = io.BytesIO()
        Image.fromarray(texture).save(stream, format="jpeg", quality=JPEG_QUALITY, subsampling=0)
        content = stream.getvalue()
    if content in known:
        return known[content]
    index = None
    if content is not None:
        image = glb.put("images", {"bufferView": glb.view(content), "mimeType": "image/jpeg"})
        if image == 0:
            glb.put("samplers", {"wrapS": 10497, "wrapT": 10497})
        index = glb.put("textures", {"source": image, "sampler": 0})
    known[content] = glb.put("materials", matt_material(index))
    return known[content]

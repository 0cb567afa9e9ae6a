"""Batches: the room's parts checked and merged for drawing, one batch a texture and group."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from renderer.files import InputError
from renderer.stage import StagePart

_TINY_AREA = 1e-12


@dataclass(frozen=True)
class Batch:
    """Triangles of one group and one texture."""

    group: str
    corners: Float[np.ndarray, "F 3 3"]
    normals: Float[np.ndarray, "F 3 3"]
    colours: Float[np.ndarray, "F 3 3"]
    """Linear RGB."""
    occlusion: Float[np.ndarray, "F 3 4"]
    """Openness per corner for each of up to four sets of hidden groups."""
    uv: Float[np.ndarray, "F 3 2"] | None
    texture: UInt8[np.ndarray, "h w 3"] | None
    texture_slot: int
    """Number of the texture, equal for equal textures; -1 for none."""


def make_batches(
    parts: Sequence[StagePart], hidden_sets: Sequence[Collection[str]] = ((),)
) -> tuple[Batch, ...]:
    """Check and merge the parts, in the order in which they are drawn: by texture, then group.

    `hidden_sets` are the hidden groups of the (at most four) views: what a view hides no longer
    darkens its surroundings there. Triangles without area are left out. Raises `InputError` for
    coordinates that are not finite and for a texture without texture coordinates.
    """
    buckets: dict[tuple[int, str], list[StagePart]] = {}
    textures: dict[tuple[tuple[int, ...], bytes], int] = {}
    for part in sorted(parts, key=lambda part: part.group):
        _require_sound(part)
        slot = -1
        if part.texture is not None:
            content = (part.texture.shape, part.texture.tobytes())
            slot = textures.setdefault(content, len(textures))
        buckets.setdefault((slot, part.group), []).append(part)
    merged = (_merge(*key, buckets[key], hidden_sets) for key in sorted(buckets))
    return tuple(batch for batch in merged if len(batch.corners))


def to_linear(srgb: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Decode sRGB in [0, 1] (IEC 61966-2-1)."""
    clipped = np.clip(srgb, 0.0, 1.0)
    linear: np.ndarray = np.where(
        clipped <= 0.04045, clipped / 12.92, ((clipped + 0.055) / 1.055) ** 2.4
    )
    return linear.astype(srgb.dtype)


def _require_sound(part: StagePart) -> None:
    if not np.isfinite(part.corners).all():
        raise InputError(f"room part {part.instance}", "corners", "not finite", "finite metres")
    if part.texture is not None and part.uv is None:
        raise InputError(
            f"room part {part.instance}", "uv", None, "texture coordinates, as it has a texture"
        )


def _merge(
    slot: int, group: str, members: Sequence[StagePart], hidden_sets: Sequence[Collection[str]]
) -> Batch:
    corners = np.concatenate([part.corners for part in members]).astype(np.float32)
    normals = np.concatenate([part.normals for part in members]).astype(np.float32)
    colours = np.concatenate([part.colours for part in members]).astype(np.float32)
    occlusion = np.concatenate([_occlusion(part, hidden_sets) for part in members])
    uv = None
    if members[0].texture is not None:
        uv = np.concatenate([part.uv for part in members if part.uv is not None])
        uv = np.nan_to_num(uv.astype(np.float32))
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    kept = np.flatnonzero(area > _TINY_AREA)
    corners = corners[kept]
    face_normals = (cross[kept] / area[kept, None])[:, None]
    return Batch(
        group=group,
        corners=corners,
        normals=_usable_normals(normals[kept], face_normals),
        colours=to_linear(np.nan_to_num(colours[kept])),
        occlusion=np.nan_to_num(occlusion[kept], nan=1.0),
        uv=None if uv is None else uv[kept],
        texture=members[0].texture,
        texture_slot=slot,
    )


def _occlusion(
    part: StagePart, hidden_sets: Sequence[Collection[str]]
) -> Float[np.ndarray, "F 3 4"]:
    slots = [part.occlusion_without(hidden) for hidden in hidden_sets]
    slots += slots[-1:] * (4 - len(slots))
    return np.stack(slots, axis=-1).astype(np.float32)


def _usable_normals(
    normals: Float[np.ndarray, "F 3 3"], face_normals: Float[np.ndarray, "F 1 3"]
) -> Float[np.ndarray, "F 3 3"]:
    """Given normals at unit length; where one is missing or not finite, the triangle's own."""
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    sound = np.isfinite(length) & (length > 1e-6)
    safe = np.where(sound, length, 1.0)
    usable: np.ndarray = np.where(sound, normals / safe, face_normals)
    return usable.astype(np.float32)

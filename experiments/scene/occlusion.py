"""Ambient occlusion: how much of the light from all around reaches each corner of the room."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int64

from experiments.cache import cache_path
from experiments.scene.enclosure import ray_scene
from renderer.files import atomic_path

RAYS = 64
FINE = 0.08
"""Metres: meshes whose edges are all shorter are fine."""
REACH = 1.3
"""Metres beyond which a surface no longer takes light away."""
SKY = 0.25
"""Share of the light that grows towards the zenith (the room is open upwards)."""
DARKEST, FULL_AT = 0.40, 0.66
_OFFSET = 0.004
_CHUNK = 6000
_ALGORITHM = "occlusion-1"


@dataclass(frozen=True)
class Surface:
    """Triangles that receive and block light. Room frame, metres."""

    corners: Float[np.ndarray, "F 3 3"]
    normals: Float[np.ndarray, "F 3 3"]
    group: str
    """What disappears together in a view."""


@dataclass(frozen=True)
class Occlusion:
    """Baked factors of one surface."""

    factor: Float32[np.ndarray, "F 3"]
    """Per corner, from `DARKEST` to 1 (open)."""
    released: dict[str, Float32[np.ndarray, "F 3"]]
    """By removable group: what the factor gains where that group is hidden."""


def bake_occlusion(
    surfaces: Sequence[Surface],
    removable: Sequence[str] = (),
    rays: int = RAYS,
    seed: int = 0,
    on_step: Callable[[float], None] = lambda share: None,
) -> list[Occlusion]:
    """Occlusion of every surface by all of them.

    Per distinct corner (place and normal) `rays` cosine-weighted directions are traced, a quarter
    of that on fine meshes, where the noise of single corners is not seen. A hit at distance t lets
    clip(t / reach)^0.7 of the light through, and steeper directions bring more of it. For the
    groups in `removable` (tall furniture that some views hide) the rays that end on them are traced
    once more without them, so that no dark patch needs to stay behind. Cached.
    """
    path = cache_path("occlusion", _key(surfaces, removable, rays, seed), ".npz")
    if not path.exists():
        factor, gain = _bake(surfaces, removable, rays, seed, on_step)
        with atomic_path(path) as partial:
            np.savez(partial, factor=factor, gain=gain.astype(np.float16))
    on_step(1.0)
    with np.load(path, allow_pickle=False) as stored:
        factor, gain = stored["factor"], stored["gain"].astype(np.float32)
    ends = np.cumsum([len(surface.corners) for surface in surfaces])[:-1]
    gains = np.split(gain, ends, axis=1)
    return [
        Occlusion(part, _released(surface, removable, more))
        for surface, part, more in zip(surfaces, np.split(factor, ends), gains, strict=True)
    ]


def _released(
    surface: Surface, removable: Sequence[str], gain: Float32[np.ndarray, "G F 3"]
) -> dict[str, Float32[np.ndarray, "F 3"]]:
    """Only the groups that darken this surface; a group says nothing about itself."""
    return {
        group: part
        for group, part in zip(removable, gain, strict=True)
        if group != surface.group and part.size and part.max() > 0.01
    }


def _bake(
    surfaces: Sequence[Surface],
    removable: Sequence[str],
    rays: int,
    seed: int,
    on_step: Callable[[float], None],
) -> tuple[Float32[np.ndarray, "F 3"], Float32[np.ndarray, "G F 3"]]:
    """Factors of all corners in order, and the gain of each removable group."""
    corners = np.concatenate([surface.corners for surface in surfaces])
    normals = np.concatenate([surface.normals for surface in surfaces])
    group = np.repeat([s.group for s in surfaces], [len(s.corners) for s in surfaces])
    tracer = _Tracer(corners, group, removable)
    rows = np.concatenate([corners, 0.05 * normals], axis=2).reshape(-1, 6)
    _, first, index = np.unique(
        np.round(rows / 5e-4).astype(np.int32), axis=0, return_index=True, return_inverse=True
    )
    place, normal = corners.reshape(-1, 3)[first], normals.reshape(-1, 3)[first]
    coarse = np.bincount(index.ravel(), np.repeat(_longest_edge(corners) > FINE, 3)) > 0
    rng = np.random.default_rng(seed)
    found = np.zeros((1 + len(removable), len(first)))
    done = 0
    for chosen, count in ((np.flatnonzero(coarse), rays), (np.flatnonzero(~coarse), rays // 4)):
        for part in np.split(chosen, range(_CHUNK, len(chosen), _CHUNK)):
            found[:, part] = tracer.openness(place[part], normal[part], count, rng)
            done += len(part) * count
            on_step(done / max(1, rays * coarse.sum() + rays // 4 * (~coarse).sum()))
    openness = found[:, index.ravel()].reshape(-1, len(corners), 3)
    factor = (DARKEST + (1 - DARKEST) * np.clip(openness / FULL_AT, 0, 1)).astype(np.float32)
    return factor[0], factor[1:] - factor[0]


def _longest_edge(corners: Float[np.ndarray, "F 3 3"]) -> Float[np.ndarray, " F"]:
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    longest: Float[np.ndarray, " F"] = edges.max(axis=1)
    return longest


class _Tracer:
    """The room as ray scenes: all of it, and without each removable group."""

    def __init__(
        self, corners: Float[np.ndarray, "F 3 3"], group: np.ndarray, removable: Sequence[str]
    ) -> None:
        self.whole = ray_scene(corners)
        self.without = [ray_scene(corners[group != name]) for name in removable]
        numbers = {name: number for number, name in enumerate(removable)}
        self.group = np.array([numbers.get(str(name), -1) for name in group])

    def openness(
        self,
        place: Float[np.ndarray, "N 3"],
        normal: Float[np.ndarray, "N 3"],
        rays: int,
        rng: np.random.Generator,
    ) -> Float[np.ndarray, "G N"]:
        """Mean light of the directions: first row with everything, then without each group."""
        directions = cosine_directions(normal, rays, rng)
        origins = np.repeat(place + _OFFSET * normal, rays, axis=0).astype(np.float32)
        hit = self.whole.run(origins, directions, query="INTERSECT", output=True)
        light = _light(hit["tfar"], directions)
        struck = np.where(hit["primID"] >= 0, self.group[hit["primID"]], -1)
        means = np.tile(light.reshape(-1, rays).mean(axis=1), (1 + len(self.without), 1))
        for number, scene in enumerate(self.without):
            again = np.flatnonzero(struck == number)
            if len(again):
                t = scene.run(origins[again], directions[again], query="DISTANCE")
                more = _light(t, directions[again]) - light[again]
                means[1 + number] += np.bincount(again // rays, more, len(place)) / rays
        return means


def _light(
    t: Float32[np.ndarray, " N"], directions: Float32[np.ndarray, "N 3"]
) -> Float32[np.ndarray, " N"]:
    """What a ray of that free length brings: falloff with distance, more from above."""
    fall = np.clip(t / np.float32(REACH), 0, 1) ** np.float32(0.7)
    light: Float32[np.ndarray, " N"] = fall * ((1 - SKY) + SKY * directions[:, 2])
    return light.astype(np.float32)


def cosine_directions(
    normal: Float[np.ndarray, "N 3"], rays: int, rng: np.random.Generator
) -> Float32[np.ndarray, "R 3"]:
    """`rays` unit directions a normal, row after row, cosine-weighted.

    One Hammersley set for all, shifted at random per normal: evenly spread within a point, and
    the little noise that stays differs from point to point instead of making bands.
    """
    shift = rng.random((len(normal), 2))
    u = (np.arange(rays) / rays + shift[:, :1]) % 1
    v = (_radical_inverse(rays) + shift[:, 1:]) % 1
    radius, angle = np.sqrt(u), 2 * np.pi * v
    tangent, bitangent = _tangents(normal)
    parts = (radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - u))
    frame = (tangent, bitangent, normal)
    spread = sum(part[..., None] * axis[:, None] for part, axis in zip(parts, frame, strict=True))
    return np.ascontiguousarray(np.reshape(spread, (-1, 3)), dtype=np.float32)


def _radical_inverse(count: int) -> Float[np.ndarray, " count"]:
    """Van der Corput sequence in base 2."""
    number: Int64[np.ndarray, " count"] = np.arange(count)
    value, scale = np.zeros(count), 0.5
    while number.any():
        value += scale * (number & 1)
        number, scale = number >> 1, scale / 2
    return value


def _tangents(
    normal: Float[np.ndarray, "N 3"],
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Two unit vectors that make a right-handed frame with each normal."""
    helper = np.where(np.abs(normal[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    tangent = np.cross(helper, normal)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return tangent, np.cross(normal, tangent)


def _key(surfaces: Sequence[Surface], removable: Sequence[str], rays: int, seed: int) -> str:
    """Hash of all that the result depends on."""
    digest = hashlib.sha256(f"{_ALGORITHM} {rays} {seed} {list(removable)}".encode())
    for surface in surfaces:
        digest.update(f"{surface.group} {len(surface.corners)}".encode())
        for array in (surface.corners, surface.normals):
            digest.update(np.ascontiguousarray(array, dtype=np.float32).tobytes())
    return digest.hexdigest()[:32]

"""Visibility: sample points on the bodies, and what of the room stands between them and a camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Integer
from scipy.spatial import cKDTree

from renderer.framing import room_limits
from renderer.normals import vertex_normals

KEY_FRAMES = 10
PLAIN_SAMPLES, REGION_SAMPLES = 240, 60
REGION_REACH_M = 0.08
"""A region counts with its surroundings: soles face down, it is the foot above that is seen."""
REGION_WEIGHTS = {"sole": 0.30, "foot": 0.30, "pelvis": 0.20, "buttocks": 0.20, "hand": 0.12}
"""Share of the score by the beginning of a region's name; the rest is spread over the body."""
START_M = 0.015
"""Rays start this far off the skin, or touching furniture would hide every contact."""


@dataclass(frozen=True)
class BodySamples:
    """Weighted surface points of several bodies (B) in their key frames (K)."""

    points: Float[np.ndarray, "B K S 3"]
    normals: Float[np.ndarray, "B K S 3"]
    inside: Bool[np.ndarray, "B K S"]
    """Within the room box plus its overhang; what is outside does not count."""
    weights: Float[np.ndarray, " S"]

    def facing(self, eye: Float[np.ndarray, "3"]) -> Bool[np.ndarray, "B K S"]:
        """Points whose surface faces the eye and that count."""
        towards = eye - self.points
        facing: np.ndarray = ((towards * self.normals).sum(-1) > 0.0) & self.inside
        return facing


def sample_bodies(
    bodies: Sequence[Float[np.ndarray, "_ V 3"]],
    faces: Integer[np.ndarray, "G 3"],
    regions: Mapping[str, Integer[np.ndarray, " _"]],
    room_size: tuple[float, float, float],
    floor_z: float,
) -> BodySamples:
    """Evenly strided vertices of the whole body and of its named regions, in 10 key frames."""
    index, weights = _choose_vertices(np.asarray(bodies[0][0], dtype=np.float64), regions)
    low, high = room_limits(room_size, floor_z)
    points, normals = [], []
    for vertices in bodies:
        frames = np.unique(np.linspace(0, len(vertices) - 1, KEY_FRAMES).round().astype(int))
        frames = np.resize(frames, KEY_FRAMES)
        key = np.asarray(vertices[frames], dtype=np.float64)
        points.append(key[:, index])
        normals.append(np.stack([vertex_normals(frame, faces)[index] for frame in key]))
    stacked = np.stack(points)
    inside = np.all((stacked >= low) & (stacked <= high), axis=-1)
    return BodySamples(stacked, np.stack(normals).astype(np.float64), inside, weights)


class Blockers:
    """The room's triangles in a ray tracer, each with the group it belongs to."""

    def __init__(
        self, corners: Float[np.ndarray, "F 3 3"], group_of_face: Integer[np.ndarray, " F"]
    ) -> None:
        # The ray tracer's library is loaded on first use: readers of rigs need none of it.
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh

        self._scene = rtcore_scene.EmbreeScene()
        self._mesh = TriangleMesh(self._scene, np.ascontiguousarray(corners, dtype=np.float32))
        self._group_of_face = group_of_face

    def first_group(
        self,
        points: Float[np.ndarray, "R 3"],
        eye: Float[np.ndarray, "3"],
        hidden: Bool[np.ndarray, " N"],
    ) -> Integer[np.ndarray, " R"]:
        """Group of the first triangle between each point and the eye, hidden groups skipped; -1 = none."""
        towards = eye - points
        distance = np.linalg.norm(towards, axis=1)
        direction = towards / np.maximum(distance, 1e-9)[:, None]
        travelled = np.full(len(points), START_M)
        found = np.full(len(points), -1, dtype=np.int64)
        active = np.arange(len(points))
        while len(active):
            starts = points[active] + direction[active] * travelled[active, None]
            face, reach = self._cast(starts, direction[active])
            travelled[active] += reach
            blocked = (face >= 0) & (travelled[active] < distance[active])
            active, face = active[blocked], face[blocked]
            group = self._group_of_face[face]
            seen = ~hidden[group]
            found[active[seen]] = group[seen]
            active = active[~seen]
            travelled[active] += 1e-4
        return found

    def _cast(
        self, starts: Float[np.ndarray, "R 3"], directions: Float[np.ndarray, "R 3"]
    ) -> tuple[Integer[np.ndarray, " R"], Float[np.ndarray, " R"]]:
        answer = self._scene.run(
            starts.astype(np.float32), directions.astype(np.float32), query="INTERSECT", output=1
        )
        face = np.asarray(answer["primID"], dtype=np.int64)
        reach = np.where(face >= 0, np.asarray(answer["tfar"], dtype=np.float64), 0.0)
        return face, reach


def _choose_vertices(
    rest: Float[np.ndarray, "V 3"], regions: Mapping[str, Integer[np.ndarray, " _"]]
) -> tuple[Integer[np.ndarray, " S"], Float[np.ndarray, " S"]]:
    chosen: dict[float, list[np.ndarray]] = {}
    for name in sorted(regions):
        share = next((w for key, w in REGION_WEIGHTS.items() if key in name.lower()), 0.0)
        if share and len(regions[name]):
            near = cKDTree(rest[regions[name]]).query(rest, distance_upper_bound=REGION_REACH_M)[0]
            chosen.setdefault(share, []).append(_strided(np.flatnonzero(np.isfinite(near))))
    plain = _strided(np.arange(len(rest)), PLAIN_SAMPLES)
    index, weights = [plain], [np.full(len(plain), (1 - sum(chosen)) / len(plain))]
    for share, groups in chosen.items():
        members = np.concatenate(groups)
        index.append(members)
        weights.append(np.full(len(members), share / len(members)))
    return np.concatenate(index), np.concatenate(weights)


def _strided(index: np.ndarray, count: int = REGION_SAMPLES) -> Integer[np.ndarray, " S"]:
    picked: np.ndarray = index[
        np.linspace(0, len(index) - 1, min(count, len(index))).round().astype(int)
    ]
    return picked

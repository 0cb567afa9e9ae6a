"""A small synthetic room and a capsule body, for tests that must not wait for real assets."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from renderer.cameras import CameraRig, choose_cameras
from renderer.settings import RenderSettings
from renderer.stage import Stage, StagePart

ROOM_SIZE = (3.4, 3.0, 2.5)
SMALL = RenderSettings(width=320, height=180)
TINY = RenderSettings(width=96, height=54)

_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def box(low, high) -> np.ndarray:
    ends = np.array([low, high], dtype=np.float64)
    corner = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]]
                       for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # fmt: skip
    return corner[np.array([t for a, b, c, d in _QUADS for t in ((a, b, c), (a, c, d))])]


def grid(origin, u, v, n: int) -> np.ndarray:
    """n x n quads over the parallelogram origin, u, v; front side u x v."""
    origin, u, v = (np.array(x, dtype=np.float64) for x in (origin, u, v))
    steps = np.linspace(0, 1, n + 1)
    p = origin + steps[:, None, None] * u + steps[None, :, None] * v
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3, 3)


def part(corners, colour, group, wall=None, uv=None, texture=None) -> StagePart:
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    return StagePart(
        corners=corners.astype(np.float32),
        normals=np.repeat(normal[:, None], 3, axis=1).astype(np.float32),
        colours=np.broadcast_to(np.float32(colour), corners.shape).copy(),
        occlusion=np.full(corners.shape[:2], 0.9, dtype=np.float32),
        instance=group,
        group=group,
        uv=uv,
        texture=texture,
        wall=wall,
    )


def checks() -> np.ndarray:
    """A 64 px chequer with a fine and a coarse grain."""
    i, j = np.indices((64, 64))
    fine = 30 * ((i // 2 + j // 2) % 2)
    coarse = 90 * ((i // 16 + j // 16) % 2)
    return np.stack([120 + coarse, 90 + coarse // 2 + fine, 70 + fine], axis=-1).astype(np.uint8)


def make_room() -> tuple[StagePart, ...]:
    w, d, h = ROOM_SIZE
    floor = grid((0, 0, 0), (w, 0, 0), (0, d, 0), 8)
    paint = (0.8, 0.78, 0.74)
    return (
        part(floor, (1, 1, 1), "floor", uv=floor[..., :2].astype(np.float32), texture=checks()),
        part(grid((0, d, 0), (w, 0, 0), (0, 0, h), 6)[:, ::1], paint, "wall:n", "n"),
        part(grid((w, 0, 0), (-w, 0, 0), (0, 0, h), 6), paint, "wall:s", "s"),
        part(grid((w, d, 0), (0, -d, 0), (0, 0, h), 6), paint, "wall:e", "e"),
        part(grid((0, 0, 0), (0, d, 0), (0, 0, h), 6), paint, "wall:w", "w"),
        part(box((1.2, 1.3, 0.0), (2.1, 1.9, 0.45)), (0.7, 0.4, 0.3), "room"),
        part(box((2.6, 0.2, 0.0), (3.3, 0.8, 0.78)), (0.5, 0.6, 0.4), "room"),
        part(box((0.1, 2.3, 0.0), (0.9, 2.9, 1.9)), (0.6, 0.55, 0.45), "object:wardrobe"),
        part(box((3.36, 1.0, 1.2), (3.4, 1.6, 1.7)), (0.3, 0.4, 0.7), "wall:e", "e"),
    )


def capsule_body(rings: int = 10, sides: int = 14) -> tuple[np.ndarray, np.ndarray]:
    """Closed lump, 1.5 m high, standing on z = 0: unit sphere grid stretched, with a bulge."""
    theta = np.linspace(0, np.pi, rings + 1)[1:-1]
    phi = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    radius = 0.20 + 0.06 * np.cos(3 * t)
    ring = np.stack([radius * np.sin(t) * np.cos(p), radius * np.sin(t) * np.sin(p),
                     0.75 - 0.75 * np.cos(t)], axis=-1).reshape(-1, 3)  # fmt: skip
    vertices = np.concatenate([ring, [[0, 0, 0]], [[0, 0, 1.5]]])
    faces = []
    n = len(theta)
    for i in range(n - 1):
        for j in range(sides):
            a, b = i * sides + j, i * sides + (j + 1) % sides
            c, e = b + sides, a + sides
            faces += [(a, b, c), (a, c, e)]
    for j in range(sides):
        k = (j + 1) % sides
        faces += [(n * sides, k, j), (n * sides + 1, (n - 1) * sides + j, (n - 1) * sides + k)]
    return vertices.astype(np.float32), np.array(faces, dtype=np.int64)


def walk(n_frames: int = 5, start=(0.7, 0.8), end=(2.6, 1.0)) -> np.ndarray:
    vertices, _ = capsule_body()
    path = np.linspace((*start, 0.0), (*end, 0.0), n_frames).astype(np.float32)
    return vertices[None] + path[:, None]


def make_stage(vertices: np.ndarray | None = None, **changes) -> Stage:
    body, faces = capsule_body()
    regions = {"left_sole": np.flatnonzero(body[:, 2] < 0.05), "pelvis": np.arange(30, 50)}
    values = {
        "parts": make_room(), "room_size": ROOM_SIZE, "faces": faces, "fps": 30.0,
        "vertices": walk() if vertices is None else vertices, "regions": regions,
    }  # fmt: skip
    return Stage(**{**values, **changes})


def make_rig(stage: Stage, settings: RenderSettings = SMALL) -> CameraRig:
    return choose_cameras(
        stage.parts, stage.room_size, stage.floor_z, [stage.vertices], stage.regions, stage.faces,
        settings,
    )  # fmt: skip


@pytest.fixture(scope="session")
def synthetic() -> SimpleNamespace:
    """The builders of this file, for tests that need their own room or body."""
    return SimpleNamespace(
        parts=make_room(), part=part, box=box, grid=grid, capsule_body=capsule_body, walk=walk,
        make_stage=make_stage, make_rig=make_rig, room_size=ROOM_SIZE, small=SMALL, tiny=TINY,
    )  # fmt: skip


@pytest.fixture(scope="session")
def stage() -> Stage:
    return make_stage()


@pytest.fixture(scope="session")
def rig(stage: Stage) -> CameraRig:
    return make_rig(stage)


@pytest.fixture(scope="module", autouse=True)
def free_the_context():
    """Leave no context behind for the tests of other packages."""
    yield
    from renderer import offscreen

    offscreen.release()

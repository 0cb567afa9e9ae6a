"""Cost of the exact fast path against naive and full redraws, in CPU seconds of one process.

Room: synthetic, about 200,000 triangles in 190 boxes and a shell. Body: 13,000 vertices, walking.
Naive: pyrender's public interface as its examples use it: a new Scene, `Mesh.from_trimesh` and
OffscreenRenderer for every image, shadows on (that path has no anti-aliasing under OSMesa).
The last line is one JSON object.
"""

from __future__ import annotations

import json
import os
import resource
import statistics
import sys
import time
from pathlib import Path

os.environ.setdefault("PYOPENGL_PLATFORM", "osmesa")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np

from renderer.cameras import choose_cameras
from renderer.render import open_session
from renderer.settings import RenderSettings
from renderer.stage import Stage, StagePart

ROOM = (6.0, 5.0, 2.6)
FRAMES = 8
WIDTH, HEIGHT = 960, 540


def main() -> None:
    """Measure, print a table and the JSON line."""
    stage = make_stage()
    settings = {samples: RenderSettings(WIDTH, HEIGHT, msaa=samples) for samples in (0, 4)}
    rig = choose_cameras(
        stage.parts, stage.room_size, 0.0, [stage.vertices], {}, stage.faces, settings[4]
    )
    naive = naive_cost(stage, rig.views)
    fast, full, share, differing = {}, {}, 0.0, 0
    for samples, chosen in settings.items():
        with open_session(stage, rig.views, chosen) as session:
            session.frame(stage.vertices[0])
            fast[samples] = per_image(lambda k, s=session: s.frame(stage.vertices[k]), 4)
            full[samples] = per_image(
                lambda k, s=session: [s.full(stage.vertices[k], v) for v in range(4)], 4, 2
            )
            pictures = session.frame(stage.vertices[-1])
            share = float(np.mean([session.dirty_share(v) for v in range(4)]))
            for index, picture in enumerate(pictures):
                other = session.full(stage.vertices[-1], index)
                differing += int((picture != other).any(axis=-1).sum())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    triangles = sum(len(part.corners) for part in stage.parts)
    rows = [
        ("naive, no anti-aliasing", naive), ("full redraw", full[0]), ("fast", fast[0]),
        ("full redraw, 4x MSAA", full[4]), ("fast, 4x MSAA", fast[4]),
    ]  # fmt: skip
    print(
        f"{triangles} triangles, {WIDTH}x{HEIGHT}, shadows, body redraws {share:.1%} of a picture"
    )
    for name, seconds in rows:
        print(f"{name:<26} {1000 * seconds:9.1f} CPU ms an image  {naive / seconds:6.1f}x naive")
    print(json.dumps({
        "naive_ms": round(1000 * naive, 1),
        "fast_ms": round(1000 * fast[0], 1),
        "fast_msaa_ms": round(1000 * fast[4], 1),
        "full_msaa_ms": round(1000 * full[4], 1),
        "fast_vs_naive": round(naive / fast[0], 2),
        "fast_msaa_vs_naive": round(naive / fast[4], 2),
        "fast_msaa_vs_full_msaa": round(full[4] / fast[4], 2),
        "dirty_share": round(share, 4),
        "triangles": triangles,
        "differing_pixels": differing,
        "peak_mib": round(peak),
    }))  # fmt: skip


def per_image(draw, images_a_call: int, calls: int = FRAMES) -> float:
    """Median CPU seconds of one image."""
    costs = []
    for k in range(calls):
        start = time.process_time()
        draw(k % FRAMES)
        costs.append((time.process_time() - start) / images_a_call)
    return statistics.median(costs)


def naive_cost(stage: Stage, views) -> float:
    """CPU seconds of one image when everything is made anew for it."""
    import pyrender
    import trimesh

    shell = [part for part in stage.parts if not part.group.startswith("wall")]
    corners = np.concatenate([part.corners for part in shell])
    colours = np.concatenate([part.colours for part in shell]).reshape(-1, 3)

    def draw(k: int) -> None:
        room = trimesh.Trimesh(
            corners.reshape(-1, 3), np.arange(len(corners) * 3).reshape(-1, 3),
            vertex_colors=(255 * colours).astype(np.uint8), process=False,
        )  # fmt: skip
        body = trimesh.Trimesh(stage.vertices[k], stage.faces, process=False)
        scene = pyrender.Scene(ambient_light=[0.6, 0.6, 0.6])
        scene.add(pyrender.Mesh.from_trimesh(room))
        scene.add(pyrender.Mesh.from_trimesh(body))
        view = views[k % 4]
        scene.add(pyrender.PerspectiveCamera(yfov=view.yfov), pose=view.matrix)
        scene.add(pyrender.DirectionalLight(intensity=2.0), pose=light_pose)
        renderer = pyrender.OffscreenRenderer(WIDTH, HEIGHT)
        renderer.render(scene, flags=pyrender.RenderFlags.SHADOWS_DIRECTIONAL)
        renderer.delete()

    from renderer.light import light_pose as pose_of_key

    light_pose = pose_of_key()
    return per_image(draw, 1, 5)


def make_stage(seed: int = 0) -> Stage:
    """Shell and boxes with finely divided, slightly noisy faces; a lumpy body that walks."""
    rng = np.random.default_rng(seed)
    width, depth, height = ROOM
    parts = [
        part(sheet((0, 0, 0), (width, 0, 0), (0, depth, 0), 60, rng), (0.7, 0.6, 0.5), "floor"),
        part(sheet((0, depth, 0), (width, 0, 0), (0, 0, height), 40, rng), (0.8,) * 3, "wall:n"),
        part(sheet((width, 0, 0), (-width, 0, 0), (0, 0, height), 40, rng), (0.8,) * 3, "wall:s"),
        part(
            sheet((width, depth, 0), (0, -depth, 0), (0, 0, height), 40, rng), (0.8,) * 3, "wall:e"
        ),
        part(sheet((0, 0, 0), (0, depth, 0), (0, 0, height), 40, rng), (0.8,) * 3, "wall:w"),
    ]
    for _ in range(190):
        size = rng.uniform((0.1, 0.1, 0.1), (0.5, 0.5, 0.7))
        low = np.append(rng.uniform((0, 0), (width, depth)) - size[:2] / 2, 0.0)
        low = np.clip(low, 0.02, np.array([width, depth, height]) - size - 0.02)
        low[2] = 0.0
        colour = tuple(rng.uniform(0.3, 0.8, 3))
        parts.append(part(box(low, size, 9, rng), colour, "room"))
    body, faces = lump(96, 136)
    path = np.linspace((1.0, 1.5, 0.0), (4.0, 3.0, 0.0), FRAMES)
    vertices = (body[None] + path[:, None]).astype(np.float32)
    return Stage(tuple(parts), ROOM, vertices, faces, 30.0)


def sheet(origin, u, v, n: int, rng: np.random.Generator) -> np.ndarray:
    """A parallelogram of 2 n^2 triangles with 2 mm of noise inside."""
    origin, u, v = (np.array(x, dtype=np.float64) for x in (origin, u, v))
    steps = np.linspace(0, 1, n + 1)
    points = origin + steps[:, None, None] * u + steps[None, :, None] * v
    points[1:-1, 1:-1] += rng.normal(0, 0.002, points[1:-1, 1:-1].shape)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3, 3)


def box(low, size, n: int, rng: np.random.Generator) -> np.ndarray:
    """Six sheets that face outwards."""
    x, y, z = np.diag(size)
    low = np.asarray(low)
    sides = [
        (low, y, x), (low + z, x, y), (low, x, z), (low + y, z, x), (low, z, y), (low + x, y, z),
    ]  # fmt: skip
    return np.concatenate([sheet(*side, n, rng) for side in sides])


def lump(rings: int, sides: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed body 1.75 m high with about rings x sides vertices."""
    theta, phi = np.meshgrid(
        np.linspace(0.02, np.pi - 0.02, rings), np.linspace(0, 2 * np.pi, sides, endpoint=False),
        indexing="ij",
    )  # fmt: skip
    radius = 0.18 + 0.05 * np.cos(4 * theta) + 0.02 * np.cos(3 * phi)
    points = np.stack([
        radius * np.sin(theta) * np.cos(phi), radius * np.sin(theta) * np.sin(phi),
        0.875 * (1 - np.cos(theta)),
    ], axis=-1).reshape(-1, 3)  # fmt: skip
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    a, b = i * sides + j, i * sides + (j + 1) % sides
    faces = np.stack([a, b, b + sides, a, b + sides, a + sides], axis=-1).reshape(-1, 3)
    return points, faces


def part(corners: np.ndarray, colour, group: str) -> StagePart:
    """A plain part with face normals."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    return StagePart(
        corners=corners.astype(np.float32),
        normals=np.repeat(normal[:, None], 3, axis=1).astype(np.float32),
        colours=np.broadcast_to(np.float32(colour), corners.shape).copy(),
        occlusion=np.ones(corners.shape[:2], np.float32),
        instance=group,
        group=group,
        wall=group.removeprefix("wall:") if group.startswith("wall:") else None,
    )


if __name__ == "__main__":
    main()

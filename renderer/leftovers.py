"""What stays of things that were cut away: a low stub of a wall, a thin frame on the floor.

They tell the rater that the room goes on there, without hiding the body.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from renderer.cutaway import Group, room_groups
from renderer.stage import StagePart

STUB_M = 0.06
FRAME_WIDTH_M, FRAME_HEIGHT_M = 0.03, 0.012
BASE_M = 0.30
"""Furniture whose lowest point is higher than this above the floor leaves no frame."""
STUB_GREY, FRAME_GREY = 0.72, 0.56


def leftover_parts(
    parts: Sequence[StagePart], room_size: tuple[float, float, float], floor_z: float
) -> tuple[StagePart, ...]:
    """A stub for every wall and a frame for every floor-standing object group.

    Their groups are `stub:<wall>` and `frame:<group>`; `shown_groups` says which a view draws.
    """
    made = [_stub(wall, room_size, floor_z) for wall in "nsew"]
    for group in room_groups(parts):
        if group.is_furniture and group.low[2] - floor_z < BASE_M:
            made.append(_frame(group, parts, floor_z))
    return tuple(made)


def shown_groups(parts: Sequence[StagePart], hidden: Sequence[str]) -> set[str]:
    """Groups of `parts` (room and leftovers) that a view with these hidden groups draws."""
    gone = set(hidden)
    walls = {name.removeprefix("wall:") for name in gone if name.startswith("wall:")}
    extra = {f"stub:{wall}" for wall in walls} | {f"frame:{name}" for name in gone}
    return {
        part.group
        for part in parts
        if (part.group in extra)
        or (part.group not in gone and not part.group.startswith(("stub:", "frame:")))
    }


def _stub(wall: str, room_size: tuple[float, float, float], floor_z: float) -> StagePart:
    width, depth, _ = room_size
    low, high = {
        "n": ((-STUB_M, depth), (width + STUB_M, depth + STUB_M)),
        "s": ((-STUB_M, -STUB_M), (width + STUB_M, 0.0)),
        "w": ((-STUB_M, -STUB_M), (0.0, depth + STUB_M)),
        "e": ((width, -STUB_M), (width + STUB_M, depth + STUB_M)),
    }[wall]
    corners = _box((*low, floor_z - STUB_M), (*high, floor_z + STUB_M))
    return _plain_part(corners, f"stub:{wall}", STUB_GREY)


def _frame(group: Group, parts: Sequence[StagePart], floor_z: float) -> StagePart:
    """Four thin strips around the smallest rectangle that holds the footprint."""
    points = np.concatenate([
        part.corners.reshape(-1, 3) for part in parts if part.group == group.name
    ])  # fmt: skip
    base = points[points[:, 2] < floor_z + BASE_M][:, :2].astype(np.float64)
    centre, axes, half = _least_rectangle(base)
    half = np.maximum(half, FRAME_WIDTH_M)
    strips = []
    w = FRAME_WIDTH_M
    for low, high in (
        ((-half[0], -half[1]), (half[0], -half[1] + w)),
        ((-half[0], half[1] - w), (half[0], half[1])),
        ((-half[0], -half[1] + w), (-half[0] + w, half[1] - w)),
        ((half[0] - w, -half[1] + w), (half[0], half[1] - w)),
    ):
        strip = _box((*low, floor_z + 0.002), (*high, floor_z + FRAME_HEIGHT_M))
        strip[..., :2] = strip[..., :2] @ axes + centre
        strips.append(strip)
    return _plain_part(np.concatenate(strips), f"frame:{group.name}", FRAME_GREY)


def _least_rectangle(
    points: Float[np.ndarray, "P 2"],
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2 2"], Float[np.ndarray, "2"]]:
    """Centre, axes (rows, right-handed) and half sizes of the smallest enclosing rectangle.

    One side of the smallest rectangle lies on a side of the convex hull.
    """
    try:
        hull = points[ConvexHull(points).vertices]
    except QhullError:
        hull = points
    sides = np.roll(hull, -1, axis=0) - hull
    best: tuple[float, np.ndarray, np.ndarray, np.ndarray] | None = None
    for side in np.concatenate([[[1.0, 0.0]], sides]):
        length = float(np.linalg.norm(side))
        if length < 1e-6:
            continue
        along = side / length
        axes = np.array([along, [-along[1], along[0]]])
        seen = hull @ axes.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        area = float(np.prod(high - low))
        if best is None or area < best[0] - 1e-6:
            best = (area, 0.5 * (low + high) @ axes, axes, 0.5 * (high - low))
    assert best is not None
    return best[1], best[2], best[3]


def _box(low: Sequence[float], high: Sequence[float]) -> Float[np.ndarray, "12 3 3"]:
    """The 12 outward triangles of an axis-aligned box."""
    ends = np.array([low, high], dtype=np.float64)
    corner = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]]
                       for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # fmt: skip
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    box: np.ndarray = corner[np.array(triangles)]
    return box


def _plain_part(corners: Float[np.ndarray, "F 3 3"], group: str, grey: float) -> StagePart:
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    return StagePart(
        corners=corners.astype(np.float32),
        normals=np.repeat(normal[:, None], 3, axis=1).astype(np.float32),
        colours=np.full(corners.shape, grey, dtype=np.float32),
        occlusion=np.full(corners.shape[:2], 1.0, dtype=np.float32),
        instance=group,
        group=group,
    )

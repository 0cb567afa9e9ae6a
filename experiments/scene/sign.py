"""Which nodes are inside an object: the vote of rays, corrected by where air can flow."""

from __future__ import annotations

import numpy as np
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Bool, Float, Float32, Int64
from scipy.ndimage import label

from experiments.scene.enclosure import enclosed, occluded, ray_scene

CLEARANCE = 0.03
"""Metres: air flows through openings wider than twice this; narrower seams are taken as closed."""
SIDES = ("-x", "+x", "-y", "+y")
"""Sides on which an object may be closed by a wall that it stands against."""
_STEPS = np.concatenate([np.eye(3, dtype=np.int64), -np.eye(3, dtype=np.int64)])


def inside_nodes(
    corners: Float[np.ndarray, "F 3 3"],
    distance: Float32[np.ndarray, "x y z"],
    low: Int64[np.ndarray, "3"],
    cell: float,
    closed: frozenset[str] = frozenset(),
) -> Bool[np.ndarray, "x y z"]:
    """Nodes of a window that are inside one object. Metres from grid node 0.

    Air flows in from the open sides of the window and from above, sideways and downwards but never
    upwards, where it keeps `CLEARANCE` from every surface: it fills niches, shelves and the space
    under tables, but not the hollow of an upholstered seat that is open at its base. What it does
    not reach is decided by the vote (`enclosed`), taken with a lid under the object and on its
    `closed` sides; within a pocket that no surface divides the majority counts. `distance` is the
    unsigned distance to this object, infinite beyond the band; `low` the window's first node.
    """
    clearance = max(CLEARANCE, 0.55 * cell)
    first, last = _box(corners, low, distance.shape, cell)
    within = np.zeros(distance.shape, dtype=bool)
    within[tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True))] = True
    air = _air(distance > clearance, first, last, closed)
    shut = np.concatenate([corners, lids(corners, closed)])
    _let_air_creep(air, within, ray_scene(shut), low, cell, 1 + int(clearance / cell))
    asked = np.argwhere(within & ~air)
    inside = np.zeros(distance.shape, dtype=bool)
    inside[tuple(asked.T)] = enclosed(shut, (asked + low) * cell)
    _settle_pockets(inside, within & ~air, distance, cell)
    return inside


def _box(
    corners: Float[np.ndarray, "F 3 3"],
    low: Int64[np.ndarray, "3"],
    shape: tuple[int, ...],
    cell: float,
) -> tuple[Int64[np.ndarray, "3"], Int64[np.ndarray, "3"]]:
    """First and last node of the window within the object's bounding box."""
    flat = corners.reshape(-1, 3)
    first = np.ceil(flat.min(axis=0) / cell - 1e-6).astype(np.int64) - low
    last = np.floor(flat.max(axis=0) / cell + 1e-6).astype(np.int64) - low
    return np.maximum(first, 0), np.minimum(last, np.array(shape) - 1)


def _air(
    free: Bool[np.ndarray, "x y z"],
    first: Int64[np.ndarray, "3"],
    last: Int64[np.ndarray, "3"],
    closed: frozenset[str],
) -> Bool[np.ndarray, "x y z"]:
    """Free nodes that air reaches from outside the bounding box, level by level from the top."""
    free = free.copy()
    source = np.zeros(free.shape, dtype=bool)
    for axis, (start, end) in enumerate(zip(first[:2], last[:2], strict=True)):
        for side, beyond in (
            (f"-{'xy'[axis]}", slice(0, start)),
            (f"+{'xy'[axis]}", slice(end + 1, None)),
        ):
            where = (slice(None),) * axis + (beyond,)
            if side in closed:
                free[where] = False
            else:
                source[where] = True
    source[:, :, last[2] + 1 :] = True
    air = free & source
    for level in range(free.shape[2] - 1, -1, -1):
        above = air[:, :, level + 1] if level + 1 < free.shape[2] else False
        pools, count = label(free[:, :, level])
        wet = np.zeros(count + 1, dtype=bool)
        wet[pools[(air[:, :, level] | above) & free[:, :, level]]] = True
        air[:, :, level] = wet[pools] & free[:, :, level]
    return air


def lids(corners: Float[np.ndarray, "F 3 3"], closed: frozenset[str]) -> Float[np.ndarray, "L 3 3"]:
    """Rectangles just outside the bounding box: below, and on the closed sides."""
    low, high = corners.min(axis=(0, 1)) - 2e-3, corners.max(axis=(0, 1)) + 2e-3
    faces = [(2, low[2])]
    faces += [
        (i // 2, (low, high)[i % 2][i // 2]) for i, side in enumerate(SIDES) if side in closed
    ]
    lids = []
    for axis, at in faces:
        u, v = (axis + 1) % 3, (axis + 2) % 3
        ring = np.zeros((4, 3))
        ring[:, axis] = at
        ring[:, u], ring[:, v] = (
            [low[u], high[u], high[u], low[u]],
            [low[v], low[v], high[v], high[v]],
        )
        lids += [ring[[0, 1, 2]], ring[[0, 2, 3]]]
    return np.array(lids)


def _let_air_creep(
    air: Bool[np.ndarray, "x y z"],
    within: Bool[np.ndarray, "x y z"],
    scene: EmbreeScene,
    low: Int64[np.ndarray, "3"],
    cell: float,
    rounds: int,
) -> None:
    """Nodes within the clearance of a surface: air comes from a neighbour if nothing is between.

    Changes `air`. A few rounds only, so that it does not creep through seams.
    """
    for _ in range(rounds):
        came = np.zeros(air.shape, dtype=bool)
        for step in _STEPS:
            node = np.argwhere(within & _beside(air, step) & ~air & ~came)
            source = ((node + step + low) * cell).astype(np.float32)
            towards = np.broadcast_to((-step).astype(np.float32), source.shape)
            blocked = occluded(scene, source, towards, cell)
            came[tuple(node[~blocked].T)] = True
        air |= came


def _beside(
    nodes: Bool[np.ndarray, "x y z"], step: Int64[np.ndarray, "3"]
) -> Bool[np.ndarray, "x y z"]:
    """True at nodes whose neighbour in that direction is in `nodes`."""
    shifted = np.zeros(nodes.shape, dtype=bool)
    to = tuple(slice(max(0, -s), n - max(0, s)) for s, n in zip(step, nodes.shape, strict=True))
    of = tuple(slice(max(0, s), n - max(0, -s)) for s, n in zip(step, nodes.shape, strict=True))
    shifted[to] = nodes[of]
    return shifted


def _settle_pockets(
    inside: Bool[np.ndarray, "x y z"],
    enclosed_nodes: Bool[np.ndarray, "x y z"],
    distance: Float32[np.ndarray, "x y z"],
    cell: float,
) -> None:
    """One sign for nodes between which no surface can lie: that of most of them."""
    pockets, count = label(enclosed_nodes & (distance > cell / 2))
    size = np.bincount(pockets.ravel(), minlength=count + 1)
    votes = np.bincount(pockets.ravel(), inside.ravel(), minlength=count + 1)
    solid = votes > size / 2
    inside[pockets > 0] = solid[pockets[pockets > 0]]

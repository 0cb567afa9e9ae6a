"""Checks of a furnished room: overlaps, floating things, walkable floor, seats at real heights."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from experiments.scene.enclosure import enclosed
from experiments.scene.exact import nearest_triangle
from experiments.scene.furnish import triangle_areas
from experiments.scene.objects import PlacedObject
from experiments.scene.scene import MPCAT40
from experiments.scene.settle import settled_height, surface_heights
from experiments.scene.surface import surface_samples
from experiments.scene.walk import WalkMap, walk_map

OVERLAP, OVERLAP_SOFT = 0.012, 0.06
"""Metres that one object may reach into another; soft things sink in."""
_OVERLAP_POINTS = 5
_GAP = 0.012
_ROD = 0.08
"""Metres between a wall and the curtains that hang before it."""
_OUTSIDE = 0.005
_SLIVER = 1e-7
"""Square metres below which a triangle has no dependable plane."""
_REACH = 0.45
"""Metres from the walkable floor within which a seat counts as reachable."""
SEAT_HEIGHTS: dict[str, tuple[float, float]] = {
    "chair": (0.40, 0.50),
    "sofa": (0.38, 0.48),
    "seating": (0.42, 0.50),
    "bed": (0.42, 0.62),
    "stool": (0.36, 0.80),
}
_SIT = {"chair": 1, "stool": 1, "sofa": 2, "seating": 2, "bed": 2}
_LIE = ("bed", "sofa")
_TOUCH = ("table", "cabinet", "shelving", "appliances", "tv_monitor", "board_panel", "sink",
          "plant", "counter", "chest_of_drawers")  # fmt: skip
_LEAN_HEIGHT = 0.7


@dataclass(frozen=True)
class Overlap:
    """Two objects that reach into each other."""

    a: str
    b: str
    depth: float
    """Metres: how deep a sample of `a` lies inside `b`."""
    soft: bool

    @property
    def allowed(self) -> float:
        """The depth that is still accepted."""
        return OVERLAP_SOFT if self.soft else OVERLAP


@dataclass(frozen=True)
class LayoutReport:
    """What the checks found; `faults` says what is wrong in words."""

    name: str
    triangles: int
    objects: int
    floor_standing: int
    classes: tuple[str, ...]
    overlaps: tuple[Overlap, ...]
    floating: tuple[str, ...]
    outside: tuple[str, ...]
    free_floor: float
    walkable: float
    largest_component: float
    seat_heights: dict[str, float]
    wrong_seats: tuple[str, ...]
    unreached: tuple[str, ...]
    """Seats and beds farther than 45 cm from the largest walkable region."""
    sit: int
    lie: int
    touch: int
    lean: int

    def faults(self) -> list[str]:
        """Every bound that the room breaks; empty for a sound room."""
        bounds: list[tuple[str, float, float, float]] = [
            ("objects", self.objects, 25, np.inf),
            ("floor-standing objects", self.floor_standing, 12, np.inf),
            ("free floor", self.free_floor, 0.35, 0.65),
            ("walkable share", self.walkable, 0.08, 0.25),
            ("largest walkable component", self.largest_component, 0.6, 1.0),
            ("places to sit", self.sit, 5, np.inf),
            ("places to lean on", self.lean, 3, np.inf),
            ("seats out of reach", len(self.unreached), 0, 2),
        ]
        found = [
            f"{what} {value:g}, wanted {low:g} to {high:g}"
            for what, value, low, high in bounds
            if not low <= value <= high
        ]
        found += [
            f"{o.a} reaches {100 * o.depth:.1f} cm into {o.b}"
            for o in self.overlaps
            if o.depth > o.allowed
        ]
        found += [f"{name} floats" for name in self.floating]
        found += [f"{name} is outside the room" for name in self.outside]
        found += [
            f"{name} has its seat at {self.seat_heights[name]:.2f} m" for name in self.wrong_seats
        ]
        return found

    def as_json(self) -> dict[str, Any]:
        """The report as one JSON object; lengths in metres."""
        overlaps = [
            {"a": o.a, "b": o.b, "depth": round(o.depth, 4), "soft": o.soft} for o in self.overlaps
        ]
        return {
            "scene": self.name,
            "triangles": self.triangles,
            "objects": self.objects,
            "floor_standing": self.floor_standing,
            "classes": list(self.classes),
            "free_floor": round(self.free_floor, 4),
            "walkable": round(self.walkable, 4),
            "largest_component": round(self.largest_component, 4),
            "overlaps": overlaps,
            "floating": list(self.floating),
            "outside": list(self.outside),
            "seat_heights": {name: round(z, 3) for name, z in self.seat_heights.items()},
            "unreached": list(self.unreached),
            "sit": self.sit,
            "lie": self.lie,
            "touch": self.touch,
            "lean": self.lean,
            "faults": self.faults(),
        }


def check_layout(
    name: str, size: tuple[float, float, float], objects: Sequence[PlacedObject]
) -> tuple[LayoutReport, WalkMap]:
    """All checks of a furnished room; the walk map comes along for drawing."""
    walk = walk_map(objects, size)
    seats = seat_heights(objects)
    counts = affordances(objects)
    report = LayoutReport(
        name=name,
        triangles=sum(len(part.corners) for placed in objects for part in placed.parts),
        objects=len(objects),
        floor_standing=sum(stands_on_floor(placed) for placed in objects),
        classes=tuple(sorted({MPCAT40[placed.label] for placed in objects})),
        overlaps=tuple(overlaps(objects)),
        floating=tuple(floating(objects, size)),
        outside=tuple(outside(objects, size)),
        free_floor=walk.free_share,
        walkable=walk.walkable_share,
        largest_component=walk.largest_share,
        seat_heights=seats,
        wrong_seats=tuple(_wrong(objects, seats)),
        unreached=tuple(unreached(objects, seats, walk)),
        **counts,
    )
    return report, walk


def is_rug(placed: PlacedObject) -> bool:
    """Rugs belong to the floor: nothing collides with them."""
    return MPCAT40[placed.label] == "floor"


def stands_on_floor(placed: PlacedObject) -> bool:
    """Furniture and clutter on the floor, rugs and wall pieces left out."""
    return placed.on is None and placed.wall is None and not is_rug(placed)


def overlaps(objects: Sequence[PlacedObject]) -> list[Overlap]:
    """Pairs in which at least five surface samples of one lie deeper than 12 mm inside the other.

    Inside means surrounded by the other object in at least 25 of 26 directions; the depth is that
    of the fifth deepest sample.
    """
    solid = [placed for placed in objects if not is_rug(placed)]
    samples = {p.id: surface_samples(p.triangles(), 0.012, 60_000)[0] for p in solid}
    found = []
    for a, b in _near_pairs(solid, samples):
        depth = _depth(samples[a.id], b, samples[b.id])
        if depth > OVERLAP:
            found.append(Overlap(a.id, b.id, depth, a.soft or b.soft))
    return found


def _near_pairs(
    objects: Sequence[PlacedObject], samples: dict[str, Float[np.ndarray, "S 3"]]
) -> Iterator[tuple[PlacedObject, PlacedObject]]:
    """Ordered pairs whose boxes share more than a skin of 12 mm."""
    low = {p.id: p.triangles().min((0, 1)) for p in objects}
    high = {p.id: p.triangles().max((0, 1)) for p in objects}
    for a in objects:
        for b in objects:
            shared = np.minimum(high[a.id], high[b.id]) - np.maximum(low[a.id], low[b.id])
            if a.id != b.id and np.all(shared > OVERLAP):
                yield a, b


def _depth(
    points: Float[np.ndarray, "S 3"], other: PlacedObject, surface: Float[np.ndarray, "T 3"]
) -> float:
    """Depth of the fifth deepest point inside the other object; 0 if there are fewer."""
    triangles = other.triangles()
    low, high = triangles.min((0, 1)) + OVERLAP, triangles.max((0, 1)) - OVERLAP
    near = points[np.all((points > low) & (points < high), axis=1)]
    if len(near) < _OVERLAP_POINTS:
        return 0.0
    distance = np.asarray(cKDTree(surface).query(near)[0])
    candidate = np.flatnonzero(distance > OVERLAP)
    inside = candidate[enclosed(triangles, near[candidate])]
    if len(inside) < _OVERLAP_POINTS:
        return 0.0
    deepest = inside[np.argsort(-distance[inside], kind="stable")[: 4 * _OVERLAP_POINTS]]
    proper = triangles[triangle_areas(triangles) > _SLIVER]
    exact = sorted(nearest_triangle(point, proper)[0] for point in near[deepest])
    return exact[-_OVERLAP_POINTS]


def floating(objects: Sequence[PlacedObject], size: tuple[float, float, float]) -> Iterator[str]:
    """Objects that touch neither the floor, nor their support, nor their wall within 12 mm."""
    by_id = {placed.id: placed for placed in objects}
    for placed in objects:
        triangles = placed.triangles()
        if placed.wall is not None:
            gap = _wall_gap(triangles, placed.wall, size)
            gap -= _ROD if MPCAT40[placed.label] == "curtain" else 0.0
        elif placed.on is None:
            gap = abs(float(triangles[..., 2].min()))
        else:
            gap = _support_gap(triangles, by_id[placed.on].triangles(), placed.soft)
        if gap > _GAP:
            yield placed.id


def _wall_gap(
    triangles: Float[np.ndarray, "F 3 3"], wall: str, size: tuple[float, float, float]
) -> float:
    low, high = triangles.min((0, 1)), triangles.max((0, 1))
    gaps = {"w": low[0], "s": low[1], "e": size[0] - high[0], "n": size[1] - high[1]}
    return abs(float(gaps[wall]))


def _support_gap(
    triangles: Float[np.ndarray, "F 3 3"], support: Float[np.ndarray, "G 3 3"], soft: bool
) -> float:
    """Smallest gap between the lowest points and the support; infinite if most of them hang over.

    Of soft things all points count: they may hang over an edge, as blankets do.
    """
    points = triangles.reshape(-1, 3)
    lowest = points if soft else points[points[:, 2] < points[:, 2].min() + 0.01]
    lowest = lowest[:: max(1, len(lowest) // 200)]
    under = surface_heights(support, lowest[:, :2])
    gap = lowest[:, 2] - under
    carried = np.abs(gap) < 0.05
    if not carried.any() or (not soft and carried.mean() <= 0.5):
        return float("inf")
    return float(np.min(np.abs(gap[carried])))


def outside(objects: Sequence[PlacedObject], size: tuple[float, float, float]) -> Iterator[str]:
    """Objects that reach more than 5 mm through a wall."""
    for placed in objects:
        triangles = placed.triangles()
        low, high = triangles.min((0, 1)), triangles.max((0, 1))
        if low[:2].min() < -_OUTSIDE or np.any(high[:2] > np.array(size[:2]) + _OUTSIDE):
            yield placed.id


def seat_heights(objects: Sequence[PlacedObject]) -> dict[str, float]:
    """Height of every seat, sofa, bench and bed by rays onto its middle, a little to the front."""
    heights = {}
    for placed in objects:
        if MPCAT40[placed.label] in SEAT_HEIGHTS and placed.on is None:
            heights[placed.id] = _seat_height(placed)
    return heights


def _seat_height(placed: PlacedObject) -> float:
    """Backs stand behind the middle, so the rays fall 8 % of the depth in front of it."""
    angle = np.radians(placed.yaw_deg)
    front = np.array([np.sin(angle), -np.cos(angle)])
    side = np.array([np.cos(angle), np.sin(angle)])
    flat = placed.triangles().reshape(-1, 3)[:, :2]
    depth, width = float(np.ptp(flat @ front)), float(np.ptp(flat @ side))
    x, y = np.array([placed.x, placed.y]) + 0.08 * depth * front
    return settled_height(placed.triangles(), float(x), float(y), (width, depth))


def _wrong(objects: Sequence[PlacedObject], heights: dict[str, float]) -> Iterator[str]:
    for placed in objects:
        if placed.id in heights:
            low, high = SEAT_HEIGHTS[MPCAT40[placed.label]]
            if not low <= heights[placed.id] <= high:
                yield placed.id


def unreached(
    objects: Sequence[PlacedObject], seats: dict[str, float], walk: WalkMap
) -> Iterator[str]:
    """Seats and beds whose box is farther than 45 cm from the largest walkable region."""
    for placed in objects:
        if placed.id in seats:
            triangles = placed.triangles()
            low, high = triangles.min((0, 1))[:2], triangles.max((0, 1))[:2]
            if walk.distance_to_largest(low, high) > _REACH:
                yield placed.id


def affordances(objects: Sequence[PlacedObject]) -> dict[str, int]:
    """How many places there are to sit, to lie, to touch and to lean on, counted by class."""
    sit = lie = touch = lean = 0
    for placed in objects:
        name = MPCAT40[placed.label]
        if placed.on is not None:
            continue
        sit += _SIT.get(name, 0)
        lie += name in _LIE
        if name in _TOUCH:
            touch += 1
            lean += float(placed.triangles()[..., 2].max()) > _LEAN_HEIGHT
    return {"sit": sit, "lie": lie, "touch": touch, "lean": lean}

"""The cutaway: which walls and furniture a camera must not draw, so that the body is seen.

Hidden are the ceiling, every wall that the camera stands behind with all that hangs on it, tall
furniture on the camera's side, and tall furniture that stands against a hidden wall. Things as high
as a table are hidden only when they do cover the body, and never when the body touches them: a seat
seen from behind says more than a body that sits on nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from renderer.stage import StagePart
from renderer.visibility import Blockers, BodySamples

TALL_M = 1.15
MEDIUM_M = 0.85
CAMERA_SIDE_M = 0.35
AT_WALL_M = 0.12
TOUCH_M = 0.05
BLOCKS_SHARE = 0.02
"""Medium furniture goes when it covers this share of the body's weight in the mean."""


@dataclass(frozen=True)
class Group:
    """What is hidden together: its box, and the wall it is or hangs on."""

    name: str
    low: Float[np.ndarray, "3"]
    high: Float[np.ndarray, "3"]
    wall: str | None

    @property
    def is_furniture(self) -> bool:
        """Neither shell nor tied to a wall."""
        return self.wall is None and self.name.startswith("object:")


class Cutaway:
    """Hiding rules of one room, with its triangles ready for visibility rays."""

    def __init__(
        self,
        groups: Sequence[Group],
        blockers: Blockers,
        room_size: tuple[float, float, float],
        floor_z: float,
    ) -> None:
        self.groups = tuple(groups)
        self._blockers = blockers
        self._room_size, self._floor_z = room_size, floor_z

    @classmethod
    def of_room(
        cls, parts: Sequence[StagePart], room_size: tuple[float, float, float], floor_z: float
    ) -> Cutaway:
        """Gather the parts into their groups."""
        groups = room_groups(parts)
        number = {group.name: index for index, group in enumerate(groups)}
        corners = np.concatenate([part.corners for part in parts])
        owner = np.concatenate([np.full(len(p.corners), number[p.group]) for p in parts])
        return cls(groups, Blockers(corners, owner), room_size, floor_z)

    def hidden_from(
        self, eye: Float[np.ndarray, "3"], box: Float[np.ndarray, "2 3"], samples: BodySamples
    ) -> set[str]:
        """Names of the groups that a camera at `eye` framing `box` does not draw."""
        walls = self.hidden_walls(eye)
        hidden = {g.name for g in self.groups if g.name == "ceiling" or g.wall in walls}
        hidden |= {
            g.name for g in self.groups if g.is_furniture and self._is_tall_near(g, eye, box, walls)
        }
        may_go = {g.name for g in self.groups if g.is_furniture and self._may_go(g, samples)}
        for _ in range(3):
            blocking = self._blocking_shares(eye, samples, hidden)
            more = {name for name, share in blocking.items() if share > BLOCKS_SHARE} & may_go
            if not more:
                break
            hidden |= more
        return hidden

    def hidden_before_room(
        self, eye: Float[np.ndarray, "3"], box: Float[np.ndarray, "2 3"]
    ) -> set[str]:
        """The same where nobody is to be seen: tall things go only with the wall they stand at."""
        walls = self.hidden_walls(eye)
        return {
            group.name
            for group in self.groups
            if group.name == "ceiling"
            or group.wall in walls
            or (group.is_furniture and self._is_tall_at(group, walls))
        }

    def hidden_walls(self, eye: Float[np.ndarray, "3"]) -> set[str]:
        """Walls whose plane the eye stands behind (or within 10 cm of)."""
        width, depth, _ = self._room_size
        beyond = {"n": eye[1] - depth, "s": -eye[1], "e": eye[0] - width, "w": -eye[0]}
        return {wall for wall, distance in beyond.items() if distance > -0.1}

    def visible_fraction(
        self, eye: Float[np.ndarray, "3"], samples: BodySamples, hidden: set[str]
    ) -> Float[np.ndarray, "B K"]:
        """Weighted share of the camera-facing samples that the room leaves visible, per frame."""
        facing = samples.facing(eye)
        seen = np.zeros(facing.shape)
        seen[facing] = self._first(eye, samples.points[facing], hidden) < 0
        total = (facing * samples.weights).sum(-1)
        return np.where(total > 0, (seen * samples.weights).sum(-1) / np.maximum(total, 1e-12), 0.0)

    def _is_tall_near(
        self,
        group: Group,
        eye: Float[np.ndarray, "3"],
        box: Float[np.ndarray, "2 3"],
        walls: set[str],
    ) -> bool:
        if group.high[2] - self._floor_z <= TALL_M:
            return False
        target = box.mean(axis=0)[:2]
        ahead = eye[:2] - target
        ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
        middle = 0.5 * (group.low + group.high)[:2]
        if float((middle - target) @ ahead) > CAMERA_SIDE_M:
            return True
        return self._is_tall_at(group, walls)

    def _is_tall_at(self, group: Group, walls: set[str]) -> bool:
        """Over 1.15 m and along one of these walls."""
        if group.high[2] - self._floor_z <= TALL_M:
            return False
        width, depth, _ = self._room_size
        gaps = {"n": depth - group.high[1], "s": group.low[1],
                "e": width - group.high[0], "w": group.low[0]}  # fmt: skip
        return any(gaps[wall] < AT_WALL_M and self._leans(group, wall) for wall in walls)

    def _leans(self, group: Group, wall: str) -> bool:
        """Stands along the wall (its longer side, or square), not merely with one end at it."""
        size = (group.high - group.low)[:2]
        along, across = (size[0], size[1]) if wall in "ns" else (size[1], size[0])
        return bool(along >= 0.8 * across)

    def _may_go(self, group: Group, samples: BodySamples) -> bool:
        if group.high[2] - self._floor_z <= MEDIUM_M:
            return False
        outside = np.maximum(group.low - samples.points, samples.points - group.high)
        distance = np.linalg.norm(np.maximum(outside, 0.0), axis=-1)
        return bool(distance.min() > TOUCH_M)

    def _blocking_shares(
        self, eye: Float[np.ndarray, "3"], samples: BodySamples, hidden: set[str]
    ) -> dict[str, float]:
        facing = samples.facing(eye)
        first = self._first(eye, samples.points[facing], hidden)
        weights = np.broadcast_to(samples.weights, facing.shape)[facing]
        total = max(float(weights.sum()), 1e-12)
        shares = np.bincount(first + 1, weights, minlength=len(self.groups) + 1)[1:] / total
        return {group.name: float(s) for group, s in zip(self.groups, shares, strict=True)}

    def _first(
        self, eye: Float[np.ndarray, "3"], points: Float[np.ndarray, "R 3"], hidden: set[str]
    ) -> np.ndarray:
        mask = np.array([group.name in hidden for group in self.groups], dtype=bool)
        return self._blockers.first_group(points, eye, mask)


def room_groups(parts: Sequence[StagePart]) -> tuple[Group, ...]:
    """The groups of a room, sorted by name, with the box of all their parts."""
    members: dict[str, list[StagePart]] = {}
    for part in parts:
        members.setdefault(part.group, []).append(part)
    groups = []
    for name in sorted(members):
        corners = np.concatenate([part.corners.reshape(-1, 3) for part in members[name]])
        corners = corners.astype(np.float64)
        walls = {part.wall for part in members[name]} - {None}
        if name.startswith("wall:"):
            walls = {name.removeprefix("wall:")}
        wall = sorted(w for w in walls if w)[0] if walls else None
        groups.append(Group(name, corners.min(axis=0), corners.max(axis=0), wall))
    return tuple(groups)

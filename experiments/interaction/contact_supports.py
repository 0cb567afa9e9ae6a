"""Supports fitted to the holds of a clip: seats, beds, tops and walls where the body leaves room for them.

The body comes first, the furniture is built to it, so contact is physically consistent. What kind of
furniture, how large and how exactly it meets the body is drawn at random.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float, Integer

from experiments.interaction.contact_holds import Hold, PosedClip
from experiments.interaction.contact_scene import (
    Box,
    ContactScene,
    HalfSpace,
    Heading,
    Solid,
    tilted_slab,
)
from experiments.scene.scene import MPCAT40

LABEL = {name: index for index, name in enumerate(MPCAT40)}
JITTER_M = 0.01
"""Supports press into the skin by up to this much."""
LEAST_HEIGHT_M = 0.2
"""Who sits or lies lower than this uses the floor."""
FLOOR = HalfSpace(np.array([0.0, 0.0, 1.0]), 0.0, LABEL["floor"])

_SEATS = {"chair": 1.0, "sofa": 0.35, "bed": 0.25, "stool": 0.2, "seating": 0.15, "toilet": 0.08}
_HIGH_SEATS = {"stool": 2.0, "table": 0.4, "counter": 0.4, "chair": 0.2}
_BACKED = {"chair": 0.85, "sofa": 1.0, "seating": 0.4, "toilet": 0.3, "bed": 0.15}
"""Share of the seats of a class that have something to lean on."""
_BEDS = {"bed": 0.72, "sofa": 0.23, "seating": 0.05}
_TOPS = {"table": 0.6, "counter": 0.27, "cabinet": 0.13}
_SHELVES = {"shelving": 0.6, "cabinet": 0.25, "": 0.15}
_FRONTS = {"wall": 0.68, "door": 0.16, "cabinet": 0.10, "shelving": 0.06}
_TOP_LIMIT_M = 1.15


def draw_scene(
    clip: PosedClip, holds: list[Hold], rng: np.random.Generator, sparing: bool = False
) -> ContactScene:
    """One random scene that fits a clip; `sparing` leaves out all that does not carry the body."""
    solids: list[Solid] = [FLOOR]
    beds, seats = _lying(clip, holds), _seated(clip, holds)
    for bed in beds:
        near = [seat for seat in seats if _same_place(clip, bed, seat)]
        seats = [seat for seat in seats if seat not in near]
        solids += _bed(clip, bed, near, rng, sparing)
    for group in _grouped(clip, seats):
        solids += _seat(clip, group, rng, sparing)
    for hands in _hand_groups(holds):
        solids += _hand_support(clip, hands, rng)
    standing = [hold for hold in holds if hold.kind == "standing" and hold.stop - hold.start >= 15]
    alone = len(solids) == 1
    if standing and alone and not sparing and rng.random() < 0.25:
        solids.append(_wall_beside(clip, standing[int(rng.integers(len(standing)))], rng))
    return ContactScene(tuple(solids))


def _seat(
    clip: PosedClip, holds: list[Hold], rng: np.random.Generator, sparing: bool
) -> Iterator[Solid]:
    """A seat under the buttocks and thighs, perhaps with a back, an arm and a table."""
    frames = _frames(holds)
    heading = clip.heading(slice(int(frames[0]), int(frames[-1]) + 1))
    under = heading.local(clip.vertices[frames][:, _columns(clip, "buttocks", "thigh_backs")])
    lowest = under[..., 2].min(1)
    top = float(np.percentile(lowest, 30)) + rng.uniform(0, JITTER_M)
    if top < LEAST_HEIGHT_M:
        return
    lean = _lean(clip, frames, heading)
    tables = list(_table(clip, frames, heading, top, rng, sparing))
    name = _seat_class(top, lean, bool(tables), rng)
    near = under[under[..., 2] < lowest[:, None] + 0.06]
    back = float(near[:, 0].min()) - rng.uniform(0.02, 0.12)
    front = _seat_front(clip, frames, heading, top, float(near[:, 0].max()), rng)
    wide = {"sofa": 0.6, "bed": 0.7, "seating": 0.6}.get(name, 0.08)
    right, left = (
        float(near[:, 1].min()) - rng.uniform(0.0, wide),
        float(near[:, 1].max()) + rng.uniform(0.0, wide),
    )
    board = name in ("chair", "stool") and rng.random() < 0.7
    bottom = top - rng.uniform(0.03, 0.08) if board else 0.0
    yield heading.box((back, right, bottom), (front, left, top), LABEL[name])
    yield from tables
    if not sparing and rng.random() < _BACKED.get(name, 0.0):
        yield _back_rest(clip, frames, heading, lean, (right, left), top, name, rng)
    if name == "sofa" and not sparing and rng.random() < 0.4:
        yield _arm(heading, (back, front), (right, left), top, rng)


def _bed(
    clip: PosedClip, bed: Hold, seats: list[Hold], rng: np.random.Generator, sparing: bool
) -> Iterator[Solid]:
    """A bed or sofa under the lying body, and under who sits on its edge before or after."""
    frames = _frames([bed])
    trunk = clip.joint("neck")[frames] - clip.joint("pelvis")[frames]
    heading = Heading.of(np.median(trunk, axis=0))
    lying = clip.vertices[frames]
    top = _rest_height(lying, rng)
    if top < LEAST_HEIGHT_M:
        return
    name = _drawn(_BEDS, rng)
    footprint = [heading.local(lying[lying[..., 2] < top + 0.12])]
    if seats:
        under = clip.vertices[_frames(seats)][:, _columns(clip, "buttocks")]
        top = max(top, float(np.percentile(under[..., 2].min(1), 30)) - 0.012)
        footprint.append(heading.local(under.reshape(-1, 3)))
    spread = np.concatenate(footprint)
    margin = rng.uniform(0.02, 0.15, 4)
    low = (float(spread[:, 0].min()) - margin[0], float(spread[:, 1].min()) - margin[1], 0.0)
    high = (float(spread[:, 0].max()) + margin[2], float(spread[:, 1].max()) + margin[3], top)
    yield heading.box(low, high, LABEL[name])
    head = heading.local(lying[:, clip.columns["head"]])
    gap = float(np.percentile(head[..., 2].min(1), 30)) - top
    if not sparing and gap > 0.02 and rng.random() < 0.5:
        middle = head.reshape(-1, 3).mean(0)
        size = rng.uniform(0.14, 0.24, 2)
        yield heading.box(
            (middle[0] - size[0], middle[1] - size[1], top),
            (middle[0] + size[0], middle[1] + size[1], top + gap + rng.uniform(0, JITTER_M)),
            LABEL["cushion"],
        )


def _table(
    clip: PosedClip,
    frames: Integer[np.ndarray, " F"],
    heading: Heading,
    seat: float,
    rng: np.random.Generator,
    sparing: bool,
) -> Iterator[Solid]:
    """A table under seated hands that are ahead and above the thighs, seldom one over the lap."""
    hands = heading.local(clip.vertices[frames][:, _columns(clip, "left_hand", "right_hand")])
    thighs = clip.vertices[frames][:, clip.columns["thighs"], 2].max()
    pelvis = heading.local(clip.joint("pelvis")[frames])
    low = hands[..., 2].min(1)
    above = low > thighs + 0.02
    if above.mean() > 0.5:
        top = float(np.percentile(low[above], 30)) + rng.uniform(0, JITTER_M)
        edge = float(np.percentile(hands[..., 0].min(1), 30)) - rng.uniform(0.05, 0.22)
    elif not sparing and rng.random() < 0.08:
        top = float(thighs) + rng.uniform(0.05, 0.14)
        edge = float(pelvis[:, 0].max()) + rng.uniform(0.22, 0.40)
    else:
        return
    far, half = edge + rng.uniform(0.6, 0.9), rng.uniform(0.45, 1.0)
    side = float(pelvis[:, 1].mean()) + rng.uniform(-0.15, 0.15)
    name = "counter" if top > seat + 0.42 and rng.random() < 0.3 else "table"
    thick = rng.uniform(0.02, 0.035)
    yield heading.box((edge, side - half, top - thick), (far, side + half, top), LABEL[name])


def _back_rest(
    clip: PosedClip,
    frames: Integer[np.ndarray, " F"],
    heading: Heading,
    lean: float,
    across: tuple[float, float],
    seat: float,
    name: str,
    rng: np.random.Generator,
) -> Box:
    """A board behind the trunk at its own tilt, touching it or nearly."""
    lean = float(np.clip(lean + rng.uniform(-0.06, 0.06), 0.0, 0.6))
    height = seat + rng.uniform(0.35, 0.55)
    back = heading.local(clip.vertices[frames][:, _columns(clip, "back", "buttocks")])
    along = np.cos(lean) * back[..., 2] - np.sin(lean) * back[..., 0]
    out = np.cos(lean) * back[..., 0] + np.sin(lean) * back[..., 2]
    reach = float(np.median(along[back[..., 2] < height])) + (height - seat) / 2
    held = np.where((back[..., 2] > seat + 0.05) & (back[..., 2] < height), out, np.inf).min(1)
    front = float(np.percentile(held[np.isfinite(held)], 30)) + rng.uniform(-0.015, 0.012)
    start = float(along.min()) + (0.02 if name != "chair" else rng.uniform(0.0, 0.2))
    thickness = rng.uniform(0.02, 0.06) if name == "chair" else rng.uniform(0.1, 0.2)
    return tilted_slab(heading, lean, front, thickness, (start, reach), across, LABEL[name])


def _arm(
    heading: Heading,
    along: tuple[float, float],
    across: tuple[float, float],
    seat: float,
    rng: np.random.Generator,
) -> Box:
    width, top = rng.uniform(0.12, 0.2), seat + rng.uniform(0.14, 0.24)
    left = rng.random() < 0.5
    inner = across[1] + rng.uniform(0.05, 0.2) if left else across[0] - rng.uniform(0.05, 0.2)
    edges = (inner, inner + width) if left else (inner - width, inner)
    return heading.box((along[0], edges[0], 0.0), (along[1], edges[1], top), LABEL["sofa"])


def _hand_support(clip: PosedClip, hands: list[Hold], rng: np.random.Generator) -> Iterator[Solid]:
    """A top under palms that face down, a front before palms that face ahead, else a shelf."""
    frames = _frames(hands)
    heading = clip.heading(slice(int(frames[0]), int(frames[-1]) + 1))
    sides = sorted({hold.kind.removesuffix("_hand") for hold in hands})
    hand = heading.local(clip.vertices[frames][:, _columns(clip, *(f"{s}_hand" for s in sides))])
    facing = np.mean([clip.palms[side][frames].mean(0) for side in sides], axis=0)
    ahead, _, up = heading.axes @ facing
    low = hand[..., 2].min(1)
    height = float(np.percentile(low, 30)) + rng.uniform(0, JITTER_M)
    if height < LEAST_HEIGHT_M:
        return
    if up < -0.5 and height < _TOP_LIMIT_M:
        yield _top(heading, hand, height, rng)
    elif ahead > 0.5:
        yield _front(heading, hand, rng)
    else:
        yield from _shelf(heading, hand, height, rng)


def _top(
    heading: Heading, hand: Float[np.ndarray, "F H 3"], height: float, rng: np.random.Generator
) -> Box:
    name = _drawn(_TOPS, rng)
    edge = float(np.percentile(hand[..., 0].min(1), 30)) - rng.uniform(0.02, 0.16)
    right, left = float(hand[..., 1].min()), float(hand[..., 1].max())
    bottom = height - rng.uniform(0.02, 0.05) if name == "table" else 0.0
    return heading.box(
        (edge, right - rng.uniform(0.05, 0.6), bottom),
        (edge + rng.uniform(0.45, 0.8), left + rng.uniform(0.05, 0.6), height),
        LABEL[name],
    )


def _front(heading: Heading, hand: Float[np.ndarray, "F H 3"], rng: np.random.Generator) -> Solid:
    """Something upright that the foremost of the palms touches."""
    name = _drawn(_FRONTS, rng)
    place = float(np.percentile(hand[..., 0].max(1), 70)) - rng.uniform(0, JITTER_M)
    if name == "wall":
        return HalfSpace(-heading.ahead, -place, LABEL["wall"])
    middle = float(hand[..., 1].mean())
    half = rng.uniform(0.42, 0.5) if name == "door" else rng.uniform(0.35, 0.8)
    height = 2.05 if name == "door" else float(hand[..., 2].max()) + rng.uniform(0.1, 0.6)
    return heading.box(
        (place, middle - half, 0.0), (place + 0.3, middle + half, height), LABEL[name]
    )


def _shelf(
    heading: Heading, hand: Float[np.ndarray, "F H 3"], height: float, rng: np.random.Generator
) -> Iterator[Solid]:
    """A plank, a cabinet or a top below the hand; sometimes it reaches for something in the air."""
    choice = {**_SHELVES, "table": 0.15, "counter": 0.15} if height < 1.0 else _SHELVES
    name = _drawn(choice, rng)
    if not name:
        return
    edge = float(np.percentile(hand[..., 0].min(1), 50)) - rng.uniform(-0.02, 0.08)
    right, left = float(hand[..., 1].min()), float(hand[..., 1].max())
    bottom = height - rng.uniform(0.02, 0.04) if name in ("shelving", "table") else 0.0
    yield heading.box(
        (edge, right - rng.uniform(0.1, 0.5), bottom),
        (edge + rng.uniform(0.25, 0.4), left + rng.uniform(0.1, 0.5), height),
        LABEL[name],
    )


def _wall_beside(clip: PosedClip, hold: Hold, rng: np.random.Generator) -> HalfSpace:
    """A wall behind or beside a person who stands still, touching or nearly."""
    heading = clip.heading(hold.frames)
    towards = [-heading.ahead, heading.left, -heading.left][int(rng.integers(3))]
    reach = (clip.vertices[hold.frames] @ towards).max(1)
    place = float(np.percentile(reach, 70)) + rng.uniform(-0.012, 0.03)
    return HalfSpace(-towards, -place, LABEL["wall"])


def _seat_front(
    clip: PosedClip,
    frames: Integer[np.ndarray, " F"],
    heading: Heading,
    top: float,
    knees: float,
    rng: np.random.Generator,
) -> float:
    """The seat ends under the thighs and before the calves."""
    calves = heading.local(clip.vertices[frames][:, clip.columns["calves"]])
    low = calves[calves[..., 2] < top - 0.02]
    limit = float(np.percentile(low[:, 0], 2)) - 0.01 if len(low) else knees
    return min(knees + rng.uniform(-0.12, 0.05), limit)


def _seat_class(height: float, lean: float, table: bool, rng: np.random.Generator) -> str:
    if height > 0.58:
        return _drawn(_HIGH_SEATS, rng)
    shares = dict(_SEATS)
    if lean > 0.22:
        shares["sofa"] = 1.0
    if height > 0.48:
        shares["sofa"] *= 0.4
        shares["bed"] *= 1.5
    if table:
        shares |= {"bed": 0.0, "toilet": 0.0, "sofa": 0.15}
    return _drawn(shares, rng)


def _lean(clip: PosedClip, frames: Integer[np.ndarray, " F"], heading: Heading) -> float:
    """Backward lean of the trunk, radians."""
    trunk = heading.local(clip.joint("spine3")[frames] - clip.joint("pelvis")[frames])
    return float(np.median(np.arctan2(-trunk[:, 0], trunk[:, 2])))


def _rest_height(vertices: Float[np.ndarray, "F V 3"], rng: np.random.Generator) -> float:
    return float(np.percentile(vertices[..., 2].min(1), 30)) + rng.uniform(0, JITTER_M)


def _seated(clip: PosedClip, holds: list[Hold]) -> list[Hold]:
    return [hold for hold in holds if hold.kind == "seated"]


def _lying(clip: PosedClip, holds: list[Hold]) -> list[Hold]:
    """Lying holds, those on the same bed joined into one."""
    joined: list[Hold] = []
    for hold in (hold for hold in holds if hold.kind == "lying"):
        if joined and _same_place(clip, joined[-1], hold, 1.0):
            joined[-1] = Hold("lying", joined[-1].start, hold.stop)
        else:
            joined.append(hold)
    return joined


def _grouped(clip: PosedClip, seats: list[Hold]) -> list[list[Hold]]:
    """Seated holds by seat: those at one place share it."""
    groups: list[list[Hold]] = []
    for seat in seats:
        home = [group for group in groups if _same_place(clip, group[0], seat, 0.3)]
        if home:
            home[0].append(seat)
        else:
            groups.append([seat])
    return groups


def _same_place(clip: PosedClip, one: Hold, other: Hold, reach: float = 0.9) -> bool:
    pelvis = clip.joint("pelvis")
    gap = np.median(pelvis[one.frames], axis=0) - np.median(pelvis[other.frames], axis=0)
    return bool(np.linalg.norm(gap[:2]) < reach and abs(gap[2]) < 0.35)


def _hand_groups(holds: list[Hold]) -> list[list[Hold]]:
    """Holds of both hands at about the same time lean on one thing."""
    groups: list[list[Hold]] = []
    for hold in sorted((h for h in holds if h.kind.endswith("hand")), key=lambda h: h.start):
        last = groups[-1] if groups else []
        if last and hold.start < max(h.stop for h in last) + 5:
            last.append(hold)
        else:
            groups.append([hold])
    return groups


def _frames(holds: list[Hold]) -> Integer[np.ndarray, " F"]:
    """Every third frame of some holds."""
    return np.concatenate([np.arange(hold.start, hold.stop, 3) for hold in holds])


def _columns(clip: PosedClip, *regions: str) -> Integer[np.ndarray, " _"]:
    return np.unique(np.concatenate([clip.columns[name] for name in regions]))


def _drawn(shares: dict[str, float], rng: np.random.Generator) -> str:
    weights = np.array(list(shares.values()))
    return str(rng.choice(np.array(list(shares)), p=weights / weights.sum()))

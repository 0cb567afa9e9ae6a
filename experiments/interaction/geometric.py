"""The geometric rule: contact and classes from pose and kinematics alone, nothing learned.

A frame supports itself on soles, seat, back or palms; each kind of support has its vertices, its
test of posture, and the classes of furniture that it may rest on.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import binary_closing, binary_opening, gaussian_filter1d

from experiments.body.model import JOINT_NAMES, BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.interaction.mesh import MovingBody, moving_body
from experiments.motion.motion import Motion
from experiments.scene.scene import MPCAT40, N_CLASSES

SOLE_THICKNESS_M = 0.015
"""Sole vertices this close above the lowest of their foot touch the floor."""
SOLE_REACH_M = 0.04
"""A foot whose lowest vertex is higher than this above the clip's floor is in the air."""
SOLE_SPEED = 0.45
"""A foot faster than this, m/s, is swinging."""
HANGING_M = 0.07
"""A region whose lowest vertex is higher than this above the lowest of all hangs in the air."""
SUPPORT_THICKNESS_M = 0.03
"""Seat and back vertices this close above the lowest of their region touch."""
PALM_THICKNESS_M = 0.015
"""Palm vertices this close behind the foremost of their palm touch."""
TOP_HEIGHT_M = 1.15
"""Nobody leans on a top higher than this."""
HOLD_S = 0.25
"""Sitting, lying and touching shorter than this are passing postures."""
CERTAIN = 10.0
"""Score of the class of a vertex where all others score 0: a softmax of it is nearly one-hot."""
MAX_MAPS = 4
"""At most this many feature maps are offered."""

_SEATS = {"chair": 0.45, "sofa": 0.43, "bed": 0.52, "seating": 0.46, "stool": 0.46, "toilet": 0.42}
"""Classes that people sit on, with the seat height that is usual for them, metres."""
_HIGH_SEATS = {"stool": 0.74, "counter": 0.9, "table": 0.75}
_BEDS = ("bed", "sofa", "seating")
_TOPS = ("table", "counter")
_FRONTS = ("shelving", "cabinet", "wall", "door", "appliances", "board_panel")

Support = tuple[Bool[np.ndarray, "T V"], tuple[str, ...]]
"""Vertices that touch, and the classes they may touch, most likely first."""


def geometric_features(
    motion: Motion, body: BodyModel, scene_classes: Sequence[str]
) -> tuple[InteractionFeatures, ...]:
    """Feature maps of a motion, the most likely first; they differ in the classes alone.

    `scene_classes` are the classes there are: each support considers only those, and keeps its most
    likely class if there are none. Class scores are void's where there is no contact.
    """
    moving = moving_body(motion, body)
    supports = [
        _kept(support, scene_classes) for support in body_supports(moving) if support[0].any()
    ]
    options = list(product(*(classes for _, classes in supports)))
    # product() varies the last support first; the order of likelihood is the sum of ranks.
    ranks = list(product(*(range(len(classes)) for _, classes in supports)))
    order = sorted(range(len(options)), key=lambda index: (sum(ranks[index]), ranks[index]))
    masks = [mask for mask, _ in supports]
    return tuple(_features(moving, masks, options[index]) for index in order[:MAX_MAPS])


def body_supports(moving: MovingBody) -> list[Support]:
    """All supports of a motion; later ones give way to earlier ones where they share a vertex."""
    floor = float(np.percentile(moving.vertices[..., 2].min(1), 10))
    lying, seated = lying_frames(moving), seated_frames(moving, floor)
    seated &= ~lying
    seat_height = (
        _median_height(moving, seated, _columns(moving, "buttocks", "thigh_backs")) - floor
    )
    bed_height = _median_height(moving, lying, _columns(moving, "back", "buttocks")) - floor
    supports: list[Support] = [(soles_down(moving, floor), ("floor",))]
    on_bed = _BEDS if bed_height > 0.2 else ("floor",)
    flat = underside(moving, lying, _LYING)
    sitting = underside(moving, seated, ("buttocks", "thigh_backs"))
    if flat.any() and on_bed == _BEDS:
        # Who sits down to lie down sits on the bed.
        supports.append((flat | sitting, _BEDS))
    else:
        supports += [(flat, on_bed), (sitting, seats_for(seat_height))]
    hands = [
        _palm_supports(moving, palm_touch(moving, side, floor), floor) for side in ("left", "right")
    ]
    upright = ~(lying | seated)[:, None]
    # Both hands lean on the same thing, so one class is chosen for the two of them.
    supports += [
        ((left | right) & upright, names) for (left, names), (right, _) in zip(*hands, strict=True)
    ]
    return supports


def soles_down(moving: MovingBody, floor: float) -> Bool[np.ndarray, "T V"]:
    """Soles that are low and slow: the lowest layer of each such foot."""
    touching = np.zeros(moving.vertices.shape[:2], dtype=bool)
    for side in ("left", "right"):
        columns = moving.columns[f"{side}_sole"]
        points = moving.vertices[:, columns]
        height = points[..., 2]
        speed = moving.speed(points)
        lowest = height.min(1, keepdims=True)
        layer = (height < lowest + SOLE_THICKNESS_M) & (lowest < floor + SOLE_REACH_M)
        touching[:, columns] = layer & (speed < SOLE_SPEED)
    return touching


def underside(
    moving: MovingBody, frames: Bool[np.ndarray, " T"], regions: tuple[str, ...]
) -> Bool[np.ndarray, "T V"]:
    """Downward-facing vertices of some regions, near the lowest of them, in the frames given.

    A region that hangs clear of the lowest one, such as the calves below raised knees, rests on
    nothing.
    """
    touching = np.zeros(moving.vertices.shape[:2], dtype=bool)
    everything = _columns(moving, *(name for group in _grouped(regions) for name in group))
    bottom = moving.vertices[:, everything, 2].min(1, keepdims=True)
    for group in _grouped(regions):
        columns = _columns(moving, *group)
        height = moving.vertices[:, columns, 2]
        down = moving.normals[:, columns, 2] < -0.5
        lowest = np.where(down, height, np.inf).min(1, keepdims=True)
        layer = down & (height < lowest + SUPPORT_THICKNESS_M) & (lowest < bottom + HANGING_M)
        touching[:, columns] |= layer & frames[:, None]
    return touching


def seated_frames(moving: MovingBody, floor: float) -> Bool[np.ndarray, " T"]:
    """Slow frames with thighs about level, trunk up, and the pelvis behind the feet.

    The last test tells sitting from squatting, where the pelvis stays above the feet.
    """
    joint = _joints(moving)
    thigh = _unit(joint["left_knee"] + joint["right_knee"] - joint["left_hip"] - joint["right_hip"])
    trunk = _unit(joint["neck"] - joint["pelvis"])
    forward = _unit(thigh * np.array([1.0, 1.0, 0.0]))
    feet = (joint["left_ankle"] + joint["right_ankle"]) / 2
    ahead = ((feet - joint["pelvis"]) * forward).sum(-1)
    height = joint["pelvis"][:, 2] - floor
    speed = gaussian_filter1d(moving.speed(joint["pelvis"]), 2.0)
    sits = (thigh[:, 2] > -0.55) & (trunk[:, 2] > 0.5) & (ahead > 0.22)
    return _held(sits & (height > 0.28) & (speed < 0.3), moving.times)


def lying_frames(moving: MovingBody) -> Bool[np.ndarray, " T"]:
    """Slow frames with the trunk about level and its back or a side down."""
    joint = _joints(moving)
    trunk = _unit(joint["neck"] - joint["pelvis"])
    back = moving.normals[:, _columns(moving, "back"), 2].mean(1)
    speed = gaussian_filter1d(moving.speed(joint["pelvis"]), 2.0)
    return _held((np.abs(trunk[:, 2]) < 0.45) & (back < 0.2) & (speed < 0.35), moving.times)


def palm_touch(moving: MovingBody, side: str, floor: float) -> Bool[np.ndarray, "T V"]:
    """The palm of a hand that is held still, stretched out ahead of a standing body."""
    joint = _joints(moving)
    across = joint["left_hip"] - joint["right_hip"]
    ahead = _unit(np.cross(across, np.array([0.0, 0.0, 1.0])))
    hand = joint[f"{side}_wrist"]
    reach = ((hand - joint["pelvis"]) * ahead).sum(-1)
    height = hand[:, 2] - floor
    speed = gaussian_filter1d(moving.speed(hand), 2.0)
    still = _held((reach > 0.28) & (height > 0.45) & (height < 1.75) & (speed < 0.15), moving.times)
    columns = moving.columns[f"{side}_palm"]
    facing = _unit(moving.normals[:, columns].mean(1, keepdims=True))
    flat = (moving.normals[:, columns] * facing).sum(-1) > 0.7
    # Fingers curl: only the foremost layer of a palm can lie on one surface.
    ahead_of_palm = (moving.vertices[:, columns] * facing).sum(-1)
    flat &= ahead_of_palm > ahead_of_palm.max(1, keepdims=True) - PALM_THICKNESS_M
    touching = np.zeros(moving.vertices.shape[:2], dtype=bool)
    touching[:, columns] = flat & still[:, None]
    return touching


def seats_for(height: float) -> tuple[str, ...]:
    """Classes one may sit on at a height (metres), the nearest usual height first."""
    usual = _HIGH_SEATS if height > 0.62 else _SEATS
    if height < 0.2:
        return ("floor",)
    return tuple(sorted(usual, key=lambda name: abs(usual[name] - height)))


_LYING = ("back", "buttocks|thigh_backs", "calves", "head")


def _palm_supports(
    moving: MovingBody, touch: Bool[np.ndarray, "T V"], floor: float
) -> list[Support]:
    """A palm facing down at table height leans on a top, any other touches a front or a shelf."""
    count = np.maximum(touch.sum(1), 1)
    facing = (moving.normals[..., 2] * touch).sum(1) / count
    height = (moving.vertices[..., 2] * touch).sum(1) / count - floor
    leans = (facing < -0.6) & (height < TOP_HEIGHT_M)
    return [(touch & leans[:, None], _TOPS), (touch & ~leans[:, None], _FRONTS)]


def _kept(support: Support, scene_classes: Sequence[str]) -> Support:
    mask, classes = support
    present = tuple(name for name in classes if name in scene_classes)[:4]
    return mask, present or classes[:1]


def _features(
    moving: MovingBody, masks: list[Bool[np.ndarray, "T V"]], classes: tuple[str, ...]
) -> InteractionFeatures:
    label = np.zeros(moving.vertices.shape[:2], dtype=np.int64)
    for mask, name in zip(masks, classes, strict=True):
        label[mask & (label == 0)] = MPCAT40.index(name)
    semantics = np.zeros((*label.shape, N_CLASSES), dtype=np.float32)
    np.put_along_axis(semantics, label[..., None], CERTAIN, axis=-1)
    contact = (label > 0).astype(np.float32)
    return InteractionFeatures(contact, semantics, moving.vertex_ids, "geometric")


def _held(frames: Bool[np.ndarray, " T"], times: Float[np.ndarray, " T"]) -> Bool[np.ndarray, " T"]:
    """Close gaps of a few frames, then drop spans shorter than `HOLD_S`."""
    length = max(2, round(HOLD_S / float(np.median(np.diff(times)))))
    padded = np.pad(frames, length, mode="edge")
    closed = binary_closing(padded, np.ones(3, dtype=bool))
    held: Bool[np.ndarray, " T"] = binary_opening(closed, np.ones(length, dtype=bool))[
        length:-length
    ]
    return held


def _median_height(
    moving: MovingBody, frames: Bool[np.ndarray, " T"], columns: np.ndarray
) -> float:
    if not frames.any():
        return 0.0
    return float(np.median(moving.vertices[frames][:, columns, 2].min(1)))


def _columns(moving: MovingBody, *regions: str) -> np.ndarray:
    return np.unique(np.concatenate([moving.columns[name] for name in regions]))


def _grouped(regions: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Regions joined by a bar share one lowest point, the others have each their own."""
    if any("|" in name for name in regions):
        return [tuple(name.split("|")) for name in regions]
    return [regions]


def _joints(moving: MovingBody) -> dict[str, Float[np.ndarray, "T 3"]]:
    return {name: moving.joints[:, index] for index, name in enumerate(JOINT_NAMES)}


def _unit(vector: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N 3"]:
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    unit: Float[np.ndarray, "*N 3"] = vector / np.maximum(length, 1e-9)
    return unit

"""Reader of Biovision hierarchies (`.bvh`): y up, facing +z in the rest pose, any common unit."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from experiments.motion.capture import LEG_RANGE_M, Capture, check_rate, fill_unmapped
from experiments.motion.rotations import UPRIGHT, slerp, to_axis_angle, to_matrix, unit
from renderer.files import InputError

UNITS_M = {"metre": 1.0, "centimetre": 0.01, "inch": 0.0254, "CMU unit": 0.0254 / 0.45, "mm": 0.001}
_CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")
# SMPL-X joint: names it goes by, in order of preference.
_NAMES: dict[str, tuple[str, ...]] = {
    "pelvis": ("Hips", "hip", "root"),
    "spine1": ("lowerback", "LowerBack", "Spine", "abdomen"),
    "spine2": ("Chest", "Spine1", "Spine"),
    "spine3": ("Chest2", "Spine2", "Spine1", "Chest"),
    "neck": ("lowerneck", "Neck"),
    "head": ("Head", "Neck1"),
}
_SIDE_NAMES: dict[str, tuple[str, ...]] = {
    "hip": ("UpLeg", "Hip"),
    "knee": ("Leg", "Knee"),
    "ankle": ("Foot", "Ankle"),
    "foot": ("ToeBase", "Toe"),
    "collar": ("Collar", "Shoulder"),
    "shoulder": ("Arm", "Shoulder"),
    "elbow": ("ForeArm", "Elbow"),
    "wrist": ("Hand", "Wrist"),
}
_NEXT = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist"}


@dataclass
class _Node:
    name: str
    parent: int
    offset: Float[np.ndarray, "3"]
    channels: list[str] = field(default_factory=list)


def read_bvh(path: Path) -> Capture:
    """Read a motion. Raises `InputError` naming the line at fault.

    BVH states no unit: it is inferred from the leg length, whose plausible ranges do not overlap
    between metres, centimetres, millimetres, inches and CMU's unit. A first frame in the rest pose
    (added by some exporters) is dropped.
    """
    lines = _lines(path)
    nodes = _hierarchy(path, lines)
    values, fps = _frames(path, lines, sum(len(node.channels) for node in nodes))
    names = _joint_names(path, nodes)
    _check_axes(path, nodes, names)
    leg_length, scale = _metres_per_unit(path, nodes, names)
    if _starts_in_rest_pose(nodes, values):
        values = values[1:]
    world, hip_centre = _chain(nodes, values, names)
    return Capture(
        rotations=fill_unmapped({joint: UPRIGHT @ world[joint] for joint in world}),
        hip_centre=hip_centre * scale @ UPRIGHT.T,
        times=np.arange(len(values)) / fps,
        rest_directions={
            f"{side}_{part}": unit(nodes[names[f"{side}_{child}"]].offset)
            for side in ("left", "right")
            for part, child in _NEXT.items()
        },
        leg_length=leg_length,
        label=path.stem.replace("_", " "),
        source=f"BVH {path.name}",
    )


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    try:
        text = path.read_text()
    except FileNotFoundError:
        raise InputError(path, "file", "missing", "an existing .bvh motion") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, "content", str(error), "a text file") from None
    numbered = enumerate(text.splitlines(), start=1)
    return iter([(number, line.split()) for number, line in numbered if line.strip()])


def _hierarchy(path: Path, lines: Iterator[tuple[int, list[str]]]) -> list[_Node]:
    """Nodes up to the line MOTION, parents first; end sites are read and left out."""
    nodes: list[_Node] = []
    open_nodes: list[int] = []
    for number, words in lines:
        match words:
            case ["MOTION"]:
                return nodes
            case ["HIERARCHY"] | ["{"]:
                pass
            case ["ROOT" | "JOINT", name]:
                nodes.append(_Node(name, open_nodes[-1] if open_nodes else -1, np.zeros(3)))
                open_nodes.append(len(nodes) - 1)
            case ["End", _]:
                open_nodes.append(-1)
            case ["OFFSET", *numbers] if open_nodes:
                offset = _numbers(path, number, numbers, 3)
                if open_nodes[-1] >= 0:
                    nodes[open_nodes[-1]].offset = offset
            case ["CHANNELS", _, *channels] if open_nodes and set(channels) <= set(_CHANNELS):
                nodes[open_nodes[-1]].channels = channels
            case ["}"] if open_nodes:
                open_nodes.pop()
            case _:
                raise InputError(path, f"line {number}", " ".join(words), "BVH hierarchy")
    raise InputError(path, "MOTION", "nothing", "this section (truncated file?)")


def _frames(
    path: Path, lines: Iterator[tuple[int, list[str]]], width: int
) -> tuple[Float[np.ndarray, "T D"], float]:
    number, words = next(lines, (0, []))
    if len(words) != 2 or words[0] != "Frames:" or not words[1].isdigit():
        raise InputError(path, f"line {number}", " ".join(words), "Frames: <count>")
    count = int(words[1])
    number, words = next(lines, (0, []))
    if words[:2] != ["Frame", "Time:"]:
        raise InputError(path, f"line {number}", " ".join(words), "Frame Time: <seconds>")
    (step,) = _numbers(path, number, words[2:], 1)
    check_rate(path, f"line {number} Frame Time", 1.0 / step if step > 0 else 0.0)
    rows = [_numbers(path, number, words, width) for number, words in lines]
    if len(rows) != count or count < 2:
        raise InputError(path, "Frames", f"{len(rows)} lines", f"{count} lines, two or more")
    # 0.0083333 stands for 120 Hz: exporters round the step, not the rate.
    rate = round(1.0 / step) if abs(1.0 / step - round(1.0 / step)) < 0.02 else 1.0 / step
    return np.stack(rows), float(rate)


def _numbers(path: Path, number: int, words: list[str], count: int) -> Float[np.ndarray, " N"]:
    if len(words) != count:
        raise InputError(path, f"line {number}", f"{len(words)} values", f"{count} values")
    values = np.full(count, np.nan)
    for index, word in enumerate(words):
        with contextlib.suppress(ValueError):
            values[index] = float(word)
        if not np.isfinite(values[index]):
            raise InputError(path, f"line {number}, value {index + 1}", word, "a finite number")
    return values


def _joint_names(path: Path, nodes: list[_Node]) -> dict[str, int]:
    """Node index of every SMPL-X joint the file has; the limbs must all be there."""
    index = {node.name: i for i, node in enumerate(nodes)}
    wanted = dict(_NAMES)
    for side in ("Left", "Right"):
        for part, names in _SIDE_NAMES.items():
            wanted[f"{side.lower()}_{part}"] = tuple(side + name for name in names)
    found = {
        joint: index[next(name for name in names if name in index)]
        for joint, names in wanted.items()
        if any(name in index for name in names)
    }
    optional = {"spine1", "spine2", "left_foot", "right_foot", "left_collar", "right_collar"}
    for joint, names in wanted.items():
        if joint not in found and joint not in optional:
            raise InputError(path, "joints", sorted(index)[:6], f"{joint} as {' or '.join(names)}")
    return found


def _check_axes(path: Path, nodes: list[_Node], names: dict[str, int]) -> None:
    shank = unit(nodes[names["left_ankle"]].offset)
    if shank[1] > -0.7:
        raise InputError(path, "rest pose", shank.round(2).tolist(), "legs pointing to -y (y up)")
    side = nodes[names["left_hip"]].offset[0] - nodes[names["right_hip"]].offset[0]
    if side <= 0:
        raise InputError(path, "rest pose", f"hips {side:.3g} apart in x", "left at +x (facing +z)")


def _metres_per_unit(path: Path, nodes: list[_Node], names: dict[str, int]) -> tuple[float, float]:
    parts = (nodes[names["left_knee"]].offset, nodes[names["left_ankle"]].offset)
    length = float(sum(np.linalg.norm(part) for part in parts))
    low, high = LEG_RANGE_M
    # The narrow range 0.6 to 1.1 m of real adults keeps the units apart.
    for scale in UNITS_M.values():
        if max(low, 0.6) <= length * scale <= min(high, 1.1):
            return length * scale, scale
    wanted = f"an adult's leg in one of the units {', '.join(UNITS_M)}"
    raise InputError(path, "leg length (OFFSET)", length, wanted)


def _starts_in_rest_pose(nodes: list[_Node], values: Float[np.ndarray, "T D"]) -> bool:
    channels = [channel for node in nodes for channel in node.channels]
    turning = [channel.endswith("rotation") for channel in channels]
    first, second = np.abs(values[0, turning]), np.abs(values[1, turning])
    return len(values) > 2 and bool(first.max() < 1e-3 < second.max())


def _chain(
    nodes: list[_Node], values: Float[np.ndarray, "T D"], names: dict[str, int]
) -> tuple[dict[str, Float[np.ndarray, "T 3 3"]], Float[np.ndarray, "T 3"]]:
    """World rotation by SMPL-X joint and hip centre, in the file's axes and units."""
    rotations: list[Float[np.ndarray, "T 3 3"]] = []
    positions: list[Float[np.ndarray, "T 3"]] = []
    column = 0
    for node in nodes:
        block = values[:, column : column + len(node.channels)]
        column += len(node.channels)
        local, shift = _local(node, block)
        if node.parent >= 0:
            shift = positions[node.parent] + (rotations[node.parent] @ shift[..., None])[..., 0]
            local = rotations[node.parent] @ local
        rotations.append(local)
        positions.append(shift)
    world = {joint: rotations[index] for joint, index in names.items()}
    for side in ("left", "right"):
        arm, hand = world[f"{side}_elbow"], world[f"{side}_wrist"]
        world[f"{side}_elbow"] = _half_pronated(arm, hand, nodes[names[f"{side}_wrist"]].offset)
    return world, (positions[names["left_hip"]] + positions[names["right_hip"]]) / 2


def _local(
    node: _Node, block: Float[np.ndarray, "T D"]
) -> tuple[Float[np.ndarray, "T 3 3"], Float[np.ndarray, "T 3"]]:
    """Rotation relative to the parent and shift from it; channels apply in the order listed."""
    rotation = np.tile(np.eye(3), (len(block), 1, 1))
    shift = np.tile(node.offset, (len(block), 1))
    for channel, numbers in zip(node.channels, block.T, strict=True):
        axis = "XYZ".index(channel[0])
        if channel.endswith("position"):
            shift[:, axis] = numbers
        else:
            turn = np.zeros((len(block), 3))
            turn[:, axis] = numbers
            rotation = rotation @ np.asarray(Rotation.from_rotvec(turn, degrees=True).as_matrix())
    return rotation, shift


def _half_pronated(
    arm: Float[np.ndarray, "T 3 3"],
    hand: Float[np.ndarray, "T 3 3"],
    bone: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "T 3 3"]:
    """Give the forearm half of the hand's twist about it: all of it at the wrist would wring the skin."""
    relative = to_axis_angle(np.swapaxes(arm, -1, -2) @ hand)
    direction = unit(bone)
    twist = np.outer(relative @ direction, direction)
    share = np.full(len(arm), 0.5)
    return np.asarray(arm @ to_matrix(slerp(np.zeros_like(twist), twist, share)))

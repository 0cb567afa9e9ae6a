"""Reader of Acclaim motions (`.amc`) on their skeleton (`.asf`), as CMU's database gives them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from experiments.motion.asf import AcclaimSkeleton, read_asf
from experiments.motion.capture import Capture, check_leg_length, check_rate, fill_unmapped
from experiments.motion.rotations import UPRIGHT, slerp, to_axis_angle, to_matrix, unit
from renderer.files import InputError

CMU_RATE_HZ = 120.0
_JOINTS = {
    "pelvis": "root", "spine1": "lowerback", "spine2": "upperback", "spine3": "thorax",
    "neck": "lowerneck", "head": "head",
}  # fmt: skip
_SIDE_JOINTS = {
    "hip": "femur", "knee": "tibia", "ankle": "foot", "foot": "toes", "collar": "clavicle",
    "shoulder": "humerus", "elbow": "radius", "wrist": "hand",
}  # fmt: skip
_LIMB_PARTS = ("hip", "knee", "shoulder", "elbow")
_CHANNELS = {"x": 0, "y": 1, "z": 2}


def read_amc(path: Path, skeleton: Path | None = None, fps: float = CMU_RATE_HZ) -> Capture:
    """Read a motion. The format states no frame rate; CMU recorded at 120 Hz.

    The skeleton is the `.asf` named, or the one beside the motion (`02_01.amc`: `02.asf`).
    Raises `InputError` naming the line at fault.
    """
    check_rate(path, "fps", fps)
    asf = skeleton if skeleton is not None else _skeleton_beside(path)
    bones = read_asf(asf)
    names = _joint_names(asf, bones)
    frames = _read_frames(path, bones)
    root, rotations, hip_centre = _chain(bones, frames, names)
    leg_length = sum(float(np.linalg.norm(bones.bones[n].offset)) for n in ("lfemur", "ltibia"))
    check_leg_length(asf, "length of lfemur and ltibia", leg_length)
    return Capture(
        rotations=fill_unmapped(rotations),
        hip_centre=(root + hip_centre) @ UPRIGHT.T,
        times=np.arange(len(root)) / fps,
        rest_directions={
            joint: unit(bones.bones[name].offset)
            for joint, name in names.items()
            if joint.endswith(_LIMB_PARTS)
        },
        leg_length=leg_length,
        label=path.stem.replace("_", " "),
        source=f"CMU motion capture {path.name}",
    )


def _skeleton_beside(path: Path) -> Path:
    named = path.with_name(path.stem.split("_")[0] + ".asf")
    found = [named] if named.is_file() else sorted(path.parent.glob("*.asf"))
    if len(found) != 1:
        raise InputError(path, "skeleton", named.name, "this .asf file beside the motion")
    return found[0]


def _joint_names(asf: Path, skeleton: AcclaimSkeleton) -> dict[str, str]:
    names = dict(_JOINTS)
    for side in ("left", "right"):
        names |= {f"{side}_{part}": side[0] + bone for part, bone in _SIDE_JOINTS.items()}
    for name in names.values():
        if name != "root" and name not in skeleton.bones:
            raise InputError(asf, "bone", "nothing", f"a bone called {name} (CMU's names)")
    return names


def _read_frames(path: Path, skeleton: AcclaimSkeleton) -> dict[str, Float[np.ndarray, "T D"]]:
    """Values of every moving bone over time, degrees; the root in file units and degrees."""
    try:
        lines = path.read_text().splitlines()
    except FileNotFoundError:
        raise InputError(path, "file", "missing", "an existing .amc motion") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, "content", str(error), "a text file") from None
    widths = {"root": 6} | {b.name: len(b.dofs) for b in skeleton.bones.values() if b.dofs}
    frames: list[dict[str, list[float]]] = []
    for number, line in enumerate(lines, start=1):
        words = line.split("#")[0].split()
        if not words or words[0].startswith(":"):
            continue
        if len(words) == 1 and words[0].isdigit():
            _check_whole(path, number, frames, widths)
            if int(words[0]) != len(frames) + 1:
                raise InputError(path, f"line {number}", words[0], f"frame {len(frames) + 1}")
            frames.append({})
        else:
            _add_bone(path, number, words, frames, widths)
    _check_whole(path, len(lines), frames, widths)
    if len(frames) < 2:
        raise InputError(path, "frames", len(frames), "two or more")
    return {name: np.array([frame[name] for frame in frames]) for name in widths}


def _add_bone(
    path: Path,
    number: int,
    words: list[str],
    frames: list[dict[str, list[float]]],
    widths: dict[str, int],
) -> None:
    name, values = words[0], words[1:]
    if not frames:
        raise InputError(path, f"line {number}", name, "a frame number first")
    if name not in widths:
        raise InputError(path, f"line {number}", name, "a moving bone of the skeleton")
    if len(values) != widths[name]:
        wanted = f"{widths[name]} values as the skeleton's degrees of freedom"
        raise InputError(path, f"line {number} {name}", len(values), wanted)
    frames[-1][name] = [_finite(path, number, name, value) for value in values]


def _finite(path: Path, number: int, name: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(path, f"line {number} {name}", word, "a finite number")
    return value


def _check_whole(
    path: Path, number: int, frames: list[dict[str, list[float]]], widths: dict[str, int]
) -> None:
    missing = sorted(widths.keys() - frames[-1].keys()) if frames else []
    if missing:
        field = f"line {number}, frame {len(frames)}"
        raise InputError(path, field, "nothing", f"values of {missing[0]} (truncated file?)")


def _chain(
    skeleton: AcclaimSkeleton,
    frames: dict[str, Float[np.ndarray, "T D"]],
    names: dict[str, str],
) -> tuple[
    Float[np.ndarray, "T 3"], dict[str, Float[np.ndarray, "T 3 3"]], Float[np.ndarray, "T 3"]
]:
    """Root position, world rotations by SMPL-X joint (z up), hip centre relative to the root (y up)."""
    order = skeleton.root_order
    columns = [order.index(name) for name in ("tx", "ty", "tz")]
    root = frames["root"][:, columns] * skeleton.metres_per_unit
    turns = [(name, frames["root"][:, order.index(name)]) for name in order if name[0] == "r"]
    world = {"root": _euler(turns)}
    for bone in skeleton.bones.values():
        world[bone.name] = world[bone.parent]
        if bone.dofs:
            turns = list(zip(bone.dofs, frames[bone.name].T, strict=True))
            world[bone.name] = world[bone.parent] @ (bone.axes @ _euler(turns) @ bone.axes.T)
    mapped = {joint: world[name] for joint, name in names.items()}
    for side in ("left", "right"):
        mapped[f"{side}_elbow"] = _half_pronated(
            world[f"{side[0]}radius"], world[f"{side[0]}wrist"]
        )
    hips = [world[f"{s}hipjoint"] @ skeleton.bones[f"{s}hipjoint"].offset for s in "lr"]
    return root, {joint: UPRIGHT @ mapped[joint] for joint in mapped}, (hips[0] + hips[1]) / 2


def _euler(turns: list[tuple[str, Float[np.ndarray, " T"]]]) -> Float[np.ndarray, "T 3 3"]:
    """Rotations about fixed axes in the order listed: the first one is applied first."""
    matrices = np.eye(3)[None]
    for name, degrees in turns:
        angles = np.zeros((len(degrees), 3))
        angles[:, _CHANNELS[name[1]]] = degrees
        matrices = np.asarray(Rotation.from_rotvec(angles, degrees=True).as_matrix()) @ matrices
    return matrices


def _half_pronated(
    forearm: Float[np.ndarray, "T 3 3"], wrist: Float[np.ndarray, "T 3 3"]
) -> Float[np.ndarray, "T 3 3"]:
    """Share pronation between elbow and wrist: all of it at the wrist would wring the skin."""
    share = np.full(len(forearm), 0.5)
    return to_matrix(slerp(to_axis_angle(forearm), to_axis_angle(wrist), share))

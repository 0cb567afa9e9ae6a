"""Small motion files of every format, written on the spot, and the male figure."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.motion.figure import Figure, figure_of

BONES = (
    # name, parent, direction, length in file units of 0.0564 m, degrees of freedom
    ("lhipjoint", "root", (0.65, -0.71, 0.25), 2.5, ""),
    ("lfemur", "lhipjoint", (0.34202, -0.939693, 0), 7.5, "rx ry rz"),
    ("ltibia", "lfemur", (0.34202, -0.939693, 0), 7.2, "rx"),
    ("lfoot", "ltibia", (0, -0.26, 0.966), 2.2, "rx rz"),
    ("ltoes", "lfoot", (0, 0, 1), 1.1, "rx"),
    ("rhipjoint", "root", (-0.65, -0.71, 0.25), 2.5, ""),
    ("rfemur", "rhipjoint", (-0.34202, -0.939693, 0), 7.5, "rx ry rz"),
    ("rtibia", "rfemur", (-0.34202, -0.939693, 0), 7.2, "rx"),
    ("rfoot", "rtibia", (0, -0.26, 0.966), 2.2, "rx rz"),
    ("rtoes", "rfoot", (0, 0, 1), 1.1, "rx"),
    ("lowerback", "root", (0, 1, 0), 2, "rx ry rz"),
    ("upperback", "lowerback", (0, 1, 0), 2, "rx ry rz"),
    ("thorax", "upperback", (0, 1, 0), 2, "rx ry rz"),
    ("lowerneck", "thorax", (0, 1, 0), 1.5, "rx ry rz"),
    ("upperneck", "lowerneck", (0, 1, 0), 1.5, "rx ry rz"),
    ("head", "upperneck", (0, 1, 0), 1.6, "rx ry rz"),
    ("lclavicle", "thorax", (0.97, 0.25, 0), 3.6, "ry rz"),
    ("lhumerus", "lclavicle", (1, 0, 0), 4.9, "rx ry rz"),
    ("lradius", "lhumerus", (1, 0, 0), 3.4, "rx"),
    ("lwrist", "lradius", (1, 0, 0), 1.7, "ry"),
    ("lhand", "lwrist", (1, 0, 0), 0.7, "rx rz"),
    ("rclavicle", "thorax", (-0.97, 0.25, 0), 3.6, "ry rz"),
    ("rhumerus", "rclavicle", (-1, 0, 0), 4.9, "rx ry rz"),
    ("rradius", "rhumerus", (-1, 0, 0), 3.4, "rx"),
    ("rwrist", "rradius", (-1, 0, 0), 1.7, "ry"),
    ("rhand", "rwrist", (-1, 0, 0), 0.7, "rx rz"),
)


@pytest.fixture(scope="session")
def figure() -> Figure:
    return figure_of("male_slim")


@pytest.fixture
def amc_file(tmp_path: Path) -> Path:
    """Three frames: rest pose, left knee bent by 30 degrees, turned by 90 degrees about the vertical."""
    bones = "".join(
        f"begin\nid {i}\nname {n}\ndirection {d[0]} {d[1]} {d[2]}\nlength {length}\naxis 0 0 0 XYZ\n"
        + (f"dof {dofs}\n" if dofs else "")
        + "end\n"
        for i, (n, _, d, length, dofs) in enumerate(BONES, start=1)
    )
    links = "".join(f"{parent} {name}\n" for name, parent, *_ in BONES)
    (tmp_path / "07.asf").write_text(
        ":version 1.10\n:units\nmass 1.0\nlength 0.45\nangle deg\n:root\norder TX TY TZ RX RY RZ\n"
        f"axis XYZ\nposition 0 0 0\norientation 0 0 0\n:bonedata\n{bones}"
        f":hierarchy\nbegin\n{links}end\n"
    )
    path = tmp_path / "07_01.amc"
    path.write_text(
        "#!OML\n:FULLY-SPECIFIED\n:DEGREES\n"
        + "".join(f"{i + 1}\n{_amc_frame(knee, yaw)}" for i, (knee, yaw) in enumerate(_FRAMES))
    )
    return path


_FRAMES = ((0.0, 0.0), (30.0, 0.0), (0.0, 90.0))


def _amc_frame(knee: float, yaw: float) -> str:
    lines = [f"root 0 17 0 0 {yaw} 0"]
    for name, _, _, _, dofs in BONES:
        if dofs:
            values = [knee if name == "ltibia" else 0.0] * len(dofs.split())
            lines.append(f"{name} {' '.join(map(str, values))}")
    return "\n".join(lines) + "\n"


@pytest.fixture
def bvh_file(tmp_path: Path) -> Path:
    """A T-posed person in centimetres, 100 Hz: rest frame, then the left elbow bent by 45 degrees."""
    tree: dict[str, Any] = {
        "LeftUpLeg": ((9, 0, 0), {"LeftLeg": ((0, -42, 0), {"LeftFoot": ((0, -41, 0), {})})}),
        "RightUpLeg": ((-9, 0, 0), {"RightLeg": ((0, -42, 0), {"RightFoot": ((0, -41, 0), {})})}),
        "Spine": ((0, 12, 0), {"Spine1": ((0, 25, 0), {
            "Neck": ((0, 20, 0), {"Head": ((0, 10, 0), {})}),
            "LeftArm": ((18, 15, 0), {"LeftForeArm": ((28, 0, 0), {"LeftHand": ((27, 0, 0), {})})}),
            "RightArm": ((-18, 15, 0), {"RightForeArm": ((-28, 0, 0), {"RightHand": ((-27, 0, 0), {})})}),
        })}),
    }  # fmt: skip
    names: list[str] = ["Hips"]
    text = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition "
    text += "Zrotation Yrotation Xrotation\n" + _bvh_nodes(tree, names) + "}\n"
    frames = []
    for elbow in (0.0, 45.0, 45.0, 45.0):
        row = [0.0, 90.0, 0.0] + [0.0] * 3 * len(names)
        row[3 + 3 * names.index("LeftForeArm") + 1] = -elbow
        frames.append(" ".join(map(str, row)))
    text += f"MOTION\nFrames: {len(frames)}\nFrame Time: 0.01\n" + "\n".join(frames) + "\n"
    path = tmp_path / "person.bvh"
    path.write_text(text)
    return path


def _bvh_nodes(tree: dict[str, Any], names: list[str]) -> str:
    text = ""
    for name, (offset, children) in tree.items():
        names.append(name)
        inside = _bvh_nodes(children, names) or "End Site\n{\nOFFSET 0 5 0\n}\n"
        text += f"JOINT {name}\n{{\nOFFSET {offset[0]} {offset[1]} {offset[2]}\n"
        text += f"CHANNELS 3 Zrotation Yrotation Xrotation\n{inside}}}\n"
    return text


@pytest.fixture
def amass_file(tmp_path: Path) -> Callable[..., Path]:
    """Writer of AMASS archives: a person bowing at the hips; fields may be replaced or dropped (None)."""

    def write(**changes: Any) -> Path:
        poses = np.zeros((40, 156))
        poses[:, 0] = np.pi / 2 + np.linspace(0, 0.3, 40)
        record: dict[str, Any] = {
            "poses": poses,
            "trans": np.tile([1.0, 2.0, 0.9], (40, 1)),
            "betas": np.zeros(16),
            "gender": "male",
            "mocap_framerate": 60.0,
        }
        record = {k: v for k, v in (record | changes).items() if v is not None}
        path = tmp_path / "bow_poses.npz"
        np.savez(path, **record)
        return path

    return write


@pytest.fixture
def deepmimic_file(tmp_path: Path) -> Callable[[list[Any]], Path]:
    """Writer of DeepMimic clips from a list of frames."""

    def write(frames: list[Any]) -> Path:
        path = tmp_path / "clip.txt"
        path.write_text(json.dumps({"Loop": "none", "Frames": frames}))
        return path

    return write


def resting_frame(dt: float = 0.05, knee: float = 0.0) -> list[float]:
    """One DeepMimic frame of a person standing with hanging arms."""
    unit, still = [1.0, 0.0, 0.0, 0.0], [0.0]
    return [dt, 0.0, 0.9, 0.0, *unit, *unit, *unit, *unit, knee, *unit, *unit, *still, *unit, *still,
            *unit, *unit, *still]  # fmt: skip


@pytest.fixture
def rest_frame() -> Callable[..., list[float]]:
    return resting_frame

"""DeepMimic clips and where the installed package keeps them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.motion.capture import INDEX
from experiments.motion.deepmimic import pybullet_clip, read_deepmimic
from experiments.motion.rotations import UPRIGHT, about
from renderer.files import InputError

Writer = Callable[[list[Any]], Path]
Frame = Callable[..., list[float]]


def test_unit_quaternions_are_the_rest_pose_facing_ahead(
    deepmimic_file: Writer, rest_frame: Frame
) -> None:
    capture = read_deepmimic(deepmimic_file([rest_frame(), rest_frame(knee=-0.5), rest_frame(0.0)]))
    np.testing.assert_allclose(capture.rotations[0], np.tile(UPRIGHT, (22, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(capture.times, [0.0, 0.05, 0.1])
    # A negative knee angle bends the shank backwards, which is a positive turn about left.
    bent = UPRIGHT @ about("x", float(np.degrees(0.5)))
    np.testing.assert_allclose(capture.rotations[1, INDEX["right_knee"]], bent, atol=1e-12)


def test_the_chest_joint_is_spread_over_three_spine_joints(
    deepmimic_file: Writer, rest_frame: Frame
) -> None:
    frame = rest_frame()
    frame[8:12] = [np.cos(0.15), 0.0, 0.0, np.sin(0.15)]
    rotations = read_deepmimic(deepmimic_file([frame, frame])).rotations[0]
    steps = [rotations[INDEX[low]].T @ rotations[INDEX[high]] for low, high in
             (("pelvis", "spine1"), ("spine1", "spine2"), ("spine2", "spine3"))]  # fmt: skip
    np.testing.assert_allclose(steps[0], steps[1], atol=1e-12)
    np.testing.assert_allclose(steps[1], steps[2], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda f: [f[0][:40], f[1]], "Frames[0]: got 40, wanted 44 numbers"),
        (lambda f: [f[0], [*f[1][:43], "a"]], "Frames[1][43]: got 'a', wanted a finite number"),
        (lambda f: [f[0], [*f[1][:43], float("nan")]], "Frames[1][43]: got nan"),
        (lambda f: [[0.0, *f[0][1:]], f[1]], "Frames[0][0]: got 0.0, wanted a frame rate"),
        (lambda f: [[*f[0][:4], 2.0, *f[0][5:]], f[1]], "wanted a unit quaternion"),
        (lambda f: f[:1], "wanted a list of two or more frames"),
    ],
)
def test_a_damaged_clip_is_refused(
    deepmimic_file: Writer, rest_frame: Frame, change: Callable[[list[Any]], Any], complaint: str
) -> None:
    path = deepmimic_file(change([rest_frame(), rest_frame()]))
    with pytest.raises(InputError) as caught:
        read_deepmimic(path)
    assert str(path) in str(caught.value)
    assert complaint in str(caught.value)


def test_an_unknown_clip_is_refused() -> None:
    with pytest.raises(InputError, match="got 'humanoid3d_moonwalk'"):
        pybullet_clip("humanoid3d_moonwalk")


def test_finding_the_clips_does_not_load_the_physics_engine() -> None:
    code = "import sys; from experiments.motion.deepmimic import pybullet_clip as p; "
    code += "p('humanoid3d_walk'); sys.exit('pybullet' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

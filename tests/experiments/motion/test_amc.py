"""Acclaim skeletons and motions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from experiments.motion.amc import read_amc
from experiments.motion.capture import INDEX
from experiments.motion.rotations import UPRIGHT, about
from renderer.files import InputError


def test_zero_angles_are_the_rest_pose(amc_file: Path) -> None:
    capture = read_amc(amc_file)
    np.testing.assert_allclose(capture.rotations[0], np.tile(UPRIGHT, (22, 1, 1)), atol=1e-12)
    assert capture.leg_length == pytest.approx((7.5 + 7.2) * 0.0254 / 0.45)
    np.testing.assert_allclose(np.diff(capture.times), 1 / 120)


def test_a_bent_knee_turns_shank_and_foot_but_not_the_thigh(amc_file: Path) -> None:
    frame = read_amc(amc_file).rotations[1]
    np.testing.assert_allclose(frame[INDEX["left_hip"]], UPRIGHT, atol=1e-12)
    for name in ("left_knee", "left_ankle", "left_foot"):
        np.testing.assert_allclose(frame[INDEX[name]], UPRIGHT @ about("x", 30.0), atol=1e-12)


def test_turning_the_root_turns_the_world_about_the_vertical(amc_file: Path) -> None:
    capture = read_amc(amc_file)
    np.testing.assert_allclose(capture.rotations[2, 0], about("z", 90.0) @ UPRIGHT, atol=1e-12)
    np.testing.assert_allclose(capture.hip_centre[0, 2], (17 - 0.71 * 2.5) * 0.0254 / 0.45)
    turned = about("z", 90.0) @ capture.hip_centre[0]
    np.testing.assert_allclose(capture.hip_centre[2], turned, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda t: t.replace("head 0.0 0.0 0.0", "head 0.0 zero 0.0", 1), "line 19 head: got 'zero'"),
        (lambda t: t.replace("root 0 17 0", "root 0 nan 0", 1), "root: got 'nan'"),
        (lambda t: t.replace("ltibia", "lshin", 1), "got 'lshin', wanted a moving bone"),
        (lambda t: t.replace("ltibia 30.0", "ltibia 30.0 1", 1), "ltibia: got 2, wanted 1 values"),
        (lambda t: t[: t.rindex("rwrist")], "frame 3: got 'nothing', wanted values of"),
        (lambda t: t.replace("\n2\n", "\n5\n", 1), "got '5', wanted frame 2"),
        (lambda t: t.split("\n2\n")[0] + "\n", "frames: got 1, wanted two or more"),
    ],
)  # fmt: skip
def test_a_damaged_motion_is_refused_by_line(
    amc_file: Path, change: Callable[[str], str], complaint: str
) -> None:
    amc_file.write_text(change(amc_file.read_text()))
    with pytest.raises(InputError) as caught:
        read_amc(amc_file)
    assert str(amc_file) in str(caught.value)
    assert complaint in str(caught.value)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda t: t.replace("length 0.45", "length 45"), "are the units right?"),
        (lambda t: t.replace("length 0.45", "length none"), "got 'none'"),
        (lambda t: t[: t.index(":hierarchy")], "wanted a section :hierarchy"),
        (lambda t: t.replace("rhand", "rpaw"), "called rhand"),
        (lambda t: t.replace("dof rx rz", "dof rx rq", 1), "got 'rq', wanted rx, ry or rz"),
        (lambda t: t.replace("lowerback upperback", "lowerback tail"), "got 'tail', wanted a bone"),
    ],
)  # fmt: skip
def test_a_damaged_skeleton_is_refused(
    amc_file: Path, change: Callable[[str], str], complaint: str
) -> None:
    skeleton = amc_file.with_name("07.asf")
    skeleton.write_text(change(skeleton.read_text()))
    with pytest.raises(InputError, match=r"07\.asf") as caught:
        read_amc(amc_file)
    assert complaint in str(caught.value)


def test_a_missing_skeleton_is_named(amc_file: Path) -> None:
    amc_file.with_name("07.asf").unlink()
    with pytest.raises(InputError, match=r"wanted this \.asf file beside the motion"):
        read_amc(amc_file)

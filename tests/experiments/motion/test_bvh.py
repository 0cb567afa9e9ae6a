"""Biovision hierarchies."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from experiments.motion.bvh import read_bvh
from experiments.motion.capture import INDEX
from experiments.motion.rotations import UPRIGHT, about
from renderer.files import InputError


def test_units_are_inferred_and_the_added_rest_frame_is_dropped(bvh_file: Path) -> None:
    capture = read_bvh(bvh_file)
    assert len(capture.times) == 3
    assert capture.leg_length == pytest.approx(0.83)
    np.testing.assert_allclose(capture.hip_centre, np.tile([0.0, 0.0, 0.9], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(np.diff(capture.times), 0.01)


def test_a_bent_elbow_turns_forearm_and_hand_forwards(bvh_file: Path) -> None:
    frame = read_bvh(bvh_file).rotations[0]
    np.testing.assert_allclose(frame[INDEX["left_shoulder"]], UPRIGHT, atol=1e-12)
    for name in ("left_elbow", "left_wrist"):
        np.testing.assert_allclose(frame[INDEX[name]], UPRIGHT @ about("y", -45.0), atol=1e-12)


def test_joints_the_file_lacks_move_with_their_parents(bvh_file: Path) -> None:
    rotations = read_bvh(bvh_file).rotations
    np.testing.assert_array_equal(
        rotations[:, INDEX["left_foot"]], rotations[:, INDEX["left_ankle"]]
    )


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda t: t.replace("Frame Time: 0.01", "Frame Time: 0"), "Time: got 0.0, wanted a frame rate"),
        (lambda t: t.replace("Frames: 4", "Frames: 9"), "got '4 lines', wanted 9 lines"),
        (lambda t: t.replace("90.0", "inf"), "value 2: got 'inf', wanted a finite number"),
        (lambda t: t[:-9], "values', wanted"),
        (lambda t: t.replace("LeftForeArm", "LeftTentacle"), "wanted left_elbow as LeftForeArm"),
        (lambda t: t.replace("OFFSET 0 -42 0", "OFFSET 0 -4200 0"), "wanted an adult's leg"),
        (lambda t: t.replace("OFFSET 0 -41 0", "OFFSET 0 0 -41"), "legs pointing to -y"),
        (lambda t: t[: t.index("MOTION")], "MOTION: got 'nothing'"),
        (lambda t: t.replace("OFFSET 9 0 0", "OFFSET 9 zero 0"), "got 'zero', wanted a finite number"),
    ],
)  # fmt: skip
def test_a_damaged_file_is_refused(
    bvh_file: Path, change: Callable[[str], str], complaint: str
) -> None:
    bvh_file.write_text(change(bvh_file.read_text()))
    with pytest.raises(InputError) as caught:
        read_bvh(bvh_file)
    assert str(bvh_file) in str(caught.value)
    assert complaint in str(caught.value)

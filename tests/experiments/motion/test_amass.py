"""AMASS archives of both kinds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from experiments.motion.amass import read_amass
from experiments.motion.figure import Figure
from experiments.motion.retarget import retarget
from renderer.files import InputError


def test_both_spellings_of_the_frame_rate_and_both_layouts_are_read(
    amass_file: Callable[..., Path],
) -> None:
    poses = np.random.default_rng(0).uniform(-0.5, 0.5, (40, 156))
    first = read_amass(amass_file(poses=poses))
    stageii = {"root_orient": poses[:, :3], "pose_body": poses[:, 3:66], "mocap_frame_rate": 60}
    second = read_amass(amass_file(poses=None, mocap_framerate=None, **stageii))
    np.testing.assert_array_equal(first.rotations, second.rotations)
    np.testing.assert_allclose(first.times, np.arange(40) / 60)


def test_the_pose_passes_onto_our_body_unchanged(
    amass_file: Callable[..., Path], figure: Figure
) -> None:
    poses = np.random.default_rng(1).uniform(-0.5, 0.5, (40, 156))
    motion = retarget(read_amass(amass_file(poses=poses)), figure)
    np.testing.assert_allclose(motion.pose.reshape(40, 66), poses[:, :66], atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"mocap_framerate": 0.0}, "mocap_framerate: got 0.0, wanted a frame rate"),
        ({"mocap_framerate": None}, "mocap_frame_rate: got 'nothing'"),
        ({"mocap_framerate": "fast"}, "wanted one number"),
        ({"trans": None}, "trans: got 'nothing'"),
        ({"trans": np.full((40, 3), np.nan)}, "trans[0, 0]: got nan"),
        ({"trans": np.full((40, 3), 1700.0)}, "(metres)"),
        ({"trans": np.zeros((39, 3))}, "got '39 frames', wanted 40"),
        ({"poses": np.full((40, 156), 90.0)}, "(radians)"),
        ({"poses": np.zeros((40, 60))}, "wanted numbers of shape (T, 66 or more)"),
        ({"poses": np.full((40, 156), "x")}, "wanted numbers of shape"),
    ],
)
def test_a_wrong_field_is_refused_by_name(
    amass_file: Callable[..., Path], changes: dict[str, object], complaint: str
) -> None:
    path = amass_file(**changes)
    with pytest.raises(InputError) as caught:
        read_amass(path)
    assert str(path) in str(caught.value)
    assert complaint in str(caught.value)


def test_a_truncated_archive_is_refused(amass_file: Callable[..., Path]) -> None:
    path = amass_file()
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(InputError, match=r"wanted a readable \.npz archive"):
        read_amass(path)

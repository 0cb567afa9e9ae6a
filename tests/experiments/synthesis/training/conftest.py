"""A recording written to a file, and a few placed windows, made once for all tests of training."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from experiments.motion.library import load_motion
from experiments.motion.motion import Motion
from experiments.synthesis.placed_windows import DataSettings, PlacedWindows, training_windows


def _write_amass(motion: Motion, target: Path) -> Path:
    """The motion as an AMASS file of SMPL+H."""
    poses = np.concatenate(
        [motion.pose.reshape(motion.n_frames, 66), np.zeros((motion.n_frames, 90))], 1
    )
    np.savez(
        target, poses=poses, trans=motion.transl, mocap_framerate=motion.fps, betas=np.zeros(16)
    )
    return target


@pytest.fixture
def write_amass() -> Callable[[Motion, Path], Path]:
    """Writes a motion as an AMASS file."""
    return _write_amass


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as a user may have it: two AMASS walks in a sub-folder and a file that is no motion."""
    folder = tmp_path_factory.mktemp("recordings")
    subject = folder / "subject1"
    subject.mkdir()
    _write_amass(load_motion("walk_straight"), subject / "walk1_poses.npz")
    _write_amass(load_motion("walk_turn_right"), subject / "walk2_poses.npz")
    np.savez(subject / "shape.npz", betas=np.zeros(16))
    return folder


@pytest.fixture(scope="session")
def settings(recordings: Path) -> DataSettings:
    """As little data as all code paths need."""
    return DataSettings(
        train_rooms=1,
        held_out_rooms=1,
        walks=2,
        seats=2,
        beds=0,
        touches=2,
        idles=2,
        captured_stride=20,
        made_stride=40,
        placements=1,
        motions=recordings,
    )


@pytest.fixture(scope="session")
def windows(settings: DataSettings) -> PlacedWindows:
    """The data of those settings."""
    return training_windows(settings)

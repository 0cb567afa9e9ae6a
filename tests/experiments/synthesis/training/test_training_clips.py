"""Clips before they are cut: what is read, what is held out, what counts as on the floor."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from experiments.motion.figure import figure_of
from experiments.motion.library import load_motion
from experiments.motion.motion import Motion, write_motion
from experiments.synthesis.training_clips import (
    captured_clips,
    made_clips,
    motion_files,
    recorded_clip,
)
from renderer.files import InputError


def test_a_user_s_folder_is_read_with_its_sub_folders(recordings: Path) -> None:
    names = [path.name for path in motion_files(recordings)]
    assert names == ["shape.npz", "walk1_poses.npz", "walk2_poses.npz"]


def test_a_folder_without_motions_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no motion file"):
        motion_files(tmp_path)


def test_a_recorded_walk_is_on_the_floor_throughout(recordings: Path) -> None:
    clip = recorded_clip(recordings / "subject1" / "walk1_poses.npz", figure_of("male_slim"))
    assert clip.on_floor.all()
    assert clip.motion.n_frames == load_motion("walk_straight").n_frames


def test_frames_on_a_platform_are_not_on_the_floor(
    tmp_path: Path, write_amass: Callable[[Motion, Path], Path]
) -> None:
    motion = load_motion("walk_straight")
    raised = motion.transl + np.array([0.0, 0.0, 0.5]) * (motion.times > 2.0)[:, None]
    path = write_amass(dataclasses.replace(motion, transl=raised), tmp_path / "step.npz")
    clip = recorded_clip(path, figure_of("male_slim"))
    # the low-pass filter blurs the jump by some frames
    away = np.abs(clip.motion.times - 2.0) > 0.3
    assert (clip.on_floor == (clip.motion.times < 2.0))[away].all()


def test_a_motion_of_this_project_is_used_on_its_own_body_only(tmp_path: Path) -> None:
    path = tmp_path / "own.npz"
    write_motion(load_motion("walk_straight"), path)
    assert recorded_clip(path, figure_of("male_slim")).on_floor.all()
    assert not recorded_clip(path, figure_of("female_slim")).on_floor.any()


def test_a_fifth_of_the_usable_seconds_is_held_out_by_whole_clips() -> None:
    files = [Path(f"{index}.bvh") for index in range(12)]
    seconds = [0.0, *[10.0] * 10, 0.0]
    splits = [clip.split for clip in captured_clips(files, seconds, seed=1)]
    assert splits.count("held_out") == 2
    assert splits[0] == splits[-1] == "train"


def test_a_single_usable_clip_is_trained_on() -> None:
    clips = captured_clips([Path("a.bvh"), Path("b.bvh")], [3.0, 0.0], seed=0)
    assert [clip.split for clip in clips] == ["train", "train"]


def test_made_clips_are_the_same_for_the_same_seed() -> None:
    counts = {"walk": 1, "seat": 1, "bed": 1, "touch": 1, "idle": 1}
    figure = figure_of("female_heavy")
    for one, two in zip(made_clips(counts, 4), made_clips(counts, 4), strict=True):
        assert np.array_equal(one.build(figure).motion.pose, two.build(figure).motion.pose)

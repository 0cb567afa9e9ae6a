from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.config import read_config
from experiments.methods import METHODS
from experiments.methods.preparation import prepare
from experiments.metrics import plausibility
from experiments.motion.cleanup import clean_recording
from experiments.motion.figure import figure_of
from experiments.motion.importing import read_capture
from experiments.motion.library import load_motion, trim
from experiments.motion.motion import write_motion
from experiments.motion.resample import low_pass, resample, window
from experiments.motion.retarget import retarget
from experiments.pipeline import build_set
from experiments.placement.placement import read_placement
from experiments.placement.settings import PRESETS
from renderer.catalogue import read_catalogue

FAST = dataclasses.replace(PRESETS["fast"], interaction="geometric", weighting="geometric")


@pytest.fixture(scope="module")
def fast_sit(sit):
    """1.5 s at 120 frames per second."""
    return sit(180, stand=0.3, fps=120.0)


@pytest.fixture(scope="module")
def placed_fast(fast_sit, slim, seat_room):
    return {
        name: METHODS[name].place(fast_sit, seat_room, slim, FAST, 0) for name in ("posa_t", "pace")
    }


def test_a_problem_holds_thirty_frames_a_second_and_what_gaps_need(
    fast_sit, slim, seat_room
) -> None:
    problem = prepare(fast_sit, seat_room, slim, FAST, 0)
    n_frames = problem.motion.n_frames
    assert 45 <= n_frames <= 60 and problem.whole.n_frames == 180
    assert problem.vertices.shape[0] == problem.contact.shape[0] == len(problem.k) == n_frames
    assert float(problem.k.mean()) == pytest.approx(1.0, abs=1e-6)
    steps = np.diff(problem.motion.times)
    assert problem.step_scale[1:].numpy() == pytest.approx((1 / 30) / steps, rel=1e-5)


def test_a_fast_clip_comes_back_with_all_its_frames(fast_sit, placed_fast) -> None:
    for placement in placed_fast.values():
        assert placement.motion.n_frames == 180 and placement.motion.fps == 120.0
        assert np.array_equal(placement.motion.times, fast_sit.times)
        optimised = placement.info["frames_optimised"]
        assert np.count_nonzero(placement.weights) == optimised < 60
        assert placement.weights.sum() == pytest.approx(optimised)


def test_all_methods_optimise_the_same_frames(placed_fast) -> None:
    kept = [np.flatnonzero(placement.weights) for placement in placed_fast.values()]
    assert np.array_equal(kept[0], kept[1])


def test_the_frames_between_are_altered_as_smoothly_as_those_kept(fast_sit, placed_fast) -> None:
    placement = placed_fast["pace"]
    original = Rotation.from_rotvec(fast_sit.pose[:, 1:].reshape(-1, 3))
    altered = Rotation.from_rotvec(placement.motion.pose[:, 1:].reshape(-1, 3))
    change = (original.inv() * altered).as_rotvec().reshape(180, 21, 3)
    kept = np.flatnonzero(placement.weights)
    largest = np.linalg.norm(change[kept], axis=-1).max(0)
    assert (np.linalg.norm(change, axis=-1).max(0) <= largest + 1e-9).all()
    turn = np.degrees(np.linalg.norm(np.diff(change, axis=0), axis=-1)).max()
    assert 0.0 < turn < 1.0


def test_thinning_costs_little_against_the_same_clip_at_thirty(
    fast_sit, placed_fast, slim, seat_room
) -> None:
    slow = resample(fast_sit, 30.0)
    there = METHODS["pace"].place(slow, seat_room, slim, FAST, 0)
    here = placed_fast["pace"]
    assert here.translation == pytest.approx(there.translation, abs=0.05)
    first = plausibility(here.motion, fast_sit, seat_room, slim, FAST)
    second = plausibility(there.motion, slow, seat_room, slim, FAST)
    assert first.predicted_near >= second.predicted_near - 0.05
    assert first.semantic_match > 0.9 and first.contact.mean() >= 0.95


def test_a_clip_of_thirty_frames_a_second_is_not_thinned(sit, slim, seat_room) -> None:
    problem = prepare(sit(30), seat_room, slim, FAST, 0)
    assert problem.motion.n_frames == 30
    assert np.array_equal(problem.motion.pose, problem.whole.pose)


def test_a_full_turn_between_frames_is_taken_out_before_optimising(sit, slim, seat_room) -> None:
    motion = sit(30)
    pose = motion.pose.copy()
    root = pose[12:, 0]
    pose[12:, 0] = root * (1 - 2 * np.pi / np.linalg.norm(root, axis=-1, keepdims=True))
    jumping = dataclasses.replace(motion, pose=pose)
    problem = prepare(jumping, seat_room, slim, FAST, 0)
    assert problem.pose.numpy() == pytest.approx(motion.pose, abs=1e-5)


CONFIG = """
set_id = "fast"
seed = 1
scenes = ["bedroom"]
motions_dir = "motions"
methods = ["posa_t", "pace"]
study_methods = ["posa_t", "pace"]
[placement]
preset = "fast"
[render]
preset = "demo"
[extras]
catch = 0
practice = 0
"""


def build_from(motion, folder):
    """Everything from a motion file to clips; returns the motion of PACE's placement and the clips."""
    (folder / "motions").mkdir()
    write_motion(motion, folder / "motions" / f"{motion.motion_id}.npz")
    (folder / "fast.toml").write_text(CONFIG)
    build_set(read_config(folder / "fast.toml"), folder / "set", jobs=1)
    placement = read_placement(folder / "set" / "placements" / f"bedroom__{motion.motion_id}__pace")
    return placement, read_catalogue(folder / "set").clips


@pytest.mark.slow
def test_an_authored_clip_at_120_goes_the_whole_way_to_pictures(tmp_path) -> None:
    motion = resample(trim(load_motion("walk_turn_right"), 1.2), 120.0)
    motion = dataclasses.replace(motion, motion_id="fast_walk")
    placement, clips = build_from(motion, tmp_path)
    assert placement.motion.n_frames == motion.n_frames > 130
    assert placement.info["frames_optimised"] < 0.5 * motion.n_frames
    assert len(clips) == 2
    for clip in clips:
        assert clip.fps == 30.0
        assert clip.duration_s == pytest.approx(motion.duration_s, abs=0.05)


@pytest.mark.slow
@pytest.mark.shared
def test_a_recorded_clip_at_120_goes_the_whole_way_to_pictures(shared_data, tmp_path) -> None:
    figure = figure_of("male_slim")
    capture = read_capture(shared_data / "cmu" / "02" / "02_01.amc")
    recorded = low_pass(retarget(capture, figure))
    recorded = dataclasses.replace(recorded, motion_id="cmu_walk")
    motion = clean_recording(window(recorded, 0, 144), figure)
    assert motion.fps == 120.0
    placement, clips = build_from(motion, tmp_path)
    assert placement.motion.n_frames == 144 and placement.info["frames_optimised"] < 72
    assert [clip.n_frames for clip in clips] == [36, 36]

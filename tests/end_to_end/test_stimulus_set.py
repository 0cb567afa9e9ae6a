"""A small stimulus set, built for real: one room, one motion, three methods, every kind of clip."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from experiments.config import read_config
from experiments.pipeline import BuildOutcome, build_set
from renderer.catalogue import read_catalogue, verify_catalogue

ROOT = Path(__file__).resolve().parents[2]


CONFIG = """
set_id = "small"
seed = 3
scenes = ["bedroom"]
motions = ["walk_turn_right"]
methods = ["posa_t", "synthesis", "pace"]
study_methods = ["posa_t", "synthesis", "pace"]
cut_seconds = 1.0
[placement]
preset = "fast"
[render]
preset = "demo"
[extras]
catch = 1
practice = 1
practice_motion = "stand_idle_look"
seconds = 0.5
"""


@pytest.fixture(scope="module")
def config_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("config") / "small.toml"
    path.write_text(CONFIG)
    return path


@pytest.fixture(scope="module")
def built(config_file: Path, tmp_path_factory: pytest.TempPathFactory) -> BuildOutcome:
    return build_set(read_config(config_file), tmp_path_factory.mktemp("set") / "small", jobs=2)


def test_the_set_holds_main_catch_and_practice_pairs_and_is_sound(built: BuildOutcome) -> None:
    catalogue = read_catalogue(built.folder)
    shown = sorted((clip.role, clip.method) for clip in catalogue.clips)
    assert shown == [
        ("catch", "lifted"), ("catch", "pace"), ("main", "pace"), ("main", "posa_t"),
        ("main", "synthesis"), ("practice", "lifted"), ("practice", "pace"),
    ]  # fmt: skip
    assert verify_catalogue(built.folder) == []
    assert built.dropped == ()


def test_both_clips_of_the_pair_have_length_and_cameras_in_common(built: BuildOutcome) -> None:
    catalogue = read_catalogue(built.folder)
    shapes = {(clip.n_frames, clip.fps, clip.width, clip.height) for clip in catalogue.main_clips()}
    assert shapes == {(30, 30.0, 960, 540)}
    assert sum(camera["role"] == "main" for camera in catalogue.cameras) == 1


def test_the_synthesised_clip_is_marked_and_fills_the_slot_of_its_pair(built: BuildOutcome) -> None:
    catalogue = read_catalogue(built.folder)
    shares = {method["name"]: method["shares_motion"] for method in catalogue.methods}
    assert shares == {"posa_t": True, "synthesis": False, "pace": True}
    name = next(m["display_name"] for m in catalogue.methods if m["name"] == "synthesis")
    assert re.fullmatch(r"Motion synthesis \(re-implemented, \d+ min of capture\)", name)
    clips = {clip.method: clip for clip in catalogue.main_clips()}
    assert clips["synthesis"].motion == clips["pace"].motion == "walk_turn_right"
    assert "cv2" in clips["pace"].scores and "cv2" not in clips["synthesis"].scores
    assert {"non_collision", "contact"} <= set(clips["synthesis"].scores)


def test_no_file_that_participants_receive_is_named_after_a_method(built: BuildOutcome) -> None:
    names = " ".join(path.name for path in (built.folder / "clips").iterdir())
    assert all(word not in names for word in ("pace", "posa", "synth", "lifted", "bedroom", "walk"))


def test_a_second_build_changes_no_byte(built: BuildOutcome, config_file: Path) -> None:
    before = {path: path.read_bytes() for path in built.folder.rglob("*") if path.is_file()}
    again = build_set(read_config(config_file), built.folder, jobs=2)
    assert again.reused == 2
    assert {path: path.read_bytes() for path in built.folder.rglob("*") if path.is_file()} == before


@pytest.mark.slow
def test_a_build_killed_in_mid_clip_goes_on_clip_by_clip_to_the_same_set(
    built: BuildOutcome, config_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "killed"
    folder.mkdir()
    for name in ("config.json", "placements", "records"):
        copy = shutil.copytree if (built.folder / name).is_dir() else shutil.copy
        copy(built.folder / name, folder / name)
    shutil.rmtree(folder / "records" / "clips")
    command = [sys.executable, "-m", "pace_study", "stimuli", "build", str(config_file)]
    command += ["--out", str(folder), "--jobs", "1"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env=environment, start_new_session=True) as run:
        notes = folder / "records" / "clips" / "main__bedroom__walk_turn_right"
        _wait_for(lambda: any(notes.glob("*.json")) and any(folder.glob("clips/.partial-*")))
        os.killpg(run.pid, signal.SIGKILL)
    done = {path: path.stat().st_mtime_ns for path in (folder / "clips").glob("*.mp4")}
    assert 0 < len(done) < 7 and not (folder / "catalogue.json").exists()
    build_set(read_config(config_file), folder, jobs=1)
    assert {path: path.stat().st_mtime_ns for path in done} == done
    assert read_catalogue(folder).clips == read_catalogue(built.folder).clips
    assert verify_catalogue(folder) == [] and not any(folder.glob("clips/.partial-*"))


def _wait_for(condition: Callable[[], bool], seconds: float = 240.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "the build made no clip in time"
        time.sleep(0.05)


def _verify(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pace_study", "stimuli", "verify", str(folder), "--json"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def test_verify_names_an_altered_and_a_missing_clip(built: BuildOutcome, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(built.folder, folder)
    first, second = read_catalogue(folder).clips[:2]
    (folder / first.file).write_bytes(b"other")
    (folder / second.file).unlink()
    done = _verify(folder)
    faults = json.loads(done.stdout)["faults"]
    assert done.returncode == 1
    assert [first.clip_id in faults[0], second.clip_id in faults[1], len(faults)] == [True, True, 2]


def test_verify_of_a_folder_without_a_catalogue_is_one_line(tmp_path: Path) -> None:
    done = _verify(tmp_path)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "catalogue.json: file: got 'missing'" in done.stderr

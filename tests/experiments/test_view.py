"""What the viewer is told: distances, error of the skin, names; and what it refuses."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

import pace_study
from experiments.body.model import BodyModel
from experiments.motion.motion import Motion
from experiments.placement.placement import Placement, write_placement
from experiments.scene.scene import Scene
from experiments.view import ERROR_MAX_MM, ERROR_P99_MM, body_mesh, skin_marks
from renderer.gltf import UNMARKED

MakeMotion = Callable[..., Motion]


def moved(motion: Motion, x: float, y: float, z: float) -> Motion:
    return dataclasses.replace(motion, transl=motion.transl + np.array([x, y, z]))


def place(motion: Motion, scene: str, method: str, stem: Path) -> Path:
    placement = Placement(
        scene, motion.motion_id, method, np.zeros(3), 0.0, motion, False,
        np.ones(motion.n_frames), {"total": 0.0}, 1, "0" * 16,
    )  # fmt: skip
    return write_placement(placement, stem)[1]


@pytest.fixture
def sunk(walk: MakeMotion) -> Motion:
    """Walks 0.3 m in the middle of the room with soles 30 mm under the floor."""
    return moved(walk(0.3, 12), 1.5, 1.7, -0.03)


def test_marks_are_the_height_above_an_empty_floor(
    sunk: Motion, empty_room: Scene, slim: BodyModel
) -> None:
    marks = skin_marks(sunk, empty_room, tolerance_mm=10.0)
    pose, transl = torch.as_tensor(sunk.pose), torch.as_tensor(sunk.transl)
    height = 1e4 * slim.posed(pose, transl).vertices.numpy()[..., 2]
    found = marks != UNMARKED
    skin = np.isin(np.arange(slim.n_vertices), slim.body_component)
    assert np.array_equal(found, (height <= 100) & skin) or np.all(
        np.abs(height[found != ((height <= 100) & skin)] - 100) < 1
    )
    assert np.abs(marks[found] - height[found]).max() <= 1.0
    assert marks[found].min() < -290


def test_a_body_in_the_air_has_no_marks(walk: MakeMotion, empty_room: Scene) -> None:
    marks = skin_marks(moved(walk(0.3, 6), 1.5, 1.7, 0.05), empty_room, tolerance_mm=10.0)
    assert np.all(marks == UNMARKED)


def test_a_wider_tolerance_marks_more_and_changes_no_distance(
    sunk: Motion, empty_room: Scene
) -> None:
    narrow, wide = (skin_marks(sunk, empty_room, tolerance) for tolerance in (2.0, 20.0))
    kept = narrow != UNMARKED
    assert np.array_equal(narrow[kept], wide[kept])
    assert np.count_nonzero(wide != UNMARKED) > np.count_nonzero(kept)


def test_the_skin_in_the_file_is_as_near_to_the_body_model_as_promised(sunk: Motion) -> None:
    mesh, error = body_mesh(sunk, "pace")
    assert error.p99_mm <= ERROR_P99_MM and error.max_mm <= ERROR_MAX_MM
    assert error.max_mm > 0
    assert mesh.rotations.shape == (12, 22, 4)
    assert np.allclose(np.linalg.norm(mesh.rotations, axis=2), 1)


def run(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr("sys.argv", ["pace-study", *map(str, words)])
    with pytest.raises(SystemExit) as stop:
        pace_study.main()
    return int(stop.value.code or 0)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"scene": "living"}, "scene: got 'living', wanted bedroom"),
        ({"n_frames": 9}, "frames: got 9, wanted 12"),
        ({"fps": 25.0}, "fps: got 25.0, wanted 30.0"),
    ],
)
def test_placements_that_share_no_clock_or_room_are_refused(
    change: dict[str, object],
    named: str,
    walk: MakeMotion,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    motion = walk(0.3, int(str(change.get("n_frames", 12))), float(str(change.get("fps", 30.0))))
    one = place(walk(0.3, 12), "bedroom", "pace", tmp_path / "one")
    two = place(motion, str(change.get("scene", "bedroom")), "posa_t", tmp_path / "two")
    assert run(monkeypatch, "view", one, two, "--out", tmp_path / "page") == 1
    told = capsys.readouterr().err
    assert named in told and told.count("\n") == 1
    assert not (tmp_path / "page").exists()


def test_a_missing_placement_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "view", tmp_path / "none.json", "--out", tmp_path / "page") == 1
    told = capsys.readouterr().err
    assert "none.json: file: got 'missing'" in told and told.count("\n") == 1


def test_a_placement_that_is_no_number_is_one_line(
    walk: MakeMotion,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    motion = walk(0.3, 12)
    motion.transl[4] = np.nan
    stem = place(motion, "bedroom", "pace", tmp_path / "bad")
    assert run(monkeypatch, "view", stem, "--out", tmp_path / "page") == 1
    assert "trans[4]: got 'not a number', wanted finite values" in capsys.readouterr().err


@pytest.mark.parametrize("words", [[], ["x.json"], ["x.json", "--out", "y", "--tolerance", "0"]])
def test_wrong_use_is_status_two(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(monkeypatch, "view", *words) == 2

"""Importing any file, by function and by command."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from experiments.motion.checks import check_motion
from experiments.motion.cli import assets
from experiments.motion.cli import motion as motion_command
from experiments.motion.deepmimic import pybullet_clip
from experiments.motion.figure import Figure
from experiments.motion.importing import read_motion_file
from experiments.motion.motion import read_motion
from renderer.files import InputError


def test_an_amass_bow_is_imported_onto_the_floor(
    amass_file: Callable[..., Path], figure: Figure
) -> None:
    motion = read_motion_file(amass_file())
    assert motion.fps == 30.0 and motion.motion_id == "bow_poses" and motion.body == "male_slim"
    np.testing.assert_allclose(motion.transl[0, :2], 0.0, atol=0.05)
    assert check_motion(motion, figure).sole_penetration_mm < 2.0


def test_a_motion_of_ours_is_taken_as_it_is(tmp_path: Path) -> None:
    out = tmp_path / "walk.npz"
    clip = str(pybullet_clip("humanoid3d_walk"))
    result = CliRunner().invoke(motion_command, ["import", clip, "--out", str(out), "--json"])
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    assert record["frames"] == 38 and record["file"] == str(out)
    again = read_motion_file(out)
    np.testing.assert_array_equal(again.pose, read_motion(out).pose)
    with pytest.raises(InputError, match="wanted female_slim"):
        read_motion_file(out, "female_slim")


@pytest.mark.parametrize(
    ("name", "complaint"), [("a.fbx", "got '.fbx', wanted one of"), ("a.bvh", "got 'missing'")]
)
def test_unknown_and_missing_files_are_refused(name: str, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read_motion_file(tmp_path / name)
    assert complaint in str(caught.value)


def test_a_bad_file_leaves_nothing_behind(bvh_file: Path, tmp_path: Path) -> None:
    bvh_file.write_text(bvh_file.read_text().replace("Frames: 4", "Frames: 5"))
    out = tmp_path / "out" / "m.npz"
    result = CliRunner().invoke(motion_command, ["import", str(bvh_file), "--out", str(out)])
    assert isinstance(result.exception, InputError)
    assert not out.parent.exists()


def test_a_wrong_suffix_of_the_output_is_bad_use(bvh_file: Path) -> None:
    result = CliRunner().invoke(motion_command, ["import", str(bvh_file), "--out", "m.bvh"])
    assert result.exit_code == 2 and "does not end in .npz" in result.output


def test_the_list_names_bodies_motions_and_rooms() -> None:
    result = CliRunner().invoke(assets, ["list", "--json"])
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    assert record["bodies"] == ["female_slim", "male_slim", "female_heavy", "male_heavy"]
    assert {"id", "label", "frames", "floor_error_cm", "foot_skate_cm_s", "source"} <= set(
        record["motions"][0]
    )
    assert {room["id"] for room in record["rooms"]} >= {"bedroom", "library", "booth", "living"}


@pytest.mark.shared
@pytest.mark.parametrize(
    "name", ["02/02_01.amc", "02/02_06.amc", "131/131_01.bvh", "131/131_03.bvh"]
)
def test_cmu_recordings_are_imported_clean(shared_data: Path, figure: Figure, name: str) -> None:
    motion = read_motion_file(shared_data / "cmu" / name)
    checks = check_motion(motion, figure)
    assert checks.sole_penetration_mm < 2.0
    assert checks.floor_error_cm < 0.5
    assert checks.root_acceleration < 20.0
    if name.endswith("amc"):
        assert checks.foot_skate_cm_s < 4.0

"""The two files that reproduce the paper's protocol, and motions from a folder."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from experiments.config import CONFIGS, StimulusSetConfig, read_config
from experiments.methods import METHODS
from experiments.records import SetFolder
from renderer.files import InputError
from study_app.config import read_study

DISPLAY = {"posa_t": "POSA-T", "paak": "PAAK", "pace": "PACE", "synthesis": "Motion synthesis"}


@pytest.fixture(scope="module")
def paper() -> StimulusSetConfig:
    return read_config(CONFIGS / "paper.toml")


def _folder(tmp_path: Path, count: int) -> str:
    for index in range(count):
        (tmp_path / f"m{index:03}.npz").write_bytes(b"")
    return str(tmp_path)


def test_the_papers_set_is_four_scenes_by_a_hundred_motions_by_four_methods(
    paper, tmp_path
) -> None:
    assert len(paper.scenes) == 4 and paper.motions_wanted == 100 and paper.cut_seconds == 0
    assert set(paper.study_methods) == set(DISPLAY)
    assert set(paper.methods) - set(paper.study_methods) == {"pace_no_pose", "pace_no_motion"}
    assert all(METHODS[name].display_name.startswith(DISPLAY[name]) for name in DISPLAY)
    many = dataclasses.replace(paper, motions_dir=_folder(tmp_path, 130))
    assert len(paper.scenes) * len(SetFolder(tmp_path).motion_ids(many)) == 400


def test_the_papers_study_asks_sixty_questions_of_its_set(paper) -> None:
    study = read_study(CONFIGS / "paper-study.toml")
    assert study.trials_per_cell * len(study.scenes) * len(study.baselines) == 60
    assert study.scenes == paper.scenes
    assert {study.target, *study.baselines} == set(paper.study_methods)
    assert study.layout == "stacked" and study.policy == "random"
    assert not study.checks.demographics and not study.exclusions
    assert set(study.extra_trials.model_dump().values()) == {0}


@pytest.mark.parametrize("name", ["demo", "ablation", "paper"])
def test_every_shipped_set_shows_all_four_study_methods(name) -> None:
    config = read_config(CONFIGS / f"{name}.toml")
    assert set(config.study_methods) == {key for key, method in METHODS.items() if method.study}
    assert config.study_methods[-1] == "pace"


def test_the_demonstration_asks_about_the_methods_it_shows() -> None:
    study, shown = read_study(CONFIGS / "demo-study.toml"), read_config(CONFIGS / "demo.toml")
    assert {study.target, *study.baselines} == set(shown.study_methods)
    assert set(study.scenes) == set(shown.scenes)


def test_motions_of_a_folder_are_drawn_by_the_seed(paper, tmp_path) -> None:
    folder = SetFolder(tmp_path)
    config = dataclasses.replace(paper, motions_dir=_folder(tmp_path, 40), motions_wanted=10)
    drawn = folder.motion_ids(config)
    assert drawn == folder.motion_ids(config) == tuple(sorted(set(drawn))) and len(drawn) == 10
    assert drawn != folder.motion_ids(dataclasses.replace(config, seed=1))
    assert len(folder.motion_ids(dataclasses.replace(config, motions_wanted=0))) == 40


def test_a_folder_with_fewer_motions_is_used_whole(paper, tmp_path) -> None:
    config = dataclasses.replace(paper, motions_dir=_folder(tmp_path, 7))
    assert len(SetFolder(tmp_path).motion_ids(config)) == 7


def test_a_number_of_motions_without_a_folder_is_refused(tmp_path) -> None:
    text = (CONFIGS / "paper.toml").read_text()
    path = tmp_path / "set.toml"
    path.write_text(text.replace('motions_dir = "motions"', 'motions = ["walk_straight"]'))
    with pytest.raises(InputError, match="motions_wanted: got 100, wanted 0 without motions_dir"):
        read_config(path)

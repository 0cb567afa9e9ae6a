"""Bad study files get one line that names the file, the key and the value."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from renderer.files import InputError
from study_app.config import read_study
from study_app.lists import read_lists
from study_app.settings import SETTINGS, Settings, read_settings
from study_app.stimuli import plan_study

StudyFile = Callable[..., Path]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ('qestion = "x"', "qestion: got 'x', wanted a known key; the nearest is 'question'"),
        ("[extra_trials]\ncacth = 1", "extra_trials.cacth: got 1, .* nearest is 'catch'"),
        ('[texts]\nbegn = "Go"', "texts.begn: got 'Go', .* nearest is 'begin'"),
        ("[exclusions]\nmax_catch_failure = 1", "exclusions.max_catch_failure: got 1"),
        ("[exclusions]\nmajority_agreement = 1", "no exclusion by agreement"),
        ('policy = "balance"', "policy: got 'balance', wanted 'balanced', 'random' or 'list'"),
        ("repeat_scene_motion = 1", "repeat_scene_motion: got 1, wanted a valid boolean"),
        ("schema_version = 2", "schema_version: got 2, wanted the number 1"),
        ('policy = "list"', "lists: got '', wanted a file name"),
    ],
)
def test_a_bad_study_file_gets_one_clear_line(
    study_file: StudyFile, change: str, message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_study(study_file(change))
    assert "study.toml" in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_key_is_named(study_file: StudyFile) -> None:
    with pytest.raises(InputError, match="target: got 'nothing', wanted this key"):
        read_study(study_file("", ('target = "pace"', "")))


def test_the_target_among_the_baselines_is_refused(study_file: StudyFile) -> None:
    with pytest.raises(InputError, match="baselines: got 'pace', wanted each method once"):
        read_study(study_file("", ('"paak"', '"pace"')))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"paak"', '"paakk"', "baselines: got 'paakk', wanted a method with clips: paak, pace"),
        ("seed = 3", 'scenes = ["attic"]', "scenes: got 'attic', wanted a scene with clips"),
        ("trials_per_cell = 1", "trials_per_cell = 4", "trials_per_cell: got 4, .* needs 8"),
        ("seed = 3", "[extra_trials]\nrepeat = 1", "extra_trials.repeat: got 1, .* 4 other trials"),
    ],
)
def test_a_study_that_its_catalogue_cannot_serve_is_refused(
    study_file: StudyFile, still_stimuli: Path, old: str, new: str, message: str
) -> None:
    path = study_file("", (old, new))
    with pytest.raises(InputError, match=message):
        plan_study(read_study(path), still_stimuli, path)


def test_more_trials_than_motions_are_fine_where_the_study_allows_repeats(
    study_file: StudyFile, still_stimuli: Path
) -> None:
    path = study_file("repeat_scene_motion = true", ("cell = 1", "cell = 9"))
    assert len(plan_study(read_study(path), still_stimuli, path).pairs) == 24


def test_an_altered_clip_is_refused_by_name(
    study_file: StudyFile, still_stimuli: Path, tmp_path: Path
) -> None:
    import shutil

    folder = shutil.copytree(still_stimuli, tmp_path / "set")
    victim = next((folder / "clips").iterdir())
    victim.write_bytes(b"other")
    with pytest.raises(InputError, match=f"{victim.name}.*content differs"):
        plan_study(read_study(study_file()), folder, "study.toml")


def test_a_motion_that_lacks_a_method_is_refused(
    study_file: StudyFile, still_stimuli: Path, tmp_path: Path
) -> None:
    import shutil

    folder = shutil.copytree(still_stimuli, tmp_path / "set")
    record = json.loads((folder / "catalogue.json").read_text())
    gone = ("bedroom", "walk_2", "paak")
    record["clips"] = [c for c in record["clips"] if (c["scene"], c["motion"], c["method"]) != gone]
    (folder / "catalogue.json").write_text(json.dumps(record))
    with pytest.raises(
        InputError, match="scene bedroom, motion walk_2', wanted a clip of method paak"
    ):
        plan_study(read_study(study_file()), folder, "study.toml")


def test_prepared_lists_are_checked_row_by_row(
    study_file: StudyFile, still_stimuli: Path, tmp_path: Path
) -> None:
    config = read_study(study_file('policy = "list"\nlists = "lists.json"'))
    plan = plan_study(config, still_stimuli, "study.toml")
    row = {"scene": "bedroom", "motion": "walk_0", "target": "pace", "baseline": "paak"}
    rows = [row | {"first": "left"}] * 4
    (tmp_path / "lists.json").write_text(json.dumps([rows]))
    with pytest.raises(InputError, match="session 1, row 1, first: got 'left'"):
        read_lists(tmp_path / "lists.json", plan)


def test_settings_come_from_the_environment_and_are_checked() -> None:
    assert read_settings({}) == Settings()
    assert read_settings({"PACE_WINDOW": "2", "PACE_TRUST_PROXY": "true"}).window == 2
    with pytest.raises(InputError, match=re.escape("PACE_WINDOW: got '99', wanted a whole number")):
        read_settings({"PACE_WINDOW": "99"})
    assert {row.attribute for row in SETTINGS} == set(vars(Settings()))

"""The folder of a stimulus set belongs to one configuration and remembers what is done."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from experiments.config import ExtrasConfig, StimulusSetConfig
from experiments.jobs import PlaceJob, RenderJob
from experiments.pipeline import place_jobs, render_jobs, validate_names
from experiments.records import SetFolder
from renderer.files import InputError, write_json

CONFIG = StimulusSetConfig(
    "s", 1, ("bedroom", "living"), ("posa_t", "pace", "pace_no_pose"), ("posa_t", "pace"),
    motions=("walk_turn_right", "sit_stay_stand"), other_methods_motions=1,
    extras=ExtrasConfig(catch=1, practice=2, practice_motion="stand_idle_look"),
)  # fmt: skip


def test_a_folder_refuses_another_configuration(tmp_path: Path) -> None:
    folder = SetFolder(tmp_path)
    folder.claim(CONFIG)
    folder.claim(CONFIG)
    with pytest.raises(InputError, match=r"config\.json: got 'set s', wanted an empty folder"):
        folder.claim(dataclasses.replace(CONFIG, seed=2))


def test_study_methods_take_every_motion_and_other_methods_the_stated_number(
    tmp_path: Path,
) -> None:
    jobs = [job for job in place_jobs(CONFIG, SetFolder(tmp_path)) if not job.is_extra]
    counts = {method: sum(job.method == method for job in jobs) for method in CONFIG.methods}
    assert counts == {"posa_t": 4, "pace": 4, "pace_no_pose": 2}


def test_each_scene_and_motion_is_rendered_once_and_practice_apart(tmp_path: Path) -> None:
    jobs = render_jobs(CONFIG, SetFolder(tmp_path))
    main = [job.key for job in jobs if job.role == "main"]
    assert len(main) == len(set(main)) == 4
    assert sum(job.extra for job in jobs if job.role == "main") == CONFIG.extras.catch
    assert len({job.record_path for job in jobs}) == len(jobs)
    assert {job.motion_id for job in jobs if job.role == "practice"} == {"stand_idle_look"}


def _job(tmp_path: Path, config: StimulusSetConfig = CONFIG) -> PlaceJob:
    return PlaceJob(config, tmp_path, "bedroom", "walk_turn_right", "pace")


def test_a_placement_is_reused_only_while_its_inputs_are_the_same(tmp_path: Path) -> None:
    job = _job(tmp_path)
    assert job.reusable() is None
    path = SetFolder(tmp_path).record_path("bedroom", "walk_turn_right", "pace")
    write_json(path, {"input_hash": job.input_hash()})
    assert job.reusable() == "reused"
    assert _job(tmp_path, dataclasses.replace(CONFIG, seed=2)).reusable() is None
    assert _job(tmp_path, dataclasses.replace(CONFIG, scenes=("bedroom",))).reusable() == "reused"


def test_clips_are_made_again_when_one_of_their_files_is_gone(tmp_path: Path) -> None:
    job = RenderJob(CONFIG, tmp_path, "bedroom", "walk_turn_right", "main", 0)
    clip = {"file": "clips/a.mp4", "poster": "clips/a.jpg"}
    write_json(job.record_path, {"input_hash": job.input_hash(), "clips": [clip], "cameras": []})
    assert job.reusable() is None
    (tmp_path / "clips").mkdir()
    for name in clip.values():
        (tmp_path / name).write_bytes(b"x")
    assert job.reusable() == "reused"


def test_one_failure_drops_the_scene_and_motion_for_all_study_methods(tmp_path: Path) -> None:
    folder = SetFolder(tmp_path)
    for method, failure, counts in [
        ("pace", "too long", True),
        ("pace_no_pose", "too long", False),
    ]:
        scene = "bedroom" if counts else "living"
        record: dict[str, Any] = {
            "scene": scene,
            "motion": "m",
            "method": method,
            "failure": failure,
        }
        write_json(folder.record_path(scene, "m", method), {**record, "study_method": counts})
    assert list(folder.drops()) == [("bedroom", "m")]
    assert folder.drops()["bedroom", "m"]["reason"] == "too long"


@pytest.mark.parametrize(
    ("changes", "word"),
    [({"methods": ("pace", "magic")}, "magic"), ({"motions": ("fly",)}, "fly"),
     ({"scenes": ("moon",)}, "moon"),
     ({"motions": ("stand_idle_look",)}, "outside the main pool")],
)  # fmt: skip
def test_unknown_names_are_refused_before_anything_is_computed(
    changes: dict[str, Any], word: str
) -> None:
    with pytest.raises(InputError, match=word):
        validate_names(dataclasses.replace(CONFIG, **changes))

"""Jobs run side by side: all of them finish, and the first failure ends the run with its own words."""

from __future__ import annotations

import dataclasses
import multiprocessing
import operator
from pathlib import Path

import pytest

from experiments.config import StimulusSetConfig
from experiments.jobs import PlaceJob, run_place
from experiments.pipeline import run_all
from renderer.files import InputError

CONFIG = StimulusSetConfig("s", 1, ("bedroom",), ("pace",), ("pace",), motions=("no_such_motion",))


def _jobs(tmp_path: Path, count: int) -> list[PlaceJob]:
    return [
        PlaceJob(CONFIG, tmp_path, "bedroom", f"motion{index}", "pace") for index in range(count)
    ]


def test_many_more_jobs_than_workers_all_finish(tmp_path: Path) -> None:
    seen: list[tuple[str, int, int]] = []
    jobs = _jobs(tmp_path, 50)
    work = operator.attrgetter("motion_id")
    outcomes = run_all(work, jobs, 2, "place", lambda *step: seen.append(step))
    assert sorted(outcomes) == sorted(job.motion_id for job in jobs)
    assert seen[0] == ("place", 0, 50) and seen[-1] == ("place", 50, 50)


def test_nobody_waits_for_jobs_under_way_when_a_run_ends_early(tmp_path: Path) -> None:
    long = PlaceJob(CONFIG, tmp_path, "bedroom", "walk_straight", "pace")
    with pytest.raises(InputError, match="no_such_motion"):
        run_all(
            run_place,
            [long, dataclasses.replace(long, motion_id="no_such_motion")],
            2,
            "place",
            lambda *step: None,
        )
    assert not multiprocessing.active_children()
    assert long.reusable() is None and list(tmp_path.rglob("*")) == []


def test_a_failing_job_ends_the_run_with_its_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="motion library: motion: got 'motion0'"):
        run_all(run_place, _jobs(tmp_path, 1), 1, "place", lambda *step: None)
    assert list(tmp_path.iterdir()) == []

"""Many processes and threads at once, some killed in the middle: nothing lost, nothing doubled."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import func, select

from study_app.doctor import examine
from study_app.models import Pair, PairCount, Participant, Response, Trial
from study_app.studies import find_study

ROOT = Path(__file__).resolve().parents[2]
CROWD = Path(__file__).with_name("race.py")
NewSite = Callable[..., Any]


def crowd(site: Any, threads: int, people: int) -> subprocess.Popen[str]:
    version = site.do(lambda session: find_study(session, "tiny").id)
    words = [sys.executable, str(CROWD), site.database.url, version, threads, people]
    return subprocess.Popen(
        [str(word) for word in words], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
    )  # fmt: skip


def race(site: Any, processes: int, threads: int, people: int, victims: int) -> None:
    """Run crowds side by side, kill some with -9 in mid work, and check what is left."""
    crowds = [crowd(site, threads, people) for _ in range(processes)]
    for victim in crowds[:victims]:
        assert victim.stdout is not None
        victim.stdout.readline()  # somebody has finished, the others are in the middle
        victim.kill()
    faults = [one.communicate(timeout=500)[1] for one in crowds]
    assert faults[victims:] == [""] * (processes - victims)
    check(site, (processes - victims) * threads * people)


def check(site: Any, survivors: int) -> None:
    site.clock.forward(100 * 365 * 86400)  # every lease of the killed has expired by then
    assert site.do(examine, "tiny", site.clock())["findings"] == []
    with site.database.read() as session:
        finished = session.scalars(select(Participant.id).where(Participant.state == "finished"))
        done = list(finished)
        assert len(done) >= survivors
        answered = select(func.count(Response.id)).join(Response.trial)
        assert session.scalar(answered.where(Trial.participant_id.in_(done))) == 12 * len(done)
        sides = session.execute(
            select(PairCount.target_first, PairCount.target_second)
            .join(Pair, Pair.id == PairCount.pair_id)
            .where(PairCount.mode == "live", Pair.kind == "main")
        ).all()
    answers = site.do(lambda session: session.scalar(select(func.count(Response.id))))
    assert sum(first + second for first, second in sides) == answers


THREE_A_CELL = ("trials_per_cell = 1", "trials_per_cell = 3")


def test_two_processes_of_threads_race_and_the_recount_is_exact(
    new_site: NewSite, database_url: str
) -> None:
    race(new_site(database_url, "", THREE_A_CELL), processes=2, threads=3, people=1, victims=0)


def test_a_process_killed_in_mid_transaction_leaves_exact_counters(
    new_site: NewSite, database_url: str
) -> None:
    race(new_site(database_url, "", THREE_A_CELL), processes=2, threads=3, people=2, victims=1)


@pytest.mark.slow
@pytest.mark.parametrize("victims", [0, 2])
def test_sixteen_threads_in_four_processes_race(
    new_site: NewSite, database_url: str, victims: int
) -> None:
    race(
        new_site(database_url, "", THREE_A_CELL), processes=4, threads=16, people=2, victims=victims
    )


def test_a_lease_that_another_request_renews_is_not_swept(site: Any) -> None:
    visitor = site.visitor()
    visitor.go_to_trial()
    site.clock.forward(timedelta(minutes=29).total_seconds())
    visitor.get("/s/tiny")
    site.clock.forward(120)
    assert site.do(examine, "tiny", site.clock())["swept"] == 0

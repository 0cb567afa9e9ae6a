"""The stored allocator under any interleaving: counters equal a recount, and sides stay even."""

from __future__ import annotations

import itertools
import uuid
from collections import Counter
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    rule,
    run_state_machine_as_test,
)
from sqlalchemy import select

from renderer.catalogue import Clip
from study_app import services, studies
from study_app.allocation import sweep
from study_app.config import parse_study
from study_app.db import Database, upgrade
from study_app.design import study_cells
from study_app.doctor import recount
from study_app.models import Pair, PairCount, Participant, Trial
from study_app.services import Answer, Arrival
from study_app.stimuli import PairPlan, StudyPlan

LEASE = timedelta(minutes=30)
MOTIONS = 6
PEOPLE = st.integers(0, 30)


def plan() -> StudyPlan:
    """One room, two baselines, six motions; two trials a cell and one catch trial."""
    config = parse_study(
        {
            "study_id": "machine", "title": "t", "question": "q", "target": "a",
            "baselines": ["b", "c"], "trials_per_cell": 2, "extra_trials": {"catch": 1},
        },
        "test",
    )  # fmt: skip
    cells = tuple(study_cells(["room"], "a", ["b", "c"], "target"))
    pairs = [
        PairPlan("main", clip("a", m), clip(cell.baseline, m), index)
        for index, cell in enumerate(cells)
        for m in range(MOTIONS)
    ]
    pairs.append(PairPlan("catch", clip("a", 99), clip("lifted", 99), expected="a"))
    return StudyPlan(config, Path("/nowhere"), "0" * 64, cells, tuple(pairs))


def clip(method: str, motion: int) -> Clip:
    name = f"{method}-{motion}"
    return Clip(
        clip_id=name, file=name, sha256=name, frames_sha256="", poster="", role="main",
        method=method, scene="room", motion=f"m{motion}", views=(), tiling="grid", fps=20.0,
        n_frames=20, duration_s=1.0, width=320, height=180, codec="h264", scores={}, placement="",
    )  # fmt: skip


class Crowd(RuleBasedStateMachine):
    """People come, answer, vanish, come back late, withdraw, are excluded, in any order."""

    @initialize()
    def open_a_study(self) -> None:
        self.folder = TemporaryDirectory()
        self.database = Database(f"sqlite:///{self.folder.name}/s.sqlite")
        upgrade(self.database)
        self.now = datetime(2026, 1, 1, tzinfo=UTC)
        self.do(lambda session: studies.create_study(session, plan(), self.now))
        self.do(lambda session: studies.open_study(session, "machine", "live", self.now))
        self.version = self.do(lambda session: studies.find_study(session, "machine").id)
        self.people: list[int] = []
        self.disturbances = 0
        self.seconds = itertools.count(1)

    def do(self, work: Any) -> Any:
        return self.database.retry(work)

    @rule()
    def somebody_enters(self) -> None:
        arrival = Arrival("live", "consent")
        enrolled = self.do(lambda s: services.enrol(s, self.version, arrival, self.now))
        self.people.append(enrolled[0])

    @rule(who=PEOPLE, answer=st.booleans())
    def somebody_opens_the_page_and_perhaps_answers(self, who: int, answer: bool) -> None:
        if not self.people:
            return
        person = self.people[who % len(self.people)]
        services.bind_window(self.database, person, self.now, 4, LEASE)
        trial = self.do(lambda s: services.show_trial(s, person, self.now, LEASE))
        if trial is not None and answer:
            self.answer(person, trial.token)

    def answer(self, person: int, token: str) -> None:
        answer = Answer(str(uuid.UUID(int=next(self.seconds))), "first")
        for _ in range(2):  # every answer comes twice
            self.do(lambda s: services.record_answer(s, person, token, answer, self.now, LEASE))

    @rule(who=PEOPLE)
    def somebody_answers_whatever_the_page_still_shows(self, who: int) -> None:
        with self.database.read() as session:
            shown = session.execute(
                select(Trial.participant_id, Trial.token)
                .where(Trial.state.in_(("shown", "expired")), Trial.shown_at.is_not(None))
                .order_by(Trial.id)
            ).all()
        if shown:
            self.answer(*shown[who % len(shown)])

    @rule(minutes=st.integers(1, 45))
    def time_passes_and_leases_expire(self, minutes: int) -> None:
        self.now += timedelta(minutes=minutes)
        self.disturbances += self.do(lambda s: sweep(s, self.version, self.now))

    @rule(who=PEOPLE)
    def a_clip_fails_and_the_pair_is_skipped(self, who: int) -> None:
        if not self.people:
            return
        person = self.people[who % len(self.people)]
        trial = self.do(lambda s: services.show_trial(s, person, self.now, LEASE))
        if trial is not None and trial.token is not None:
            self.do(lambda s: services.skip_trial(s, person, trial.token, self.now, LEASE))
            self.disturbances += 1

    @rule(who=PEOPLE, excluded=st.booleans())
    def somebody_is_excluded_or_taken_back(self, who: int, excluded: bool) -> None:
        if not self.people:
            return
        person = self.people[who % len(self.people)]
        with self.database.read() as session:
            code = session.get_one(Participant, person).code
        self.do(lambda s: studies.exclude_participant(s, "machine", code, excluded, self.now))
        self.disturbances += 5

    @rule(who=PEOPLE)
    def somebody_withdraws(self, who: int) -> None:
        if self.people:
            person = self.people.pop(who % len(self.people))
            self.do(lambda s: services.withdraw(s, person, self.now))
            self.disturbances += 5

    @rule()
    def the_server_restarts(self) -> None:
        self.database.close()
        self.database = Database(self.database.url)

    @invariant()
    def counters_equal_a_recount(self) -> None:
        with self.database.read() as session:
            truth = recount(session, self.version)
            stored: Counter[tuple[int, str, bool]] = Counter()
            for row in session.scalars(select(PairCount)):
                stored[row.pair_id, row.mode, True] = row.target_first
                stored[row.pair_id, row.mode, False] = row.target_second
            seated = session.execute(
                select(Trial.pair_id, Participant.mode, Trial.target_first)
                .join(Trial.participant)
                .where(Trial.counted.is_(True))
            )
            marked = Counter((pair, mode, first) for pair, mode, first in seated)
        assert +stored == +truth == +marked

    @invariant()
    def nobody_meets_a_stimulus_twice(self) -> None:
        with self.database.read() as session:
            met = session.execute(
                select(Trial.participant_id, Pair.motion)
                .join(Pair, Pair.id == Trial.pair_id)
                .where(Trial.kind == "main")
            ).all()
        assert len(met) == len(set(met))

    @invariant()
    def sides_of_a_pair_stay_even_up_to_what_was_disturbed(self) -> None:
        with self.database.read() as session:
            rows = session.execute(
                select(PairCount.target_first, PairCount.target_second).join(
                    Pair, Pair.id == PairCount.pair_id
                )
            ).all()
        assert max(abs(first - second) for first, second in rows) <= 1 + self.disturbances

    def teardown(self) -> None:
        self.database.close()
        self.folder.cleanup()


FEW = settings(
    max_examples=12,
    stateful_step_count=25,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)


def test_any_interleaving_keeps_counters_exact_and_sides_even() -> None:
    run_state_machine_as_test(Crowd, settings=FEW)


@pytest.mark.slow
def test_many_long_interleavings_keep_counters_exact_and_sides_even() -> None:
    run_state_machine_as_test(
        Crowd, settings=settings(FEW, max_examples=200, stateful_step_count=60)
    )

"""Binding concrete pairs to seats, just in time, in short transactions; leases and their counters.

A counter of a pair is changed in the transaction that changes `Trial.counted`, always by SQL
increment, under the lock of the pair's cell (PostgreSQL) or of the whole file (SQLite). The choice
itself is `design.py`'s.
"""

from __future__ import annotations

from collections import Counter
from datetime import datetime, timedelta
from random import Random

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from study_app import design
from study_app.models import (
    OPEN_STATES,
    Cell,
    Pair,
    PairCount,
    Participant,
    StudyVersion,
    Trial,
)
from study_app.studies import study_config
from study_app.tokens import new_token


def lock_participant(session: Session, participant_id: int) -> Participant:
    """The participant, with every other request of this person held off until we are done."""
    participant = session.scalar(
        select(Participant).where(Participant.id == participant_id).with_for_update(of=Participant)
    )
    assert participant is not None
    return participant


def bind_next(
    session: Session, participant_id: int, now: datetime, window: int, lease: timedelta
) -> bool:
    """Bind the first seat inside the window that has no living lease; True if another one waits.

    One seat a transaction, so that no two transactions ever wait for each other's cells.
    """
    participant = lock_participant(session, participant_id)
    waiting = [trial for trial in seats_ahead(participant)[:window] if not _is_leased(trial, now)]
    if waiting:
        _bind(session, participant, waiting[0], now)
        if waiting[0].state != "void":
            waiting[0].state = "leased" if waiting[0].shown_at is None else "shown"
            waiting[0].lease_expires_at = now + lease
    return len(waiting) > 1 or any(trial.state == "void" for trial in waiting)


def _is_leased(trial: Trial, now: datetime) -> bool:
    return (
        trial.state in OPEN_STATES
        and trial.lease_expires_at is not None
        and trial.lease_expires_at > now
    )


def seats_ahead(participant: Participant) -> list[Trial]:
    """Trials still to be answered, the present one first."""
    return [trial for trial in participant.trials if trial.state not in ("answered", "void")]


def renew_leases(
    session: Session, participant: Participant, now: datetime, lease: timedelta
) -> None:
    """Any sign of life keeps all living leases of a person alive."""
    session.execute(
        update(Trial)
        .where(Trial.participant_id == participant.id, Trial.state.in_(OPEN_STATES))
        .where(Trial.lease_expires_at > now)
        .values(lease_expires_at=now + lease),
        execution_options={"synchronize_session": False},
    )


def sweep(session: Session, version_id: int, now: datetime, cell_id: int | None = None) -> int:
    """Free expired leases, of one cell or of the whole study; return how many.

    Rows that their participant is working on this moment are left for later.
    """
    query = (
        select(Trial, Participant.mode)
        .join(Trial.participant)
        .where(Participant.version_id == version_id)
        .where(Trial.state.in_(OPEN_STATES), Trial.lease_expires_at <= now)
        .with_for_update(of=Trial, skip_locked=True)
    )
    if cell_id is not None:
        query = query.where(Trial.cell_id == cell_id, Trial.kind == "main")
    swept = session.execute(query.order_by(Trial.id)).all()
    for trial, mode in swept:
        count(session, trial, mode, counted=False)
        trial.state = "expired"
    return len(swept)


def count(session: Session, trial: Trial, mode: str, *, counted: bool) -> None:
    """Put a trial into its pair's counter or take it out; does nothing when it is so already."""
    if trial.counted == counted or trial.pair_id is None or trial.kind == "repeat":
        return
    step = 1 if counted else -1
    column = PairCount.target_first if trial.target_first else PairCount.target_second
    session.execute(
        update(PairCount)
        .where(PairCount.pair_id == trial.pair_id, PairCount.mode == mode)
        .values({column: column + step}),
        execution_options={"synchronize_session": False},
    )
    trial.counted = counted


def _bind(session: Session, participant: Participant, trial: Trial, now: datetime) -> None:
    if trial.kind == "repeat":
        _bind_repeat(participant, trial)
    else:
        _lock(session, participant, trial)
        if trial.kind == "main":
            sweep(session, participant.version_id, now, trial.cell_id)
        if trial.pair_id is None:
            choice = _choose(session, participant, trial)
            _seat_pair(session, participant, trial, choice)
        count(session, trial, participant.mode, counted=not participant.excluded)
    if trial.token is None and trial.pair_id is not None:
        trial.token, trial.first_token, trial.second_token = new_token(), new_token(), new_token()


def _lock(session: Session, participant: Participant, trial: Trial) -> None:
    """The cell's row guards its pairs; pairs outside the cells are guarded by the version's row."""
    if trial.cell_id is not None:
        session.execute(select(Cell.id).where(Cell.id == trial.cell_id).with_for_update())
    else:
        version = select(StudyVersion.id).where(StudyVersion.id == participant.version_id)
        session.execute(version.with_for_update())


def _bind_repeat(participant: Participant, trial: Trial) -> None:
    source = next(one for one in participant.trials if one.ordinal == trial.repeat_of)
    if source.state == "void":
        trial.state = "void"
        return
    trial.pair_id, trial.target_first = source.pair_id, not source.target_first


def _choose(session: Session, participant: Participant, trial: Trial) -> design.Binding:
    config = study_config(participant.version)
    if trial.kind == "main" and config.policy == "list":
        return _prepared(session, participant, trial)
    loads = _loads(session, participant, trial)
    person = _person(session, participant, trial)
    rng = Random(f"{config.seed}|{participant.mode}|{participant.serial}|{trial.ordinal}")
    if trial.kind != "main":
        return design.choose_balanced(loads, person, rng)
    choices = design.allowed(loads, person, config.repeat_scene_motion)
    return design.POLICIES[config.policy](choices, person, rng)


def _prepared(session: Session, participant: Participant, trial: Trial) -> design.Binding:
    """Policy `list`: the plan of this participant's list already names pair and side."""
    lists = participant.version.lists
    row = lists[(participant.serial - 1) % len(lists)][_main_index(participant, trial)]
    pair_id = session.scalar(
        select(Pair.id).where(
            Pair.cell_id == trial.cell_id, Pair.kind == "main", Pair.motion == row["motion"]
        )
    )
    assert pair_id is not None, "lists are checked when the study is created"
    return design.Binding(pair_id, row["first"] == "target")


def _main_index(participant: Participant, trial: Trial) -> int:
    mains = [one.ordinal for one in participant.trials if one.kind == "main"]
    return mains.index(trial.ordinal)


def _loads(session: Session, participant: Participant, trial: Trial) -> list[design.PairLoad]:
    query = (
        select(Pair.id, Pair.scene, Pair.motion, PairCount.target_first, PairCount.target_second)
        .join(PairCount, PairCount.pair_id == Pair.id)
        .where(PairCount.mode == participant.mode, Pair.kind == trial.kind)
        .where(Pair.version_id == participant.version_id)
        .order_by(Pair.id)
    )
    if trial.kind == "main":
        query = query.where(Pair.cell_id == trial.cell_id)
    return [
        design.PairLoad(pair, f"{scene}|{motion}", first, second)
        for pair, scene, motion, first, second in session.execute(query)
    ]


def _person(session: Session, participant: Participant, trial: Trial) -> design.Person:
    """What this person met before, over all seats that hold a pair (also expired ones: they saw it)."""
    cells = {cell.id: (cell.target, cell.baseline) for cell in participant.version.cells}
    here = cells.get(trial.cell_id or 0)
    met = session.execute(
        select(Trial.kind, Trial.cell_id, Trial.target_first, Pair.id, Pair.scene, Pair.motion)
        .join(Pair, Pair.id == Trial.pair_id)
        .where(Trial.participant_id == participant.id)
    ).all()
    mains = [row for row in met if row.kind == "main"]
    leans = [(cells[row.cell_id], 1 if row.target_first else -1) for row in mains]
    return design.Person(
        stimuli=Counter(f"{row.scene}|{row.motion}" for row in mains),
        pairs=Counter(row.id for row in met),
        lean=sum(side for method_pair, side in leans if method_pair == here),
        lean_total=sum(side for _, side in leans),
    )


def _seat_pair(
    session: Session, participant: Participant, trial: Trial, choice: design.Binding
) -> None:
    pair = session.get_one(Pair, choice.pair)
    trial.pair, trial.target_first = pair, choice.target_first
    if trial.kind == "main" and not participant.version.config["repeat_scene_motion"]:
        trial.exposure_key = pair.stimulus
    session.flush()

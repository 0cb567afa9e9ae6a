"""A crowd in one process for the race tests: threads that enrol people and answer, each answer twice.

Run as `python race.py URL VERSION_ID THREADS PEOPLE_A_THREAD`; prints one line a finished person.
"""

from __future__ import annotations

import sys
import uuid
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from typing import TypeVar

from sqlalchemy.exc import OperationalError

from study_app import services
from study_app.db import Database

LEASE = timedelta(minutes=30)
SENDINGS = 12
T = TypeVar("T")


def one_person(database: Database, version_id: int) -> None:
    """Enrol, answer every trial (each answer twice, as double clicks do), finish."""
    arrival = services.Arrival("live", "consent")
    person, _ = sent(
        lambda: database.retry(lambda s: services.enrol(s, version_id, arrival, now()))
    )
    while True:
        sent(lambda: services.bind_window(database, person, now(), 4, LEASE))
        token = sent(lambda: database.retry(lambda s: shown(s, person)))
        if token is None:
            break
        answer_twice(database, person, token)
    sent(lambda: database.retry(lambda s: services.finish(s, person, now())))
    sys.stdout.write(f"{person}\n")
    sys.stdout.flush()


def answer_twice(database: Database, person: int, token: str) -> None:
    answer = services.Answer(str(uuid.uuid4()), "first")
    for _ in range(2):
        sent(
            lambda: database.retry(
                lambda s: services.record_answer(s, person, token, answer, now(), LEASE)
            )
        )


def sent(request: Callable[[], T]) -> T:
    """What a request answers; sent again, as the page does, where the database was busy too long.

    SQLite lets whoever asks next write next: among 64 threads on a loaded machine one may wait for
    longer than the server's ten seconds.
    """
    for _ in range(SENDINGS - 1):
        try:
            return request()
        except OperationalError:
            continue
    return request()


def shown(session: object, person: int) -> str | None:
    trial = services.show_trial(session, person, now(), LEASE)
    return None if trial is None else trial.token


def now() -> datetime:
    return datetime.now(UTC)


def main() -> None:
    url, version_id, threads, people = sys.argv[1], *map(int, sys.argv[2:5])
    database = Database(url)
    with ThreadPoolExecutor(threads) as pool:
        work = [pool.submit(one_person, database, version_id) for _ in range(threads * people)]
        for one in work:
            one.result()
    database.close()


if __name__ == "__main__":
    main()

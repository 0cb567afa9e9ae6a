"""The study design: cells, sessions, and which pair a person sees next on which side.

Pure: the standard library only, no database, no clock; randomness comes in as a `random.Random`.
The database layer and the balance certificate call the same functions, so what is proven about one
holds for the other.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Literal

Kind = Literal["main", "catch", "identical", "repeat", "practice"]
PairMode = Literal["target", "all"]
REPEAT_DISTANCE = 15
"""A repeated pair comes back at least so many trials later, when the first answer is forgotten."""


@dataclass(frozen=True, order=True)
class Cell:
    """One scene and one method pair; every block of a session holds every cell once."""

    scene: str
    target: str
    baseline: str


@dataclass(frozen=True)
class Extras:
    """How many trials of each other kind a session has beside the main ones."""

    catch: int = 0
    identical: int = 0
    repeat: int = 0
    practice: int = 0


@dataclass(frozen=True)
class PlannedTrial:
    """A seat in a session before a concrete pair is bound to it. Ordinals start at 1."""

    ordinal: int
    block: int
    kind: Kind
    cell: int | None = None
    """Index into the cells, main trials only."""
    repeat_of: int | None = None
    """Ordinal of the main trial that is shown again with its sides flipped."""


@dataclass(frozen=True)
class PairLoad:
    """A pair with its present load: views that are done or under way, by side of the target."""

    pair: int
    stimulus: str
    """`scene|motion`; nobody sees one twice in main trials unless the study allows it."""
    target_first: int
    target_second: int

    @property
    def views(self) -> int:
        """Number of times that the pair is counted as shown."""
        return self.target_first + self.target_second


@dataclass(frozen=True)
class Person:
    """What one participant has met so far, as far as the next choice depends on it."""

    stimuli: Mapping[str, int] = field(default_factory=dict)
    pairs: Mapping[int, int] = field(default_factory=dict)
    lean: int = 0
    """Trials with the target first minus trials with it second, within this method pair."""
    lean_total: int = 0
    """The same over all main trials."""


@dataclass(frozen=True)
class Binding:
    """The answer of a policy: the pair, and whether its target stands first."""

    pair: int
    target_first: bool


Policy = Callable[[Sequence[PairLoad], Person, Random], Binding]


def method_pairs(target: str, baselines: Sequence[str], pairs: PairMode) -> list[tuple[str, str]]:
    """The method pairs of a study, (target, baseline), in the order of the study file."""
    if pairs == "target":
        return [(target, baseline) for baseline in baselines]
    return list(itertools.combinations([target, *baselines], 2))


def study_cells(
    scenes: Sequence[str], target: str, baselines: Sequence[str], pairs: PairMode
) -> list[Cell]:
    """All cells: scene x method pair (paper: 4 scenes x 3 baselines = 12)."""
    return [
        Cell(scene, one, other)
        for scene in scenes
        for one, other in method_pairs(target, baselines, pairs)
    ]


def motions_needed(n_method_pairs: int, trials_per_cell: int) -> int:
    """Distinct motions that each scene must have so that nobody meets a (scene, motion) twice."""
    return n_method_pairs * trials_per_cell


def shortest_session(extras: Extras) -> int:
    """Trials besides practice and repeats that the asked-for repeats need before and after them."""
    return REPEAT_DISTANCE + extras.repeat - 1 if extras.repeat else 0


def plan_session(
    n_cells: int, trials_per_cell: int, extras: Extras, rng: Random
) -> list[PlannedTrial]:
    """The seats of one session: practice first, then blocks that each hold every cell once.

    A participant who leaves early has then seen all cells equally often up to one block. Catch and
    identical trials lie one each in equal stretches of the session, at a random place inside.
    """
    seats = [
        _Seat("main", block, cell)
        for block in range(1, trials_per_cell + 1)
        for cell in rng.sample(range(n_cells), n_cells)
    ]
    _spread(seats, "catch", extras.catch, rng)
    _spread(seats, "identical", extras.identical, rng)
    _insert_repeats(seats, extras.repeat, rng)
    seats[:0] = [_Seat("practice", 0) for _ in range(extras.practice)]
    ordinals = {id(seat): ordinal for ordinal, seat in enumerate(seats, start=1)}
    return [
        PlannedTrial(
            ordinals[id(seat)],
            seat.block,
            seat.kind,
            seat.cell,
            ordinals[id(seat.source)] if seat.source else None,
        )
        for seat in seats
    ]


@dataclass(eq=False)
class _Seat:
    kind: Kind
    block: int
    cell: int | None = None
    source: _Seat | None = None


def _spread(seats: list[_Seat], kind: Kind, count: int, rng: Random) -> None:
    """Insert `count` seats, one in each of `count` equal stretches (never as the very first)."""
    length = len(seats)
    places = [
        rng.randint(max(1, length * i // count), max(1, length * (i + 1) // count))
        for i in range(count)
    ]
    for place in sorted(places, reverse=True):
        seats.insert(place, _Seat(kind, seats[place - 1].block))


def _insert_repeats(seats: list[_Seat], count: int, rng: Random) -> None:
    """Insert repeats at least `REPEAT_DISTANCE` after their sources; later insertions only widen it."""
    early = [
        seat for seat in seats[: max(0, len(seats) - REPEAT_DISTANCE + 1)] if seat.kind == "main"
    ]
    for source in rng.sample(early, count):
        place = rng.randint(seats.index(source) + REPEAT_DISTANCE, len(seats))
        seats.insert(place, _Seat("repeat", seats[place - 1].block, source=source))


def allowed(loads: Sequence[PairLoad], person: Person, repeat_stimuli: bool) -> list[PairLoad]:
    """The pairs of a cell that this person may still see; all of them where repeats are allowed."""
    if repeat_stimuli:
        return list(loads)
    return [load for load in loads if not person.stimuli.get(load.stimulus)]


def choose_balanced(loads: Sequence[PairLoad], person: Person, rng: Random) -> Binding:
    """Least-filled pair first; among those one whose needed side this person needs too.

    Counting what is under way, not only what is done, keeps a wave of simultaneous arrivals from
    all getting the same pair.
    """
    rest = min((_burden(load, person) for load in loads), default=None)
    if rest is None:
        raise ValueError("no pair left in this cell for this person")
    least = [load for load in loads if _burden(load, person) == rest]
    fitting = [load for load in least if _pair_need(load) * _person_need(person) >= 0]
    load = rng.choice(fitting or least)
    need = _pair_need(load) or _person_need(person) or rng.choice((1, -1))
    return Binding(load.pair, need > 0)


def _burden(load: PairLoad, person: Person) -> tuple[int, int, int]:
    """Order of preference: unseen by the person, least filled, stimulus least seen by the person."""
    return (person.pairs.get(load.pair, 0), load.views, person.stimuli.get(load.stimulus, 0))


def _pair_need(load: PairLoad) -> int:
    """1 if the pair lacks views with the target first, -1 if second, 0 if it is even."""
    return _sign(load.target_second - load.target_first)


def _person_need(person: Person) -> int:
    """The same for the person: within this method pair, else over all main trials."""
    return _sign(-person.lean) or _sign(-person.lean_total)


def _sign(number: int) -> int:
    return (number > 0) - (number < 0)


def choose_random(loads: Sequence[PairLoad], person: Person, rng: Random) -> Binding:
    """The paper's scheme: any pair, either side (it leaves pairs unseen; kept for replication)."""
    if not loads:
        raise ValueError("no pair left in this cell for this person")
    return Binding(rng.choice(loads).pair, rng.random() < 0.5)


POLICIES: dict[str, Policy] = {"balanced": choose_balanced, "random": choose_random}

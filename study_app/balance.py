"""The balance certificate: how evenly a design will fill before anybody is asked.

The real choice functions of `design.py` run over simulated arrivals with a fake clock: people come
at random, about twenty at a time, bind pairs in a window ahead, and some drop out silently so that
their leases must expire first. No database.
"""

from __future__ import annotations

import heapq
import itertools
from collections import Counter
from dataclasses import dataclass, field
from random import Random
from typing import Any

from renderer.files import InputError
from study_app import design
from study_app.config import StudyConfig

SECONDS_PER_TRIAL = 20.0
AT_A_TIME = 20
LEASE_S = 1800.0
WINDOW = 4
_ROWS = (
    ("views a pair", "views_per_pair"),
    ("pairs never seen", "unseen_pairs"),
    ("largest side difference in a pair", "side_difference_max"),
    ("target first, a person", "first_per_person"),
    ("target first, a person and method pair", "first_per_person_pair"),
    ("views a cell", "views_per_cell"),
)


@dataclass(frozen=True)
class Design:
    """What balance depends on."""

    cells: tuple[design.Cell, ...]
    motions: int
    trials_per_cell: int
    repeat_stimuli: bool = False


PAPER = Design(
    tuple(
        design.study_cells(
            ("scene1", "scene2", "scene3", "scene4"),
            "pace",
            ("posa_t", "synthesis", "paak"),
            "target",
        )
    ),
    motions=100,
    trials_per_cell=5,
)
"""4 scenes x 3 baselines x 100 motions = 1200 pairs; 60 trials a person."""


def design_of(config: StudyConfig, motions: int, source: object) -> Design:
    """The design of a study file, with `motions` in every scene."""
    if not config.scenes:
        raise InputError(source, "scenes", "nothing", "named scenes, as no catalogue is looked at")
    cells = design.study_cells(config.scenes, config.target, config.baselines, config.pairs)
    n_pairs = len(design.method_pairs(config.target, config.baselines, config.pairs))
    needed = design.motions_needed(n_pairs, config.trials_per_cell)
    if not config.repeat_scene_motion and motions < needed:
        raise InputError(source, "motions", motions, f"at least {needed} a scene")
    return Design(tuple(cells), motions, config.trials_per_cell, config.repeat_scene_motion)


def certificate(plan: Design, participants: int, dropout: float, seed: int) -> dict[str, Any]:
    """Balance figures of the policy `balanced`, and under `random` those of the paper's scheme."""
    result = _run(plan, participants, dropout, seed, design.choose_balanced)
    scheme = _run(plan, participants, dropout, seed, design.choose_random)
    return {
        "participants": participants,
        "dropout": dropout,
        "seed": seed,
        "pairs": len(plan.cells) * plan.motions,
        "trials": len(plan.cells) * plan.trials_per_cell,
        **result,
        "random": scheme,
    }


def table(result: dict[str, Any]) -> str:
    """The certificate as lines of text."""
    head = (
        f"{result['participants']} participants, {100 * result['dropout']:g} % dropout, "
        f"{result['pairs']} pairs, {result['trials']} main trials a person (seed {result['seed']})"
    )
    lines = [head, f"{'':40s}{'balanced':>14s}{'random':>14s}"]
    for label, key in _ROWS:
        cells = [_shown(result[key]), _shown(result["random"][key])]
        lines.append(f"{label:40s}{cells[0]:>14s}{cells[1]:>14s}")
    return "\n".join(lines)


def _shown(value: Any) -> str:
    return f"{value['min']} to {value['max']}" if isinstance(value, dict) else str(value)


@dataclass
class _Visitor:
    number: int
    plan: list[design.PlannedTrial]
    leaves_at: int
    """Index of the trial at which the person silently leaves; the plan's length = stays."""
    rng: Random
    next: int = 0
    bound: dict[int, design.Binding] = field(default_factory=dict)
    stimuli: Counter[str] = field(default_factory=Counter)
    pairs: Counter[int] = field(default_factory=Counter)
    leans: Counter[tuple[str, str]] = field(default_factory=Counter)

    @property
    def finished(self) -> bool:
        return self.next == len(self.plan)


class _Ledger:
    """Counters in memory, as the database keeps them."""

    def __init__(self, plan: Design, policy: design.Policy) -> None:
        self.plan, self.policy = plan, policy
        self.first: Counter[int] = Counter()
        self.second: Counter[int] = Counter()

    def pairs_of(self, cell: int) -> range:
        return range(cell * self.plan.motions, (cell + 1) * self.plan.motions)

    def stimulus(self, pair: int) -> str:
        cell, motion = divmod(pair, self.plan.motions)
        return f"{self.plan.cells[cell].scene}|{motion}"

    def bind(self, visitor: _Visitor, index: int) -> None:
        cell_index = visitor.plan[index].cell
        assert cell_index is not None
        cell = self.plan.cells[cell_index]
        methods = (cell.target, cell.baseline)
        loads = [
            design.PairLoad(pair, self.stimulus(pair), self.first[pair], self.second[pair])
            for pair in self.pairs_of(cell_index)
        ]
        person = design.Person(
            visitor.stimuli, visitor.pairs, visitor.leans[methods], visitor.leans.total()
        )
        choices = design.allowed(loads, person, self.plan.repeat_stimuli)
        choice = self.policy(choices, person, visitor.rng)
        visitor.bound[index] = choice
        visitor.stimuli[self.stimulus(choice.pair)] += 1
        visitor.pairs[choice.pair] += 1
        visitor.leans[methods] += 1 if choice.target_first else -1
        self.count(choice, 1)

    def count(self, choice: design.Binding, step: int) -> None:
        side = self.first if choice.target_first else self.second
        side[choice.pair] += step


def _run(
    plan: Design, participants: int, dropout: float, seed: int, policy: design.Policy
) -> dict[str, Any]:
    rng = Random(f"balance|{seed}")
    ledger, visitors = _Ledger(plan, policy), _visitors(plan, participants, dropout, seed, rng)
    session_s = len(visitors[0].plan) * SECONDS_PER_TRIAL
    order = itertools.count()
    clock, events = 0.0, list[tuple[float, int, str, _Visitor]]()
    for visitor in visitors:
        clock += rng.expovariate(AT_A_TIME / session_s)
        heapq.heappush(events, (clock, next(order), "arrive", visitor))
    while events:
        now, _, kind, visitor = heapq.heappop(events)
        if kind == "expire":
            _expire(ledger, visitor)
            continue
        if kind == "answer":
            visitor.next += 1
        if visitor.finished:
            continue
        for index in range(visitor.next, min(visitor.next + WINDOW, len(visitor.plan))):
            if index not in visitor.bound:
                ledger.bind(visitor, index)
        leaves = visitor.next >= visitor.leaves_at
        wait = LEASE_S if leaves else rng.expovariate(1 / SECONDS_PER_TRIAL)
        follow = "expire" if leaves else "answer"
        heapq.heappush(events, (now + wait, next(order), follow, visitor))
    return _figures(plan, ledger, visitors)


def _visitors(
    plan: Design, participants: int, dropout: float, seed: int, rng: Random
) -> list[_Visitor]:
    visitors = []
    for number in range(participants):
        own = Random(f"balance|{seed}|{number}")
        session = design.plan_session(len(plan.cells), plan.trials_per_cell, design.Extras(), own)
        leaves = rng.randrange(len(session)) if rng.random() < dropout else len(session)
        visitors.append(_Visitor(number, session, leaves, own))
    return visitors


def _expire(ledger: _Ledger, visitor: _Visitor) -> None:
    for index in [index for index in visitor.bound if index >= visitor.next]:
        ledger.count(visitor.bound.pop(index), -1)


def _figures(plan: Design, ledger: _Ledger, visitors: list[_Visitor]) -> dict[str, Any]:
    pairs = range(len(plan.cells) * plan.motions)
    views = [ledger.first[pair] + ledger.second[pair] for pair in pairs]
    cells = [sum(views[pair] for pair in ledger.pairs_of(c)) for c in range(len(plan.cells))]
    stayed = [visitor for visitor in visitors if visitor.finished]
    by_pair = [count for visitor in stayed for count in _first_by_method_pair(plan, visitor)]
    return {
        "views_per_pair": _range(views),
        "unseen_pairs": views.count(0),
        "side_difference_max": max(abs(ledger.first[p] - ledger.second[p]) for p in pairs),
        "first_per_person": _range(
            [sum(b.target_first for b in visitor.bound.values()) for visitor in stayed]
        ),
        "first_per_person_pair": _range(by_pair),
        "views_per_cell": _range(cells),
        "finished": len(stayed),
    }


def _first_by_method_pair(plan: Design, visitor: _Visitor) -> list[int]:
    counts = {(cell.target, cell.baseline): 0 for cell in plan.cells}
    for binding in visitor.bound.values():
        cell = plan.cells[binding.pair // plan.motions]
        counts[cell.target, cell.baseline] += binding.target_first
    return list(counts.values())


def _range(values: list[int]) -> dict[str, int]:
    return {"min": min(values, default=0), "max": max(values, default=0)}

"""What the result would be without one participant or stimulus, or with other participants."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy import special, stats

from analysis.cells import Cells
from analysis.clustered import clustered_rate

_CHUNK = 200


def leave_one_out(cells: Cells, level: float = 0.95) -> Float[np.ndarray, "P 3"]:
    """Rate, lower and upper headline bound without each participant in turn.

    Closed form: every sum of squares of the clustered variance is a quadratic in the rate whose
    coefficients lose the participant's own terms, so all P intervals cost one pass over the cells.
    `leave_one_out_slowly` is the obvious version. For stimuli pass the cells with swapped factors.
    """
    people, things = cells.participant, cells.stimulus
    k, n = cells.wins.astype(float), cells.answers.astype(float)
    size = cells.participants
    own_k, own_n = np.bincount(people, k), np.bincount(people, n)
    all_k, all_n = np.bincount(things, k), np.bincount(things, n)
    wins, answers = k.sum() - own_k, n.sum() - own_n
    usable = (wins > 0) & (wins < answers)
    rate = np.divide(wins, answers, out=np.full(size, 0.5), where=usable)

    def total(a: Float[np.ndarray, "X"], b: Float[np.ndarray, "X"]) -> float:
        return float(a @ b)

    def mine(values: Float[np.ndarray, "C"]) -> Float[np.ndarray, "P"]:
        return np.asarray(np.bincount(people, values, size))

    kk, kn, nn = mine(k * k), mine(k * n), mine(n * n)
    K, N = all_k[things], all_n[things]
    by_cell = _quadratic(rate, total(k, k) - kk, total(k, n) - kn, total(n, n) - nn)
    by_person = _quadratic(
        rate, total(own_k, own_k) - own_k**2, total(own_k, own_n) - own_k * own_n,
        total(own_n, own_n) - own_n**2,
    )  # fmt: skip
    by_thing = _quadratic(
        rate, total(all_k, all_k) - 2 * mine(K * k) + kk,
        total(all_k, all_n) - mine(K * n + N * k) + kn, total(all_n, all_n) - 2 * mine(N * n) + nn,
    )  # fmt: skip
    left = np.full(size, size - 1.0), cells.stimuli - mine((n == N).astype(float))
    groups = np.array([*left, len(k) - np.bincount(people, minlength=size)])
    with np.errstate(all="ignore"):
        v_person, v_thing, v_cell = (
            g / (g - 1) * q / (answers * rate * (1 - rate)) ** 2
            for g, q in zip(groups, (by_person, by_thing, by_cell), strict=True)
        )
        variance = np.maximum(v_person + v_thing - v_cell, np.maximum(v_person, v_thing))
        df = groups[:2].min(axis=0) - 1
        half = stats.t.ppf(0.5 + level / 2, df) * np.sqrt(variance)
        centre = np.log(wins / (answers - wins))
        bounds = special.expit(np.column_stack([centre - half, centre + half]))
    result = np.column_stack([rate, bounds])
    odd = ~usable | ~np.isfinite(result).all(axis=1) | ~(variance > 1e-12) | (df < 1)
    for person in np.flatnonzero(odd):
        result[person] = _without(cells, int(person), level)
    return np.asarray(result)


def leave_one_out_slowly(cells: Cells, level: float = 0.95) -> Float[np.ndarray, "P 3"]:
    """The same as `leave_one_out`, by estimating afresh without each participant."""
    return np.array([_without(cells, person, level) for person in range(cells.participants)])


def swapped(cells: Cells) -> Cells:
    """The same counts with participants and stimuli in each other's place."""
    return Cells(cells.stimulus, cells.participant, cells.wins, cells.answers)


def bootstrap_rates(
    participants: list[Int[np.ndarray, "C"]], many: list[Cells], replicates: int, seed: int
) -> Float[np.ndarray, "R M"]:
    """Rates of M comparisons in `replicates` draws of participants with replacement.

    `participants[m]` holds the study-wide participant code of every cell of comparison m; one draw
    serves all comparisons, so differences between them keep their dependence. A draw that leaves a
    comparison without answers gives its overall rate.
    """
    people = 1 + max(int(codes.max()) for codes in participants)
    wins, answers = np.zeros((people, len(many))), np.zeros((people, len(many)))
    for column, (codes, cells) in enumerate(zip(participants, many, strict=True)):
        wins[:, column] = np.bincount(codes, cells.wins, people)
        answers[:, column] = np.bincount(codes, cells.answers, people)
    present = answers.sum(axis=1) > 0
    wins, answers = wins[present], answers[present]
    rng, people = np.random.default_rng(seed), int(present.sum())
    overall = wins.sum(axis=0) / answers.sum(axis=0)
    rates = np.zeros((replicates, len(many)))
    for start in range(0, replicates, _CHUNK):
        size = min(_CHUNK, replicates - start)
        drawn = rng.integers(0, people, (size, people)) + people * np.arange(size)[:, None]
        weights = np.bincount(drawn.ravel(), minlength=size * people).reshape(size, people)
        k, n = weights @ wins, weights @ answers
        rates[start : start + size] = np.divide(
            k, n, out=np.broadcast_to(overall, k.shape).copy(), where=n > 0
        )
    return rates


def _quadratic(
    rate: Float[np.ndarray, "P"], kk: Float[np.ndarray, "P"], kn: Float[np.ndarray, "P"],
    nn: Float[np.ndarray, "P"],
) -> Float[np.ndarray, "P"]:  # fmt: skip
    """Sum over clusters of (k - rate n)^2, from the sums of k^2, k n and n^2."""
    return np.asarray(kk - 2 * rate * kn + rate**2 * nn)


def _without(cells: Cells, person: int, level: float) -> tuple[float, float, float]:
    keep = cells.participant != person
    if not keep.any():
        return 0.5, 0.0, 1.0
    rate = clustered_rate(cells.take(keep), level)
    return rate.rate, *rate.ci

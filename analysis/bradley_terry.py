"""One scale for all methods: Bradley-Terry (logistic) and Thurstone case V (probit) from paired choices.

P(first is chosen) = F(ability_first - ability_second + order), F logistic or normal (Bradley & Terry
1952; Thurstone 1927; order effect as in Davidson & Beaver 1977). In a star design, where every pair
holds the target, the scale only repeats the rates of the preference table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from scipy import optimize, sparse, stats
from scipy.sparse.csgraph import connected_components

MAX_STEPS = 100
_CLUSTER_BLOCK = 50_000
Link = Literal["logit", "probit"]


@dataclass(frozen=True)
class Duels:
    """Counts of ordered pairs; row d is what one cluster said of one (first, second)."""

    first: Int[np.ndarray, "D"]
    second: Int[np.ndarray, "D"]
    wins: Int[np.ndarray, "D"]
    """How often the first was chosen."""
    answers: Int[np.ndarray, "D"]


@dataclass(frozen=True)
class Scale:
    """A fitted scale; method 0 is the reference with ability zero."""

    ability: Float[np.ndarray, "K"]
    covariance: Float[np.ndarray, "K K"]
    """Assumes independent answers; row and column of the reference are zero."""
    order: float | None
    """Log odds (or probit) gained by standing first."""
    order_se: float | None
    log_likelihood: float
    parameters: int
    converged: bool


@dataclass(frozen=True)
class Graph:
    """What was compared with what."""

    components: int
    """More than one: groups of methods that were never compared; no common scale exists."""
    separated: bool
    """Some group of methods never lost to the rest: maximum likelihood has no finite answer."""
    pairs: int
    lack_of_fit_df: int
    """Pairs minus free abilities; zero means saturated (a star or any tree)."""


def fit_scale(duels: Duels, count: int, *, link: Link = "logit", order: bool = False) -> Scale:
    """Maximum likelihood by Fisher scoring on pair counts; equals R's BradleyTerry2 and `glm`.

    Raises `ValueError` when it does not converge, which `describe_graph` foresees (separation), and
    when the order effect cannot be told from the abilities.
    """
    first, second, wins, answers = _ordered_pairs(duels, count)
    design = _design(first, second, count, order)
    if np.linalg.matrix_rank(design) < design.shape[1]:
        raise ValueError("the abilities and the order effect cannot be told apart")
    beta = np.zeros(design.shape[1])
    for _ in range(MAX_STEPS):
        gradient, information = _score(design, beta, wins, answers, link)
        step = np.linalg.solve(information, gradient)
        beta += step * min(1.0, 4 / max(np.abs(step).max(), 1e-12))
        if np.abs(step).max() < 1e-10:
            break
    else:
        raise ValueError(f"no finite scale after {MAX_STEPS} steps: separated choices")
    information = _score(design, beta, wins, answers, link)[1]
    inverse = np.linalg.inv(information)
    covariance = np.zeros((count, count))
    covariance[1:, 1:] = inverse[: count - 1, : count - 1]
    return Scale(
        ability=np.concatenate([[0.0], beta[: count - 1]]), covariance=covariance,
        order=float(beta[-1]) if order else None,
        order_se=float(np.sqrt(inverse[-1, -1])) if order else None,
        log_likelihood=_log_likelihood(design @ beta, wins, answers, link),
        parameters=len(beta), converged=True,
    )  # fmt: skip


def fit_finite_scale(duels: Duels, count: int) -> tuple[Scale, list[str]]:
    """A scale that always exists for a connected graph, and what had to be given up for it.

    First with an order effect, then without, then with half an answer added on each side.
    """
    added = "separated choices: half an answer added on each side of every pair"
    confounded = "the order effect cannot be estimated from these sides"
    if not describe_graph(duels, count).separated:
        for order, flags in ((True, []), (False, [confounded])):
            try:
                return fit_scale(duels, count, order=order), flags
            except ValueError:
                continue
    finite = with_half_answers(duels)
    try:
        return fit_scale(finite, count, order=True), [added]
    except ValueError:
        return fit_scale(finite, count), [added, confounded]


def clustered_covariance(
    duels: Duels, scale: Scale, clusters: Int[np.ndarray, "D"], *, link: Link = "logit"
) -> Float[np.ndarray, "K K"]:
    """Sandwich covariance of the abilities, clustered; equals R's `vcovCL(type = "HC1")`."""
    count, order = len(scale.ability), scale.order is not None
    beta = scale.ability[1:] if scale.order is None else np.append(scale.ability[1:], scale.order)
    first, second, wins, answers = _ordered_pairs(duels, count)
    information = _score(_design(first, second, count, order), beta, wins, answers, link)[1]
    eta = scale.ability[duels.first] - scale.ability[duels.second] + (scale.order or 0.0)
    slope = _slope(eta, duels.wins, duels.answers, link)
    groups = int(clusters.max()) + 1
    meat = _meat(duels, clusters, slope, count, order)
    bread = np.linalg.inv(information)
    n, k = duels.answers.sum(), len(beta)
    factor = groups / (groups - 1) * (n - 1) / max(n - k, 1)
    middle = bread @ meat @ bread * factor
    full = np.zeros((count, count))
    full[1:, 1:] = middle[: count - 1, : count - 1]
    return full


def two_way_covariances(
    duels: Duels, scale: Scale, people: Int[np.ndarray, "D"], stimuli: Int[np.ndarray, "D"]
) -> tuple[Float[np.ndarray, "K K"], ...]:
    """Covariances of the abilities: participant x stimulus, by participant, by stimulus.

    A variance is the largest that the three give (`centred`), as in the preference table, because
    the two-way sum can fall below its parts. With a single participant or stimulus nothing can be
    clustered: only that of independent answers.
    """
    if people.max() == 0 or stimuli.max() == 0:
        return (scale.covariance,)
    both = np.unique(
        people.astype(np.int64) * (int(stimuli.max()) + 1) + stimuli, return_inverse=True
    )[1]
    a, b, c = (clustered_covariance(duels, scale, groups) for groups in (people, stimuli, both))
    return a + b - c, a, b


def centred(
    scale: Scale, *covariances: Float[np.ndarray, "K K"]
) -> tuple[Float[np.ndarray, "K"], Float[np.ndarray, "K"]]:
    """Abilities relative to their mean, and their standard errors: the largest of all covariances."""
    count = len(scale.ability)
    centring = np.eye(count) - 1 / count
    spreads = [np.diag(centring @ covariance @ centring.T) for covariance in covariances]
    return centring @ scale.ability, np.sqrt(np.maximum(np.max(spreads, axis=0), 0))


def quasi_variances(covariance: Float[np.ndarray, "K K"]) -> Float[np.ndarray, "K"]:
    """Variances q with q_i + q_j close to the variance of every difference (Firth & de Menezes 2004).

    Least squares on the logarithm, as R's `qvcalc`; with them two intervals may be compared by eye.
    """
    i, j = np.triu_indices(len(covariance), 1)
    wanted = np.log(covariance[i, i] + covariance[j, j] - 2 * covariance[i, j])
    start = np.log(np.full(len(covariance), np.exp(wanted).mean() / 2))

    def misfit(logs: Float[np.ndarray, "K"]) -> Float[np.ndarray, "E"]:
        return np.asarray(np.log(np.exp(logs[i]) + np.exp(logs[j])) - wanted)

    return np.exp(optimize.least_squares(misfit, start, xtol=1e-12, ftol=1e-12).x)


def describe_graph(duels: Duels, count: int) -> Graph:
    """Connectedness, separation (Ford 1957: the graph of wins must be strongly connected), saturation."""
    beats = np.zeros((count, count))
    np.add.at(beats, (duels.first, duels.second), duels.wins)
    np.add.at(beats, (duels.second, duels.first), duels.answers - duels.wins)
    met = beats + beats.T > 0
    parts = int(connected_components(sparse.csr_matrix(met.astype(float)), directed=False)[0])
    strong = connected_components(
        sparse.csr_matrix((beats > 0).astype(float)), connection="strong"
    )[0]
    pairs = int(np.triu(met, 1).sum())
    return Graph(parts, parts == 1 and strong > 1, pairs, pairs - (count - parts))


def with_half_answers(duels: Duels) -> Duels:
    """Half an answer added for and against in every ordered pair that was asked: always a finite scale."""
    pairs = np.unique(np.column_stack([duels.first, duels.second]), axis=0)
    half = np.full(len(pairs), 0.5)
    return Duels(
        np.append(duels.first, pairs[:, 0]), np.append(duels.second, pairs[:, 1]),
        np.append(duels.wins, half), np.append(duels.answers, 2 * half),
    )  # fmt: skip


def circular_triads(duels: Duels, count: int) -> tuple[int, int]:
    """Majority choices that run in a circle (A over B over C over A): circular and complete triads."""
    beats = np.zeros((count, count))
    np.add.at(beats, (duels.first, duels.second), duels.wins)
    np.add.at(beats, (duels.second, duels.first), duels.answers - duels.wins)
    over = (beats > beats.T).astype(int)
    decided = over + over.T
    complete = int(np.trace(decided @ decided @ decided)) // 6
    return int(np.trace(over @ over @ over)) // 3, complete


def _ordered_pairs(
    duels: Duels, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    key = duels.first.astype(np.int64) * count + duels.second
    pairs, where = np.unique(key, return_inverse=True)
    wins, answers = np.bincount(where, duels.wins), np.bincount(where, duels.answers)
    return pairs // count, pairs % count, wins, answers


def _design(
    first: Int[np.ndarray, "D"], second: Int[np.ndarray, "D"], count: int, order: bool
) -> Float[np.ndarray, "D Q"]:
    design = np.zeros((len(first), count))
    design[np.arange(len(first)), first] += 1
    design[np.arange(len(first)), second] -= 1
    design = design[:, 1:]
    return np.column_stack([design, np.ones(len(first))]) if order else design


def _meat(
    duels: Duels,
    clusters: Int[np.ndarray, "D"],
    slope: Float[np.ndarray, "D"],
    count: int,
    order: bool,
) -> Float[np.ndarray, "Q Q"]:
    """Sum over clusters of the outer product of their scores, some clusters at a time.

    Neither a design matrix nor all clusters' scores are ever held: there may be a million of them.
    """
    sorting = np.argsort(clusters, kind="stable")
    ids = clusters[sorting]
    meat = np.zeros((count - 1 + order, count - 1 + order))
    for begin in range(0, int(ids[-1]) + 1, _CLUSTER_BLOCK):
        low, high = np.searchsorted(ids, [begin, begin + _CLUSTER_BLOCK])
        rows, key = sorting[low:high], (ids[low:high] - begin).astype(np.int64)
        size = min(_CLUSTER_BLOCK, int(ids[-1]) + 1 - begin)
        sums = np.bincount(key * count + duels.first[rows], slope[rows], size * count)
        sums -= np.bincount(key * count + duels.second[rows], slope[rows], size * count)
        scores = sums.reshape(size, count)[:, 1:]
        if order:
            scores = np.column_stack([scores, np.bincount(key, slope[rows], size)])
        meat += scores.T @ scores
    return meat


def _slope(
    eta: Float[np.ndarray, "D"],
    wins: Float[np.ndarray, "D"],
    answers: Float[np.ndarray, "D"],
    link: Link,
) -> Float[np.ndarray, "D"]:
    rate, density = _MEANS[link](eta)
    return np.asarray((wins - answers * rate) * density / np.maximum(rate * (1 - rate), 1e-300))


def _score(
    design: Float[np.ndarray, "D Q"], beta: Float[np.ndarray, "Q"], wins: Float[np.ndarray, "D"],
    answers: Float[np.ndarray, "D"], link: Link,
) -> tuple[Float[np.ndarray, "Q"], Float[np.ndarray, "Q Q"]]:  # fmt: skip
    """Gradient and expected information of the log likelihood, and each row's slope."""
    rate, density = _MEANS[link](design @ beta)
    variance = np.maximum(rate * (1 - rate), 1e-300)
    gradient = design.T @ _slope(design @ beta, wins, answers, link)
    information = (design.T * (answers * density**2 / variance)) @ design
    return gradient, information


def _logistic(eta: Float[np.ndarray, "D"]) -> tuple[Float[np.ndarray, "D"], Float[np.ndarray, "D"]]:
    rate = 0.5 * (1 + np.tanh(eta / 2))
    return rate, rate * (1 - rate)


def _normal(eta: Float[np.ndarray, "D"]) -> tuple[Float[np.ndarray, "D"], Float[np.ndarray, "D"]]:
    return np.asarray(stats.norm.cdf(eta)), np.asarray(stats.norm.pdf(eta))


_Mean = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
_MEANS: dict[Link, _Mean] = {"logit": _logistic, "probit": _normal}


def _log_likelihood(
    eta: Float[np.ndarray, "D"], wins: Float[np.ndarray, "D"], answers: Float[np.ndarray, "D"],
    link: Link,
) -> float:  # fmt: skip
    rate = np.clip(_MEANS[link](eta)[0], 1e-300, 1 - 1e-16)
    return float(wins @ np.log(rate) + (answers - wins) @ np.log1p(-rate))

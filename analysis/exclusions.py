"""Who and what is left out, by which rule, and the proof that no answer got lost on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from analysis.responses import Responses
from analysis.rules import RULES, Rules
from renderer.files import InputError


@dataclass(frozen=True)
class Flow:
    """From the rows of the file to the answers analysed; the numbers add up (checked on creation)."""

    rows: int
    other_mode: dict[str, int]
    """Answers of runs that are not analysed here, by mode."""
    other_kind: dict[str, int]
    """Answers to trials that are not main trials, by trial kind."""
    participants: int
    """Participants with at least one main answer."""
    excluded_participants: dict[str, int]
    """By the first rule that removes them, in the order of `analysis.rules.RULES`."""
    excluded_answers: dict[str, int]
    """Main answers removed, by rule; those of excluded participants stand under their rule."""
    hits: dict[str, int]
    """Participants (or answers) that each rule alone would remove."""
    analysed: int
    analysed_participants: int

    def __post_init__(self) -> None:
        gone = sum((self.other_mode | self.other_kind | self.excluded_answers).values())
        if self.rows != self.analysed + gone:
            raise AssertionError(f"{self.rows} rows in, {self.analysed} + {gone} accounted for")


def select_mode(responses: Responses, mode: str | None) -> tuple[Responses, str, dict[str, int]]:
    """Answers of one mode, because modes never mix: the one asked for, else live, else the only one."""
    counts = {m: int(responses.equals("mode", m).sum()) for m in responses.labels["mode"]}
    counts = {name: count for name, count in counts.items() if count}
    if mode is None and "live" not in counts and len(counts) > 1:
        raise InputError(
            responses.source, "mode", ", ".join(sorted(counts)), "one of them, chosen with --mode"
        )
    chosen = mode or ("live" if "live" in counts else next(iter(counts)))
    if chosen not in counts:
        raise InputError(responses.source, "mode", chosen, f"one of {', '.join(sorted(counts))}")
    rest = {name: count for name, count in counts.items() if name != chosen}
    return responses.take(responses.equals("mode", chosen)), chosen, rest


def apply_rules(
    responses: Responses, rules: Rules, main_trials: int | None = None,
    other_mode: dict[str, int] | None = None,
) -> tuple[Responses, Flow]:  # fmt: skip
    """The main answers that survive `rules`, and the flow that accounts for all others."""
    main = responses.equals("trial_kind", "main")
    if not main.any():
        raise InputError(responses.source, "trial_kind", "no main trial", "at least one answer")
    removals = rule_removals(responses, main_trials, rules)
    kept, excluded_people, excluded_answers, hits = main.copy(), {}, {}, {}
    people = responses.codes["participant"]
    for rule in RULES:
        if rule.name not in removals:
            continue
        removed = removals[rule.name] & main
        gone = removed & kept
        per_person = rule.removes == "participant"
        hits[rule.name] = len(np.unique(people[removed])) if per_person else int(removed.sum())
        if per_person:
            excluded_people[rule.name] = len(np.unique(people[gone]))
        excluded_answers[rule.name] = int(gone.sum())
        kept &= ~removed
    if not kept.any():
        raise InputError(responses.source, "exclusions", "no answer left", "at least one answer")
    kinds = {
        k: int(responses.equals("trial_kind", k).sum()) for k in responses.labels["trial_kind"]
    }
    other_mode = other_mode or {}
    flow = Flow(
        rows=len(responses) + sum(other_mode.values()), other_mode=other_mode,
        other_kind={kind: count for kind, count in kinds.items() if kind != "main" and count},
        participants=len(np.unique(people[main])), excluded_participants=excluded_people,
        excluded_answers=excluded_answers, hits=hits, analysed=int(kept.sum()),
        analysed_participants=len(np.unique(people[kept])),
    )  # fmt: skip
    return responses.take(kept), flow


def rule_removals(
    responses: Responses, main_trials: int | None, rules: Rules
) -> dict[str, Bool[np.ndarray, "N"]]:
    """For every rule in force, the rows it would remove if it were the only one."""
    removals = {}
    for name, threshold in rules.items():
        if name == "drop_late":
            if threshold:
                removals[name] = responses.equals("late", "true")
        elif name == "drop_unviewed":
            if threshold:
                first = responses.equals("viewed_first", "unproven")
                removals[name] = first | responses.equals("viewed_second", "unproven")
        else:
            removals[name] = _MEASURES[name](responses, threshold, main_trials)[
                responses.codes["participant"]
            ]
    return removals


def _main(responses: Responses) -> Responses:
    return responses.take(responses.equals("trial_kind", "main"))


def _per_person(responses: Responses, mask: Bool[np.ndarray, "N"]) -> Int[np.ndarray, "P"]:
    count = len(responses.labels["participant"])
    return np.bincount(responses.codes["participant"][mask], minlength=count)


def _catch(responses: Responses, threshold: float, _: int | None) -> Bool[np.ndarray, "P"]:
    failed = responses.codes["chosen_method"] != responses.codes["expected_method"]
    return np.asarray(
        _per_person(responses, failed & responses.equals("trial_kind", "catch")) > threshold
    )


def _fast(responses: Responses, threshold: float, _: int | None) -> Bool[np.ndarray, "P"]:
    main = _main(responses)
    times = main.numbers["response_time_ms"]
    known = ~np.isnan(times)
    medians = group_medians(
        main.codes["participant"][known], times[known], len(main.labels["participant"])
    )
    return np.asarray(medians < threshold * 1000)  # not-a-number (never measured) removes nobody


def _one_sided(responses: Responses, threshold: float, _: int | None) -> Bool[np.ndarray, "P"]:
    main = responses.equals("trial_kind", "main")
    first = _per_person(responses, main & responses.equals("chosen_position", "first"))
    total = _per_person(responses, main)
    larger = np.maximum(first, total - first)
    return np.asarray((total > 0) & (larger >= threshold * total))


def _run(responses: Responses, threshold: float, _: int | None) -> Bool[np.ndarray, "P"]:
    return np.asarray(longest_runs(_main(responses)) >= threshold)


def _incomplete(
    responses: Responses, threshold: float, main_trials: int | None
) -> Bool[np.ndarray, "P"]:
    done = _per_person(responses, responses.equals("trial_kind", "main"))
    return np.asarray(done < threshold * (main_trials or done.max()))


def _unsteady(responses: Responses, threshold: float, _: int | None) -> Bool[np.ndarray, "P"]:
    agreed, compared = repeat_agreement(responses)
    return np.asarray((compared > 0) & (agreed < threshold * compared))


_MEASURES = {
    "max_catch_failures": _catch, "min_median_response_s": _fast,
    "max_same_side_share": _one_sided, "max_same_side_run": _run,
    "min_answered_share": _incomplete, "min_repeat_agreement": _unsteady,
}  # fmt: skip


def group_medians(
    groups: Int[np.ndarray, "N"], values: Float[np.ndarray, "N"], count: int
) -> Float[np.ndarray, "G"]:
    """Median of `values` within each of `count` groups; not-a-number for an empty group."""
    order = np.lexsort((values, groups))
    sizes = np.bincount(groups, minlength=count)
    ends = np.cumsum(sizes)
    medians = np.full(count, np.nan)
    some = sizes > 0
    low = (ends - sizes + (sizes - 1) // 2)[some]
    high = (ends - sizes + sizes // 2)[some]
    medians[some] = (values[order][low] + values[order][high]) / 2
    return medians


def longest_runs(responses: Responses) -> Int[np.ndarray, "P"]:
    """Per participant, the longest run of trials answered with the same position."""
    people = responses.codes["participant"]
    order = np.lexsort((responses.numbers["trial_index"], people))
    who, side = people[order], responses.codes["chosen_position"][order]
    starts = np.ones(len(who), dtype=bool)
    starts[1:] = (np.diff(who) != 0) | (np.diff(side) != 0)
    begin = np.flatnonzero(starts)
    lengths = np.diff(np.append(begin, len(who)))
    longest = np.zeros(len(responses.labels["participant"]), dtype=int)
    np.maximum.at(longest, who[begin], lengths)
    return longest


def repeat_pairs(
    responses: Responses,
) -> tuple[Int[np.ndarray, "R"], Int[np.ndarray, "R"]]:
    """Positions of (original, repeat) for every repeat trial whose original answer is in the data."""
    width = int(responses.numbers["trial_index"].max()) + 1
    people = responses.codes["participant"].astype(np.int64)
    key = people * width + responses.numbers["trial_index"].astype(np.int64)
    repeats = np.flatnonzero(responses.equals("trial_kind", "repeat"))
    wanted = people[repeats] * width + responses.numbers["repeat_of"][repeats].astype(np.int64)
    order = np.argsort(key)
    place = np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)
    originals = order[place]
    found = key[originals] == wanted
    return originals[found], repeats[found]


def repeat_agreement(
    responses: Responses,
) -> tuple[Int[np.ndarray, "P"], Int[np.ndarray, "P"]]:
    """Per participant, how many repeats agree with the first answer, and how many there are."""
    originals, repeats = repeat_pairs(responses)
    chosen, people = responses.codes["chosen_method"], responses.codes["participant"]
    same = chosen[originals] == chosen[repeats]
    count = len(responses.labels["participant"])
    return (
        np.bincount(people[repeats][same], minlength=count),
        np.bincount(people[repeats], minlength=count),
    )

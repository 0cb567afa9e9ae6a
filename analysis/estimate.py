"""All numbers of one export: read, exclude, estimate; what `results.json` holds. Writes nothing."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int
from scipy import stats

from analysis import bradley_terry as scaling
from analysis import quality, reliability, scenes
from analysis.clustered import FEW_CLUSTERS
from analysis.codebook import Codebook, read_codebook
from analysis.exclusions import Flow, apply_rules, select_mode
from analysis.glmm import MixedFit, can_fit, fit_crossed, mixed_rate
from analysis.plausibility import link, link_metrics, split_ceiling
from analysis.preference import Comparison, comparisons, preference_table, stimulus_codes
from analysis.resampling import bootstrap_rates
from analysis.responses import Responses, read_responses
from analysis.results import (
    RESULTS_VERSION,
    Results,
    comparison_label,
    preference_record,
    versions,
    watermark,
)
from analysis.sensitivity import sensitivity_matrix
from renderer.catalogue import Catalogue, read_catalogue

LEVEL = 0.95
MAX_DOTS = 500
"""Most participants whose single rates are kept for the dot plot."""
MAX_DIFFERENCES = 15
LARGEST_SD = 8.0
"""Standard deviations beyond this (log odds) mean that the mixed model ran towards infinity."""


def estimate(
    responses_csv: Path, *, seed: int = 0, mode: str | None = None, catalogue: Path | None = None,
    bootstraps: int = 10_000,
) -> Results:  # fmt: skip
    """All numbers of one export. Raises `InputError` on bad input; the seed serves the bootstraps."""
    scored = read_catalogue(catalogue) if catalogue is not None else None
    codebook = read_codebook(responses_csv)
    everything = read_responses(responses_csv)
    responses, mode, other = select_mode(everything, mode)
    analysed, flow = apply_rules(responses, codebook.rules, codebook.main_trials, other)
    found = comparisons(analysed)
    results = _provenance(responses_csv, everything, mode, codebook, seed)
    results |= {
        "names": _display_names(scored, analysed),
        "targets": sorted({one.target for one in found}), "flow": asdict(flow),
        "quality": _quality(analysed, found),
        "reliability": _reliability(responses, analysed, found, seed),
        "scale": _scale(analysed, found),
        **_preference(analysed, found, seed, bootstraps),
    }  # fmt: skip
    results["sensitivity"] = sensitivity_matrix(
        responses, codebook.rules, codebook.main_trials, found,
        {one.name: _scene_of_stimuli(analysed, one) for one in found}, LEVEL,
    )  # fmt: skip
    results["metrics"] = _metrics(analysed, found, scored, results["reliability"])
    results["warnings"] = _warnings(results, flow, codebook)
    return results


def _provenance(
    path: Path, responses: Responses, mode: str, codebook: Codebook, seed: int
) -> Results:
    return {
        "schema_version": RESULTS_VERSION,
        "input": {
            "file": path.name, "rows": len(responses), "mode": mode,
            "study_id": responses.labels["study_id"][0],
            "study_versions": list(responses.labels["study_version"]),
            "collected": list(responses.started or ()), "codebook": codebook.present,
        },
        "input_sha256": responses.sha256,
        "rules": codebook.rules, "rules_origin": codebook.rules_origin,
        "rules_sha256": codebook.rules_sha256,
        "code_version": versions()["pace-study"], "versions": versions(),
        "seed": seed, "level": LEVEL,
        "simulated": mode == "simulated", "frozen": codebook.frozen,
        "watermark": watermark(mode, codebook.frozen),
    }  # fmt: skip


def _display_names(catalogue: Catalogue | None, analysed: Responses) -> dict[str, str]:
    """Display names of the compared methods, for reading only; a name that two methods share is left out."""
    used = np.union1d(analysed.codes["target"], analysed.codes["baseline"])
    present = {analysed.labels["target"][code] for code in used}
    stated = {
        str(method.get("name")): method.get("display_name")
        for method in (catalogue.methods if catalogue is not None else ())
        if isinstance(method, dict) and method.get("name") in present
    }
    names = {name: shown for name, shown in stated.items() if isinstance(shown, str)}
    shared = Counter([*names.values(), *(present - names.keys())])
    return {name: shown for name, shown in sorted(names.items()) if shared[shown] == 1}


def _preference(
    analysed: Responses, found: list[Comparison], seed: int, bootstraps: int
) -> dict[str, Any]:
    """The main table with mixed model, bootstrap, scenes, stimuli and participants of every row."""
    table = preference_table(found, LEVEL)
    draws = _draws(analysed, found, seed, bootstraps)
    rows = {}
    for column, one in enumerate(found):
        row = preference_record(table[one.name])
        low, high = np.percentile(draws[:, column], [2.5, 97.5])
        row |= {"ci_bootstrap": [float(low), float(high)]}
        why = can_fit(one.cells)
        fit = None if why else fit_crossed(one.cells)
        row["mixed_model"] = _mixed(fit, why)
        row |= _by_scene(analysed, one, fit if "rate" in row["mixed_model"] else None)
        rows[one.name] = row
    return {
        "order": sorted(table, key=lambda name: (-table[name].rate, name)),
        "baselines": rows, "bootstraps": bootstraps, "differences": _differences(found, draws),
    }  # fmt: skip


def _mixed(fit: MixedFit | None, why: str) -> dict[str, Any]:
    if fit is None:
        return {"why": why}
    if not fit.converged or max(fit.sd_participant, fit.sd_stimulus) > LARGEST_SD:
        return {"why": "no clear maximum, answers are nearly separated by participant or stimulus"}
    rate = asdict(mixed_rate(fit, LEVEL))
    return rate | {"ci": list(rate["ci"]), "why": ""}


def _draws(analysed: Responses, found: list[Comparison], seed: int, bootstraps: int) -> np.ndarray:
    codes = [_study_participants(analysed, one) for one in found]
    return bootstrap_rates(codes, [one.cells for one in found], bootstraps, seed)


def _study_participants(analysed: Responses, one: Comparison) -> Int[np.ndarray, "C"]:
    """Study-wide participant code of every cell of a comparison."""
    people = np.unique(analysed.codes["participant"][one.rows])
    return np.asarray(people[one.cells.participant])


def _differences(found: list[Comparison], draws: np.ndarray) -> list[dict[str, Any]]:
    """Differences between the rates of two rows, participants resampled for both at once."""
    count = len(found)
    if count * (count - 1) // 2 > MAX_DIFFERENCES:
        return []
    records = []
    for i in range(count):
        for j in range(i):
            change = draws[:, i] - draws[:, j]
            rates = [one.cells.wins.sum() / one.cells.answers.sum() for one in (found[i], found[j])]
            low, high = np.percentile(change, [2.5, 97.5])
            records.append({
                "first": found[i].name, "second": found[j].name,
                "difference": float(rates[0] - rates[1]), "ci": [float(low), float(high)],
            })  # fmt: skip
    return records


def _by_scene(analysed: Responses, one: Comparison, fit: MixedFit | None) -> dict[str, Any]:
    scene, labels = _scene_of_stimuli(analysed, one)
    names = [" | ".join(pair) for pair in _stimulus_names(analysed, one).values()]
    wins = np.bincount(one.cells.participant, one.cells.wins).astype(int)
    answers = np.bincount(one.cells.participant, one.cells.answers).astype(int)
    dots = sorted(zip(wins.tolist(), answers.tolist(), strict=True))
    return {
        "scenes": scenes.per_scene(one.cells, scene, labels, LEVEL),
        "heterogeneity": scenes.heterogeneity(one.cells, scene),
        "stimuli_rates": scenes.per_stimulus(one.cells, names, fit),
        "participant_counts": [list(pair) for pair in dots] if len(dots) <= MAX_DOTS else [],
    }


def _stimulus_names(analysed: Responses, one: Comparison) -> dict[int, tuple[str, str]]:
    codes = np.unique(stimulus_codes(analysed)[one.rows])
    motions, rooms = analysed.labels["motion"], analysed.labels["scene"]
    return {int(c): (rooms[c // len(motions)], motions[c % len(motions)]) for c in codes}


def _scene_of_stimuli(
    analysed: Responses, one: Comparison
) -> tuple[Int[np.ndarray, "S"], list[str]]:
    codes = np.unique(stimulus_codes(analysed)[one.rows])
    return codes // len(analysed.labels["motion"]), list(analysed.labels["scene"])


def _quality(analysed: Responses, found: list[Comparison]) -> dict[str, Any]:
    won, expected = np.zeros(len(analysed), dtype=bool), np.zeros(len(analysed))
    for one in found:
        won[one.rows], expected[one.rows] = one.won, one.won.mean()
    return {
        "side_bias": quality.side_bias(analysed, LEVEL),
        "order_drift": quality.order_drift(analysed, won, expected),
        "exposure": quality.exposure(analysed, found),
        "times": quality.response_times(analysed), "viewing": quality.viewing(analysed),
    }  # fmt: skip


def _reliability(
    responses: Responses, analysed: Responses, found: list[Comparison], seed: int
) -> dict[str, Any]:
    kept = np.zeros(len(responses.labels["participant"]), dtype=bool)
    kept[analysed.codes["participant"]] = True
    return {
        "within": reliability.within_participants(responses, kept, seed),
        "between": {one.name: reliability.between_participants(one.cells) for one in found},
    }


def _scale(analysed: Responses, found: list[Comparison]) -> dict[str, Any]:
    """Bradley-Terry scale over all methods, clustered by participant and stimulus."""
    duels, people, stimuli, names = _duels(analysed)
    graph = scaling.describe_graph(duels, len(names))
    record: dict[str, Any] = asdict(graph) | {"methods": [], "order_effect": None, "flags": []}
    if graph.components > 1:
        record["flags"].append("methods fall into groups that were never compared: no common scale")
        return record
    if graph.lack_of_fit_df == 0:
        record["flags"].append(
            "star design: the scale repeats the preference rates; it has no goodness of fit, and "
            "transitivity is not measurable in this design"
        )
    fit, flags = scaling.fit_finite_scale(duels, len(names))
    if people.max() == 0 or stimuli.max() == 0:
        flags = [*flags, "one participant or stimulus only: errors assume independent answers"]
    record["flags"] += flags
    ability, se = scaling.centred(fit, *scaling.two_way_covariances(duels, fit, people, stimuli))
    t = float(stats.t.ppf(0.5 + LEVEL / 2, max(1, min(people.max(), stimuli.max()))))
    record["methods"] = [
        {"method": name, "ability": float(a), "se": float(s),
         "ci": [float(a - t * s), float(a + t * s)]}
        for name, a, s in sorted(zip(names, ability, se, strict=True), key=lambda row: -row[1])
    ]  # fmt: skip
    if fit.order is not None:
        record["order_effect"] = {"log_odds": fit.order, "se_independent": fit.order_se}
    circular, complete = scaling.circular_triads(duels, len(names))
    record |= {"circular_triads": circular, "complete_triads": complete}
    if graph.lack_of_fit_df > 0 and not graph.separated:
        record["lack_of_fit"] = _lack_of_fit(duels, len(names), graph.lack_of_fit_df)
    return record


def _lack_of_fit(duels: scaling.Duels, count: int, df: int) -> dict[str, Any]:
    """Deviance of the scale against free rates of all pairs; assumes independent answers."""
    low, high = np.minimum(duels.first, duels.second), np.maximum(duels.first, duels.second)
    pair = np.unique(low * count + high, return_inverse=True)[1]
    won = np.where(duels.first == low, duels.wins, duels.answers - duels.wins)
    k, n = np.bincount(pair, won), np.bincount(pair, duels.answers)
    with np.errstate(divide="ignore", invalid="ignore"):
        terms = np.nan_to_num(k * np.log(k / n)) + np.nan_to_num((n - k) * np.log1p(-k / n))
    fit = scaling.fit_scale(duels, count)
    deviance = float(2 * (terms.sum() - fit.log_likelihood))
    return {"deviance": deviance, "df": df, "p_independent": float(stats.chi2.sf(deviance, df))}


def _duels(
    analysed: Responses,
) -> tuple[scaling.Duels, Int[np.ndarray, "D"], Int[np.ndarray, "D"], list[str]]:
    """Answers as ordered duels aggregated by participant and stimulus."""
    labels = analysed.labels["target"]
    shown = np.unique(
        np.concatenate([analysed.codes["first_method"], analysed.codes["second_method"]])
    )
    first = np.searchsorted(shown, analysed.codes["first_method"]).astype(np.int64)
    second = np.searchsorted(shown, analysed.codes["second_method"]).astype(np.int64)
    people = np.unique(analysed.codes["participant"], return_inverse=True)[1].astype(np.int64)
    stimuli = np.unique(stimulus_codes(analysed), return_inverse=True)[1].astype(np.int64)
    won = analysed.equals("chosen_position", "first")
    count, things = len(shown), int(stimuli.max()) + 1
    key = ((people * things + stimuli) * count + first) * count + second
    cells, where = np.unique(key, return_inverse=True)
    duels = scaling.Duels(
        cells // count % count, cells % count, np.bincount(where, won).astype(int),
        np.bincount(where),
    )  # fmt: skip
    both = cells // count**2
    return duels, both // things, both % things, [labels[code] for code in shown]


def _metrics(
    analysed: Responses,
    found: list[Comparison],
    catalogue: Catalogue | None,
    reliable: dict[str, Any],
) -> dict[str, Any]:
    if catalogue is None:
        return {"why": "no catalogue was given", "metrics": {}}
    names: dict[int, tuple[str, str]] = {}
    for one in found:
        names |= _stimulus_names(analysed, one)
    linked = link(found, analysed.codes["participant"], stimulus_codes(analysed), names, catalogue)
    ceiling = split_ceiling(linked)
    if reliable["within"]["agreement"] is not None:
        ceiling["from_repeats"] = reliable["within"]["noise_ceiling"]
    return {"why": "", "set_id": catalogue.set_id} | link_metrics(linked, LEVEL, ceiling)


def _warnings(results: Results, flow: Flow, codebook: Codebook) -> list[str]:
    """What a reader must not miss, in plain sentences."""
    lines = []
    if codebook.unknown_fields:
        fields = ", ".join(codebook.unknown_fields)
        lines.append(f"codebook.json holds fields that are not known and were not used: {fields}.")
    if codebook.rules_origin == "post hoc":
        lines.append("The exclusion rules were changed after collection began: post hoc.")
    if len(results["input"]["study_versions"]) > 1:
        lines.append("The file pools answers of several versions of the study.")
    clusters = min(_clusters(results))
    if clusters < FEW_CLUSTERS:
        lines.append(
            f"FEW CLUSTERS: an interval rests on {clusters} participants or stimuli; below "
            f"{FEW_CLUSTERS} it is unreliable."
        )
    for name in results["order"]:
        lines += [
            f"FRAGILE: {comparison_label(results, name)}, {row['variant']}: the {row['flips']} changes."
            for row in results["sensitivity"][name]
            if row["flips"] and _matters(results["baselines"][name]["ci"], row["ci"])
        ]
    if flow.analysed_participants < flow.participants / 2:
        lines.append("More than half of the participants were excluded.")
    if results["scale"]["components"] > 1:
        lines.append("Some methods were never compared, not even indirectly: no common scale.")
    return lines


def _matters(reported: list[float], variant: list[float]) -> bool:
    """A rate near one half may cross it freely; it matters when either interval excludes one half."""
    return any(low > 0.5 or high < 0.5 for low, high in (reported, variant))


def _clusters(results: Results) -> list[int]:
    return [min(row["participants"], row["stimuli"]) for row in results["baselines"].values()]

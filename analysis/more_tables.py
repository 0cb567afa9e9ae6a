"""The tables behind the main one: intervals side by side, scenes, quality, sensitivity, scale, metrics."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from analysis.clustered import FEW_CLUSTERS, few_clusters
from analysis.display import DASH, fixed, p_value, percent, percent_interval, span
from analysis.results import Results, comparison_label, method_label, ordered
from analysis.tables import Table

Rows = tuple[tuple[str, ...], ...]


def interval_table(results: Results) -> Table:
    """Every interval of the rate beside the headline, so that a reader sees what clustering does."""
    rows = []
    for name, row in ordered(results):
        mixed = row["mixed_model"]
        rows.append((
            comparison_label(results, name), f"{row['k']:,} / {row['n']:,}", row["display"]["ci"],
            row["display"]["ci_participant"], percent_interval(row["ci_bootstrap"]),
            f"{percent(mixed['rate'])} [{percent_interval(mixed['ci'])}]" if "rate" in mixed else DASH,
            row["display"]["ci_naive"], row["display"]["ci_exact"],
        ))  # fmt: skip
    header = (
        "compared with", "wins / answers", "two-way clustered", "participant only", "bootstrap",
        "mixed model", "Wilson*", "exact*",
    )  # fmt: skip
    why = {row["mixed_model"]["why"] for _, row in ordered(results)} - {""}
    note = (
        f"All in %. Bootstrap: {results['bootstraps']:,} draws of participants, percentile. Mixed "
        "model: crossed "
        "random intercepts, Laplace, averaged over participants and stimuli. * assumes independent answers."
    )
    note += f" No mixed model: {'; '.join(sorted(why))}." if why else ""
    return Table("intervals", "Intervals side by side", header, tuple(rows), note)


def effect_table(results: Results) -> Table:
    """Tests, effect sizes and how strongly answers hang together."""
    rows = tuple(
        (
            comparison_label(results, name), f"{row['participants']:,}", f"{row['stimuli']:,}",
            row["display"]["answers_per_stimulus"], str(row["df"]), row["display"]["p"],
            row["display"]["odds"], row["display"]["cohen_h"],
            row["display"]["jod"], row["display"]["icc_participant"],
            row["display"]["icc_stimulus"], row["display"]["posterior_above_half"],
        )
        for name, row in ordered(results)
    )  # fmt: skip
    header = (
        "compared with", "people", "clips", "answers a clip", "df", "p", "odds", "Cohen's h", "JOD",
        "ICC people", "ICC clips", "P(> 50 %)",
    )  # fmt: skip
    note = (
        "p: two-sided against 50 %, clustered. JOD: probit of the rate over probit of 75 %. ICC: "
        "share of variance "
        "between participants or stimuli. P(> 50 %): Jeffreys posterior on answers / design "
        "effect, approximate."
    )
    return Table("effects", "Tests, effect sizes and dependence", header, rows, note)


def difference_table(results: Results) -> Table:
    """Differences between rows, participants resampled for both at once."""
    rows = tuple(
        (" − ".join(comparison_label(results, d[side]) for side in ("first", "second")),
         points(d["difference"]), points_interval(d["ci"]))
        for d in results["differences"]
    )  # fmt: skip
    header = ("difference of rates", "points", f"{results['level'] * 100:g} % CI")
    note = (
        "Percentage points; bootstrap of participants. Exploratory: not adjusted for their number."
    )
    return Table("differences", "Differences between the rows", header, rows, note)


def scene_table(results: Results) -> Table:
    """Rate per scene; scenes are fixed and stand for no others."""
    names = sorted({s["scene"] for _, row in ordered(results) for s in row["scenes"]})
    rows = []
    for name, row in ordered(results):
        found = {scene["scene"]: scene for scene in row["scenes"]}
        cells = [_scene(found.get(scene)) for scene in names]
        test = row["heterogeneity"]
        p = p_value(test["p"]) if test["p"] is not None else f"{DASH} ({test['why']})"
        rows.append((comparison_label(results, name), *cells, p))
    note = (
        "Rate in % [clustered interval]; few clips a scene make these intervals wide. Last "
        "column: Wald F test that "
        "all scenes share one rate, clustered by participant. Scenes are fixed: nothing is said "
        "of other scenes."
    )
    return Table("scenes", "Per scene", ("compared with", *names, "p equal"), tuple(rows), note)


def quality_table(results: Results) -> Table:
    """Side bias, drift, exposure, times and viewing evidence in one table of checks."""
    quality = results["quality"]
    return Table(
        "quality", "Quality of the answers", ("check", "value", "detail"),
        (*_side_rows(quality), *_exposure_rows(results), *_time_rows(quality)),
        words=True,
    )  # fmt: skip


def sensitivity_table(results: Results) -> Table:
    """The matrix of variants; the last column says what flips."""
    rows = [
        (f"{comparison_label(results, name)}: {v['variant']}", f"{v['n']:,}",
         percent(v["rate"]), percent_interval(v["ci"]),
         v["flips"] or "no")
        for name in results["order"]
        for v in results["sensitivity"][name]
    ]  # fmt: skip
    header = ("variant", "answers", "target %", f"{results['level'] * 100:g} % CI", "flips")
    note = (
        "Sign: the rate crosses 50 %. Significance: the clustered interval gains or loses 50 %. "
        "The lowest and the "
        "highest of all leave-one-out rates are shown; every one of them was computed."
    )
    return Table(
        "sensitivity", "Sensitivity to rules, people, clips and scenes", header, tuple(rows), note
    )


def scale_table(results: Results) -> Table:
    """Bradley-Terry abilities relative to their mean."""
    scale = results["scale"]
    rows = tuple(
        (
            method_label(results, row["method"]), fixed(row["ability"]), fixed(row["se"]),
            " to ".join(fixed(bound) for bound in row["ci"]),
        )
        for row in scale["methods"]
    )  # fmt: skip
    notes = [f"{flag[0].upper()}{flag[1:]}." for flag in scale["flags"]]
    if scale["order_effect"]:
        effect = scale["order_effect"]
        notes.append(
            f"Standing first adds {fixed(effect['log_odds'])} log odds (SE "
            f"{fixed(effect['se_independent'])}, "
            "assumes independent answers)."
        )
    if "lack_of_fit" in scale:
        fit = scale["lack_of_fit"]
        notes.append(
            f"Lack of fit: deviance {fixed(fit['deviance'])} on {fit['df']} df, p = "
            f"{p_value(fit['p_independent'])} "
            f"(assumes independent answers). Circular triads: {scale['circular_triads']} of "
            f"{scale['complete_triads']}."
        )
    notes.append(
        "Log odds relative to the mean method; intervals clustered by participant and stimulus, "
        "Student's t."
    )
    return Table(
        "scale",
        "Scale of all methods (Bradley-Terry)",
        ("method", "ability", "SE", f"{results['level'] * 100:g} % CI"),
        rows,
        " ".join(notes),
    )


def reliability_table(results: Results) -> Table:
    """Agreement between participants per row, and within participants."""
    rows: list[tuple[str, ...]] = [
        (
            comparison_label(results, name), str(found["stimuli"]), _rate(found["agreement"]),
            fixed(found["alpha"], 3), fixed(found["ac1"], 3),
        )
        for name, found in sorted(results["reliability"]["between"].items(), key=_in_order(results))
    ]  # fmt: skip
    within = results["reliability"]["within"]
    if within["agreement"] is None:
        note = f"Within participants: {within['why']}."
    else:
        note = (
            f"Within participants: {within['n']} repeated trials of {within['participants']} "
            "participants agree in "
            f"{percent(within['agreement'])} % [{percent_interval(within['ci'])}], Cohen's kappa "
            f"{fixed(within['kappa'])}; implied noise ceiling {percent(within['noise_ceiling'])} %."
        )
    note += (
        " Alpha: Krippendorff, nominal; it is low whenever stimuli hardly differ or one answer "
        "dominates, which is no "
        "fault of the participants. AC1 (Gwet) does not collapse so."
    )
    header = ("compared with", "stimuli", "agreement %", "alpha", "AC1")
    return Table("reliability", "Agreement between participants", header, tuple(rows), note)


def metric_table(results: Results) -> Table:
    """Does a difference in a metric go with preference?"""
    metrics = results["metrics"]
    rows = tuple(
        (name, *_metric_cells(record))
        for name, record in metrics["metrics"].items()
        if not record["why"]
    ) or tuple((name, *[DASH] * 7) for name in metrics["metrics"])
    header = (
        "metric", "pairs", "range of difference", "slope per SD", "p", "Kendall tau",
        "higher chosen %", "ties",
    )  # fmt: skip
    return Table(
        "metrics", "Do the metrics predict preference?", header, rows, _metric_note(metrics)
    )


def points(value: float) -> str:
    """A difference of shares in percentage points, with its sign."""
    return ("+" if value > 0 else "") + fixed(100 * value, 1)


def points_interval(bounds: list[float]) -> str:
    """Two differences of shares in percentage points."""
    return f"{points(bounds[0])} to {points(bounds[1])}"


def _in_order(results: Results) -> Any:
    return lambda item: results["order"].index(item[0])


def _scene(record: dict[str, Any] | None) -> str:
    if record is None:
        return DASH
    return f"{percent(Fraction(record['k'], record['n']))} [{percent_interval(record['ci'])}]"


def _side_rows(quality: dict[str, Any]) -> Rows:
    side, drift = quality["side_bias"], quality["order_drift"]
    rows = [(
        "first position chosen", f"{percent(Fraction(side['k'], side['n']))} % "
        f"[{percent_interval(side['ci'])}]",
        f"clustered p = {p_value(side['p'])}; {side['participants_with_bias']} of "
        f"{side['participants']} participants "
        "biased (exact, BH 5 %)",
    )]  # fmt: skip
    if drift["change"] is not None:
        rows.append((
            "drift, last − first third of trials", f"{points(drift['change'])} points "
            f"[{points_interval(drift['ci'])}]",
            f"paired t over {drift['participants']} participants, p = {p_value(drift['p'])}",
        ))  # fmt: skip
    return tuple(rows)


def _exposure_rows(results: Results) -> Rows:
    return tuple(
        (
            f"{comparison_label(results, name)}: exposure",
            f"{span(record['min'], record['max'], '–')} answers a stimulus",
            f"target first in {percent(Fraction(record['target_first'], record['n']))} %; chosen "
            f"{_rate(record['rate_when_first'])} % when first, "
            f"{_rate(record['rate_when_second'])} % when second",
        )
        for name, record in results["quality"]["exposure"].items()
    )  # fmt: skip


def _time_rows(quality: dict[str, Any]) -> Rows:
    rows = []
    for name, record in quality["times"].items():
        value, detail = "not measured", ""
        if record["measured"]:
            value = f"median {fixed(record['median'], 1)} s"
            detail = f"quartiles {fixed(record['q1'], 1)} and {fixed(record['q3'], 1)} s; "
            detail += f"n = {record['measured']:,}"
        rows.append((name.replace("_", " "), value, detail))
    viewing = quality["viewing"]
    plays = viewing["plays_per_clip"]
    rows.append((
        "viewing evidence", f"both clips proven: {viewing['both_proven']:,} of {viewing['n']:,}",
        f"unproven {viewing['one_unproven']:,}, unknown {viewing['unknown']:,}, late {viewing['late']:,}",
    ))  # fmt: skip
    if plays["measured"]:
        detail = f"quartiles {fixed(plays['q1'], 1)} and {fixed(plays['q3'], 1)}"
        rows.append(("plays of a clip", f"median {fixed(plays['median'], 1)}", detail))
    return tuple(rows)


def _rate(value: float | None) -> str:
    return DASH if value is None else percent(value)


def _metric_cells(record: dict[str, Any]) -> tuple[str, ...]:
    slope = "separated"
    if record["slope_per_sd"] is not None:
        slope = f"{fixed(record['slope_per_sd'])} [{fixed(record['ci'][0])} to {fixed(record['ci'][1])}]"
    predicted = record["predicted"]
    return (
        str(record["items"]), f"{record['min']:.3g} to {record['max']:.3g}".replace("-", "−"), slope,
        DASH if record["p"] is None else p_value(record["p"]), fixed(record["kendall"]),
        DASH if predicted is None
        else f"{percent(predicted)} [{percent_interval(record['predicted_ci'])}]",
        f"{record['ties']:,}",
    )  # fmt: skip


def _metric_note(metrics: dict[str, Any]) -> str:
    if metrics["why"]:
        return f"Not computed: {metrics['why']}."
    ceiling = metrics["ceiling"]
    note = (
        "Difference: target − baseline clip of a pair. Slope: log odds of choosing the target per "
        "standard deviation, one intercept a comparison, clustered by participant and stimulus. Higher "
        "chosen: share of answers for the clip with the higher value; ties are not scored. "
        "Exploratory: p is not adjusted for the number of metrics. "
    )
    if ceiling["share"] is not None:
        note += f"Ceiling: the majority of the other participants predicts {percent(ceiling['share'])} %. "
    if "from_repeats" in ceiling:
        note += f"Ceiling from repeated trials: {percent(ceiling['from_repeats'])} %. "
    fewest = min((r["clusters"] for r in metrics["metrics"].values() if not r["why"]), default=None)
    if fewest is not None and fewest < FEW_CLUSTERS:
        note += f"FEW CLUSTERS: {few_clusters(fewest)}. "
    return note + _refusals(metrics["metrics"])


def _refusals(records: dict[str, Any]) -> str:
    """Metrics that say nothing here, grouped by the reason."""
    reasons: dict[str, list[str]] = {}
    for name, record in records.items():
        if record["why"]:
            at = f" ({record['min']:.3g})" if "min" in record else ""
            reasons.setdefault(record["why"], []).append(name + at.replace("-", "−"))
    return " ".join(f"Not measurable, {why}: {', '.join(who)}." for why, who in reasons.items())

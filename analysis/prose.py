"""Words made from `results.json`: the methods paragraph and the answers to a reviewer's questions."""

from __future__ import annotations

import re
from typing import Any

from analysis.display import fixed, holding, p_value, percent, percent_interval, span
from analysis.results import Results, comparison_label, method_label, ordered
from analysis.tables import all_tables, markdown


def methods_paragraph(results: Results) -> str:
    """What was done, in the words of a methods section; only what was really done is said."""
    flow, level = results["flow"], f"{results['level'] * 100:g} %"
    sentences = [
        f"{holding(flow['analysed_participants'], 'participant')} gave "
        f"{holding(flow['analysed'], 'answer')} in a "
        f"two-alternative forced choice between {_shown_pairs(results)}.",
        _exclusion_sentence(results),
        "For each comparison we report the share of answers in favour of the target with a "
        f"{level} confidence interval "
        "that is robust to clustering by participant and by stimulus (logit scale, CR1 sandwich "
        "variance of both "
        "clusterings less that of their intersection, never less than either, Student's t with one "
        "degree of freedom less than the smaller number of clusters), and a two-sided p value against "
        f"50 % from the same model{_holm(results)}.",
    ]
    if any("rate" in row["mixed_model"] for _, row in ordered(results)):
        sentences.append(
            "As a check we fitted logistic models with crossed random intercepts of participants "
            "and stimuli (Laplace "
            "approximation) and averaged their rates over both."
        )
    sentences.append(
        f"Bootstrap intervals of the rates{' and of their differences' if results['differences'] else ''}"
        f" use {results['bootstraps']:,} draws of participants (seed {results['seed']})."
    )
    if results["metrics"]["metrics"]:
        sentences.append(
            "Differences in plausibility scores were related to answers by logistic models with "
            "the same clustering."
        )
    used = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    sentences.append(f"Software: {used}.")
    if results["simulated"]:
        sentences.insert(0, "The answers are simulated; no person took part.")
    return " ".join(sentences)


def markdown_report(results: Results) -> str:
    """The report as Markdown: result, methods, all tables, checklist."""
    mark = results["watermark"]
    head = [f"# Preference report: {results['input']['study_id']}", ""]
    head += [f"**{mark}**", ""] if mark else []
    head += [f"> {line}\n" for line in results["warnings"]]
    head += [
        results_paragraph(results),
        "",
        "## Methods",
        "",
        methods_paragraph(results),
        "",
        "## Tables",
        "",
    ]
    tables = [markdown(table, mark) for table in all_tables(results)]
    questions = [f"- **{question}** {answer}" for question, answer in checklist(results)]
    page = "\n".join([*head, *tables, "## A reviewer's questions", "", *questions, ""])
    return re.sub(r"<(?=[A-Za-z/!?])", "&lt;", page)  # names are text, never markup


def results_paragraph(results: Results) -> str:
    """The result in one sentence per comparison, strongest first."""
    sentences = []
    named: set[str] = set()
    for _, row in ordered(results):
        shown, test = row["display"], f"p = {row['display']['p_holm']}".replace("= <", "< ")
        verdict = "" if row["p_holm"] < 1 - results["level"] else "; not distinguishable from 50 %"
        sentences.append(
            f"Against {_mention(results, row['baseline'], named)}, "
            f"{_mention(results, row['target'], named)} was chosen in {shown['rate']} % of "
            f"{holding(row['n'], 'answer')} "
            f"[{shown['ci']}], {test}{verdict}."
        )
    return " ".join(sentences)


def checklist(results: Results) -> tuple[tuple[str, str], ...]:
    """Usual questions of reviewers, each with the answer these data give."""
    flow, quality = results["flow"], results["quality"]
    side, within = quality["side_bias"], results["reliability"]["within"]
    rows = [row for _, row in ordered(results)]
    effects = [row["design_effect"] for row in rows if row["design_effect"] is not None]
    return (
        ("Are answers treated as independent?",
         "No. Headline intervals cluster by participant and stimulus; design effects "
         + (f"{span(fixed(min(effects), 1), fixed(max(effects), 1))}." if effects else "not estimable.")),
        ("Does the result generalise over stimuli?",
         f"Over stimuli like these: {_span(rows, 'stimuli')} stimuli a comparison are part of the "
         "variance. "
         "Not over scenes: they are fixed."),
        ("Multiple comparisons?",
         f"p adjusted by Holm's method over {len(rows)} comparisons." if len(rows) > 1
         else "There is one comparison; its p needs no adjustment."),
        ("Were exclusions decided before the data were seen?", _exclusion_answer(results)),
        ("Were sides counterbalanced?",
         "; ".join(f"{comparison_label(results, name)}: target first in "
                   f"{percent(e['target_first'] / e['n'])} %"
                   for name, e in quality["exposure"].items())
         + f". The first position was chosen in {percent(side['rate'])} % [{percent_interval(side['ci'])}]."),
        ("How often was each clip rated?",
         "; ".join(f"{comparison_label(results, name)}: {span(e['min'], e['max'])} times"
                   for name, e in quality["exposure"].items()) + "."),
        ("Does the result hold in every scene?", _scene_answer(results)),
        ("Does it hang on one rule, person, clip or scene?", _sensitivity_answer(results)),
        ("Are participants consistent with themselves?",
         f"Repeats agree in {percent(within['agreement'])} %." if within["agreement"] is not None
         else f"{within['why'][0].upper()}{within['why'][1:]}."),
        ("Could ties be hidden by the forced choice?",
         "Yes: a forced choice cannot tell indifference from balanced preference near 50 %."),
        ("Why this many participants?",
         "See the planner of this study; power must be stated from the design, not from these data."),
        ("Are the data final?",
         f"{'Yes, the study is closed' if results['frozen'] else 'No: the study is not closed'}; "
         f"data {results['input_sha256'][:12]}, {flow['rows']:,} rows."),
        ("Are the answers from people?",
         "No: SIMULATED." if results["simulated"] else f"Yes, run mode `{results['input']['mode']}`."),
    )  # fmt: skip


def _baselines(results: Results) -> list[str]:
    return sorted({row["baseline"] for row in results["baselines"].values()})


def _methods(results: Results, methods: list[str]) -> str:
    return _list([method_label(results, method) for method in methods])


def _shown_pairs(results: Results) -> str:
    targets, baselines = results["targets"], _baselines(results)
    if len(targets) > 1:
        pairs, methods = len(results["order"]), sorted({*targets, *baselines})
        return f"{pairs} pairs of {_methods(results, methods)}"
    each = "each of " if len(baselines) > 1 else ""
    return f"{_methods(results, targets)} and {each}{_methods(results, baselines)}"


def _mention(results: Results, method: str, named: set[str]) -> str:
    """The name of a method, with its identifier the first time."""
    first = method not in named
    named.add(method)
    return method_label(results, method, with_id=first)


def _holm(results: Results) -> str:
    many = len(results["order"])
    return f", adjusted by Holm's method over {many} comparisons" if many > 1 else ""


def _list(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _span(rows: list[dict[str, Any]], key: str) -> str:
    low, high = min(row[key] for row in rows), max(row[key] for row in rows)
    return span(low, high)


def _exclusion_sentence(results: Results) -> str:
    flow = results["flow"]
    if not results["rules"]:
        return "No exclusion rules were declared and no answer was excluded."
    people = sum(flow["excluded_participants"].values())
    answers = sum(flow["excluded_answers"].values())
    rules = ", ".join(f"{name} = {value:g}" for name, value in results["rules"].items())
    timing = "after collection had begun" if results["rules_origin"] == "post hoc" else "beforehand"
    return (
        f"Exclusion rules fixed {timing} ({rules}) removed {holding(people, 'participant')} and "
        f"{holding(answers, 'answer')}."
    )


def _exclusion_answer(results: Results) -> str:
    if not results["rules"] and results["rules_origin"] == "declared":
        return "The study design declares no rules; nothing was excluded."
    texts = {
        "none": "No rules were declared; nothing was excluded.",
        "post hoc": "NO: the rules were changed after collection began (post hoc).",
        "declared": f"Yes: rules {results['rules_sha256'][:12]} stand in the study design.",
    }
    return texts[results["rules_origin"]]


def _scene_answer(results: Results) -> str:
    parts = []
    for name, row in ordered(results):
        rates = [scene["rate"] for scene in row["scenes"]]
        p = row["heterogeneity"]["p"]
        test = f", equality p = {p_value(p)}".replace("= <", "< ") if p is not None else ""
        label, between = (
            comparison_label(results, name),
            span(percent(min(rates)), percent(max(rates))),
        )
        parts.append(f"{label}: {between} %{test}")
    return "; ".join(parts) + "."


def _sensitivity_answer(results: Results) -> str:
    flips = [
        f"{comparison_label(results, name)} ({row['variant']}: {row['flips']})"
        for name in results["order"]
        for row in results["sensitivity"][name]
        if row["flips"]
    ]
    return f"YES: {'; '.join(flips)}." if flips else "No variant changes sign or significance."

"""LaTeX: one macro a number, and a booktabs table that is made of the same macros."""

from __future__ import annotations

import re

from analysis.results import Results, comparison_label, target_labels

_DIGITS = ("Zero", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
_FIELDS = {
    "Rate": "rate", "BaselineRate": "baseline_rate", "Low": "ci_low", "High": "ci_high",
    "P": "p", "PHolm": "p_holm", "Deff": "design_effect", "Naive": "ci_naive",
    "Exact": "ci_exact", "Odds": "odds", "CohenH": "cohen_h", "Jod": "jod",
}  # fmt: skip
_SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "–": "--", "−": "$-$", "<": "$<$", ">": "$>$", "·": r"$\cdot$", "|": r"\textbar{}",
}  # fmt: skip


def escape(text: str) -> str:
    """Text as LaTeX prints it."""
    return "".join(_SPECIAL.get(letter, letter) for letter in text)


def macro_stems(names: list[str]) -> dict[str, str]:
    """A macro stem of letters only for every name; clashes get a number in words."""
    stems: dict[str, str] = {"": "Study"}  # the stem of the macros of the flow
    for name in names:
        words = re.findall(r"[A-Za-z]+|[0-9]", name.replace("+", " Plus "))
        stem = "".join(_DIGITS[int(w)] if w.isdigit() else w[0].upper() + w[1:] for w in words)
        base = stem = stem or "Method"
        clash = 0
        while stem in stems.values():
            clash += 1
            stem = base + "".join(_DIGITS[int(digit)] for digit in str(clash))
        stems[name] = stem
    del stems[""]
    return stems


def macros(results: Results) -> str:
    """`results.tex`: `\\newcommand` for every number of the main table and of the flow."""
    lines = [_header(results)]
    for name, stem in macro_stems(results["order"]).items():
        row = results["baselines"][name]
        lines += [_macro(stem + field, row["display"][key]) for field, key in _FIELDS.items()]
        lines += [_macro(stem + "Wins", str(row["k"])), _macro(stem + "Answers", str(row["n"]))]
    flow = results["flow"]
    lines.append(_macro("StudyAnswers", str(flow["analysed"])))
    lines.append(_macro("StudyParticipants", str(flow["analysed_participants"])))
    lines.append(_macro("StudyRows", str(flow["rows"])))
    return "\n".join(lines) + "\n"


def preference_tex(results: Results) -> str:
    """The main table (booktabs); wants `results.tex` to be read first. Both shares of a row are printed."""
    stems = macro_stems(results["order"])
    rows = [_row(comparison_label(results, name), stem) for name, stem in stems.items()]
    mark = f"\\textbf{{{escape(results['watermark'])}}} " if results["watermark"] else ""
    flow, level = results["flow"], f"{results['level'] * 100:g}"
    caption = (
        f"{mark}Preference for {escape(target_labels(results))}. "
        f"{level}\\,\\% intervals and $p$: participant $\\times$ stimulus cluster-robust on the logit scale, "
        f"$p$ Holm-adjusted. \\StudyAnswers{{}} answers of \\StudyParticipants{{}} participants, "
        f"{flow['rows'] - flow['analysed']} of {flow['rows']} rows not analysed (rules "
        f"\\texttt{{{results['rules_sha256'][:8]}}}); data \\texttt{{{results['input_sha256'][:8]}}}."
    )
    return "\n".join([
        _header(results), r"\begin{table}", r"\centering", f"\\caption{{{caption}}}",
        r"\begin{tabular}{lrrrcrr}", r"\toprule",
        rf"Compared with & $n$ & Baseline & Target & {level}\,\% CI & $p$ (Holm) & Deff \\",
        r"\midrule", *rows, r"\bottomrule", r"\end{tabular}", r"\end{table}", "",
    ])  # fmt: skip


def _row(label: str, stem: str) -> str:
    # The empty group keeps a name that begins with [ or * from being read as an option of \\.
    def use(field: str) -> str:
        return f"\\{stem}{field}{{}}"

    cells = [
        "{}" + escape(label), use("Answers"), use("BaselineRate") + r"\,\%",
        rf"\textbf{{{use('Rate')}\,\%}}", f"{use('Low')}--{use('High')}", use("PHolm"), use("Deff"),
    ]  # fmt: skip
    return " & ".join(cells) + r" \\"


def _macro(name: str, value: str) -> str:
    return f"\\newcommand{{\\{name}}}{{{escape(value)}}}"


def _header(results: Results) -> str:
    mark = results["watermark"] or "final data"
    return (
        f"% {mark}. Written from results.json of data {results['input_sha256'][:16]}; do not edit."
    )

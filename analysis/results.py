"""`results.json`: every number of the analysis once, unrounded and as it is displayed.

All tables, figures and reports are written from this object and from nothing else.
"""

from __future__ import annotations

from dataclasses import asdict
from fractions import Fraction
from importlib import metadata
from pathlib import Path
from typing import Any

from analysis import display
from analysis.preference import Preference
from renderer.files import InputError, read_json

RESULTS_VERSION = 1
Results = dict[str, Any]
_LIBRARIES = ("numpy", "scipy", "pandas", "matplotlib")


def read_results(path: Path) -> Results:
    """Read a `results.json`; refuses another schema version."""
    results = read_json(path)
    version = results.get("schema_version") if isinstance(results, dict) else None
    if version != RESULTS_VERSION:
        raise InputError(path, "schema_version", version, str(RESULTS_VERSION))
    return dict(results)


def ordered(results: Results) -> list[tuple[str, dict[str, Any]]]:
    """Comparisons by rate, highest first: the one order of all tables and panels."""
    return [(name, results["baselines"][name]) for name in results["order"]]


def method_label(results: Results, method: str, with_id: bool = False) -> str:
    """The catalogue's display name of a method where there is one, else its identifier."""
    shown = str(results.get("names", {}).get(method, method))
    return f"{shown} ({method})" if with_id and method not in shown else shown


def comparison_label(results: Results, name: str, with_id: bool = False) -> str:
    """A comparison as readers see it: the baseline, or `target vs baseline` with several targets."""
    row = results["baselines"][name]
    methods = [row["baseline"]] if name == row["baseline"] else [row["target"], row["baseline"]]
    return " vs ".join(method_label(results, method, with_id) for method in methods)


def target_labels(results: Results) -> str:
    """The method under study, for titles and axes; of several, each row names its own first."""
    if len(results["targets"]) > 1:
        return "the first-named method"
    return ", ".join(method_label(results, target) for target in results["targets"])


def versions() -> dict[str, str]:
    """Version of this product and of the libraries whose numbers and drawings it passes on."""
    return {name: metadata.version(name) for name in ("pace-study", *_LIBRARIES)}


def watermark(mode: str, frozen: bool) -> str:
    """What must stand on every output: `SIMULATED`, `PILOT`, `PREVIEW`, `NOT FROZEN`, or nothing."""
    marks = [] if mode == "live" else [mode.upper()]
    return " · ".join(marks if frozen else [*marks, "NOT FROZEN"])


def preference_record(row: Preference) -> dict[str, Any]:
    """A row of the preference table as JSON: unrounded values, and `display` with what is printed."""
    record = {name: _plain(value) for name, value in asdict(row).items()}
    return record | {"display": _shown(row)}


def _shown(row: Preference) -> dict[str, str]:
    lost = Fraction(row.n - row.k, row.n)
    low, high = row.ci
    return {
        "rate": display.percent(Fraction(row.k, row.n)),
        "baseline_rate": display.percent(lost),
        "ci": display.percent_interval(row.ci),
        "ci_low": display.percent(low),
        "ci_high": display.percent(high),
        "ci_naive": display.percent_interval(row.ci_naive),
        "ci_exact": display.percent_interval(row.ci_exact),
        "ci_participant": display.percent_interval(row.ci_participant)
        if row.ci_participant
        else display.DASH,
        "p": display.p_value(row.p),
        "p_holm": display.p_value(row.p_holm),
        "p_exact": display.p_value(row.p_exact),
        "design_effect": display.fixed(row.design_effect, 2),
        "icc_participant": display.fixed(row.icc_participant, 3),
        "icc_stimulus": display.fixed(row.icc_stimulus, 3),
        "odds": display.fixed(row.odds, 2),
        "cohen_h": display.fixed(row.cohen_h, 2),
        "jod": display.fixed(row.jod, 2),
        "posterior_above_half": _certainty(row.posterior_above_half),
        "answers_per_stimulus": _exposure(row.answers_per_stimulus),
    }


def _certainty(value: float | None) -> str:
    """A probability that never claims to be one."""
    if value is None or 0.0001 <= value <= 0.9999:
        return display.fixed(value, 4)
    return ">0.9999" if value > 0.5 else "<0.0001"


def _exposure(values: tuple[int, float, int]) -> str:
    low, median, high = values
    return f"{low}" if low == high else f"{low} / {median:g} / {high}"


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value

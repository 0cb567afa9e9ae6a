"""From answers to tables: read, exclude, estimate, write `results.json`; then everything from that.

`python -m analysis.analyze responses.csv --out DIR`, `python analysis/analyze.py ...` and
`pace-study analyze ...` are the same command.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__" and not __package__:  # started as a file: its folder is no package root
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from analysis.codebook import read_codebook
from analysis.exclusions import apply_rules, select_mode
from analysis.preference import comparisons, preference_table
from analysis.responses import read_responses
from analysis.results import (
    RESULTS_VERSION,
    Results,
    ordered,
    preference_record,
    read_results,
    versions,
    watermark,
)
from renderer.files import write_bytes, write_json

LEVEL = 0.95


def analyze(responses_csv: Path, out: Path, *, seed: int = 0, mode: str | None = None) -> Results:
    """Analyse one export and write every output into `out`; returns what `results.json` holds."""
    path = out / "results.json"
    write_json(path, estimate(responses_csv, seed=seed, mode=mode))
    results = read_results(path)
    write_outputs(results, out)
    return results


def estimate(responses_csv: Path, *, seed: int = 0, mode: str | None = None) -> Results:
    """All numbers of one export, as `results.json` holds them; writes nothing."""
    codebook = read_codebook(responses_csv)
    everything = read_responses(responses_csv)
    responses, mode, other = select_mode(everything, mode)
    analysed, flow = apply_rules(responses, codebook.rules, codebook.main_trials, other)
    found = comparisons(analysed)
    table = preference_table(found, LEVEL)
    return {
        "schema_version": RESULTS_VERSION,
        "input": {
            "file": responses_csv.name, "rows": len(everything), "mode": mode,
            "study_id": everything.labels["study_id"][0],
            "study_versions": list(everything.labels["study_version"]),
            "collected": list(everything.started or ()),
        },
        "input_sha256": everything.sha256,
        "rules": codebook.rules, "rules_origin": codebook.rules_origin,
        "rules_sha256": codebook.rules_sha256,
        "code_version": versions()["pace-study"], "versions": versions(),
        "seed": seed, "level": LEVEL,
        "simulated": mode == "simulated", "frozen": codebook.frozen,
        "watermark": watermark(mode, codebook.frozen),
        "targets": sorted({comparison.target for comparison in found}),
        "flow": {**vars(flow)},
        "order": sorted(table, key=lambda name: (-table[name].rate, name)),
        "baselines": {name: preference_record(row) for name, row in table.items()},
        "warnings": [],
    }  # fmt: skip


def write_outputs(results: Results, out: Path) -> None:
    """Write csv, Markdown, LaTeX, figures and the HTML report from `results` alone."""
    from analysis import figures, latex, report, tables

    mark = results["watermark"]
    pages = [tables.markdown(table, mark) for table in tables.all_tables(results)]
    _text(out / "report.md", "\n".join(pages))
    _text(out / "preference.csv", tables.tidy_csv(results["baselines"], "comparison", mark))
    _text(out / "results.tex", latex.macros(results))
    _text(out / "preference.tex", latex.preference_tex(results))
    drawings: dict[str, bytes] = {}
    for name, figure in figures.all_figures(results).items():
        files = figures.draw(figure, results)
        for kind, content in files.items():
            write_bytes(out / "figures" / f"{name}.{kind}", content)
        drawings[name] = files["svg"]
    _text(out / "report.html", report.html_report(results, drawings))


def summary(results: Results, out: Path) -> dict[str, Any]:
    """What the command prints with `--json`."""
    keys = ("k", "n", "rate", "ci", "p", "p_holm", "design_effect")
    return {
        "results": str(out / "results.json"), "report": str(out / "report.html"),
        "simulated": results["simulated"], "frozen": results["frozen"],
        "watermark": results["watermark"], "rows": results["flow"]["rows"],
        "analysed": results["flow"]["analysed"], "warnings": results["warnings"],
        "baselines": {
            name: {key: row[key] for key in keys} for name, row in ordered(results)
        },
    }  # fmt: skip


def _text(path: Path, content: str) -> None:
    write_bytes(path, content.encode())


if __name__ == "__main__":
    from analysis.cli import main

    main("analyze")

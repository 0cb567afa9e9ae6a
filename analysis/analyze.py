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

from analysis.estimate import estimate
from analysis.results import Results, ordered, read_results
from renderer.files import write_bytes, write_json


def analyze(
    responses_csv: Path, out: Path, *, seed: int = 0, mode: str | None = None,
    catalogue: Path | None = None, bootstraps: int = 10_000,
) -> Results:  # fmt: skip
    """Analyse one export and write every output into `out`; returns what `results.json` holds."""
    path = out / "results.json"
    write_json(path, estimate(
        responses_csv, seed=seed, mode=mode, catalogue=catalogue, bootstraps=bootstraps,
    ))  # fmt: skip
    results = read_results(path)
    write_outputs(results, out)
    return results


def write_outputs(results: Results, out: Path) -> None:
    """Write csv, Markdown, LaTeX, figures and the HTML report from `results` alone."""
    from analysis import figures, latex, report, tables
    from analysis.prose import markdown_report

    _text(out / "report.md", markdown_report(results))
    for name, content in tables.all_csv(results).items():
        _text(out / "csv" / f"{name}.csv", content)
    _text(out / "results.tex", latex.macros(results))
    _text(out / "preference.tex", latex.preference_tex(results))
    drawings: dict[str, bytes] = {}
    for name, figure in figures.all_figures(results).items():
        files = figures.draw(figure, results)
        for kind, drawing in files.items():
            write_bytes(out / "figures" / f"{name}.{kind}", drawing)
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

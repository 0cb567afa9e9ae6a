from __future__ import annotations

import csv
import json
import math
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.backends.backend_agg import FigureCanvasAgg

from analysis import figures, latex, tables
from analysis.analyze import analyze
from analysis.cli import analyze as command
from analysis.estimate import estimate
from analysis.prose import markdown_report
from analysis.report import html_report
from analysis.results import read_results
from renderer.catalogue import Catalogue, write_catalogue
from renderer.files import InputError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def simulated(
    tmp_path_factory: pytest.TempPathFactory, make_study: Callable, make_answers: Callable
) -> Path:
    rows = make_study({"PAAK": 100, "POSA-T": 130}, participants=10, mode="simulated")
    path = make_answers(tmp_path_factory.mktemp("sim") / "responses.csv", rows)
    out = path.parent / "out"
    analyze(path, out, bootstraps=300)
    return out


@pytest.fixture(scope="module")
def final(
    tmp_path_factory: pytest.TempPathFactory, make_study: Callable, make_answers: Callable
) -> Path:
    rows = make_study({"PAAK": 100, "POSA-T": 130}, participants=10)
    path = make_answers(tmp_path_factory.mktemp("fin") / "responses.csv", rows, exclusions={})
    out = path.parent / "out"
    analyze(path, out, bootstraps=300)
    return out


def test_the_same_input_gives_the_same_bytes(simulated: Path, tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere" / "responses.csv"
    copy.parent.mkdir()
    copy.write_bytes((simulated.parent / "responses.csv").read_bytes())
    analyze(copy, tmp_path / "again", bootstraps=300)
    first, second = ({p.relative_to(base): p.read_bytes() for p in base.rglob("*") if p.is_file()}
                     for base in (simulated, tmp_path / "again"))  # fmt: skip
    assert first.keys() == second.keys()
    assert [str(name) for name in first if first[name] != second[name]] == []


def test_every_output_is_written_from_results_json_alone(simulated: Path, tmp_path: Path) -> None:
    from analysis.analyze import write_outputs

    write_outputs(read_results(simulated / "results.json"), tmp_path)
    for path in tmp_path.rglob("*.*"):
        assert path.read_bytes() == (simulated / path.relative_to(tmp_path)).read_bytes()


def test_simulated_and_unfrozen_data_are_watermarked_in_every_output(simulated: Path) -> None:
    mark = "SIMULATED · NOT FROZEN"
    assert json.loads((simulated / "results.json").read_text())["watermark"] == mark
    for path in [*simulated.glob("csv/*.csv"), simulated / "report.md", simulated / "report.html"]:
        assert mark in path.read_text(), path
    for path in simulated.glob("*.tex"):
        assert path.read_text().startswith(f"% {mark}")
    assert r"\textbf{SIMULATED $\cdot$ NOT FROZEN}" in (simulated / "preference.tex").read_text()
    for path in simulated.glob("figures/*.svg"):  # the same drawing is saved as PDF and PNG
        assert mark in path.read_text(), path


def test_final_data_carry_no_watermark(final: Path) -> None:
    for path in final.rglob("*.*"):
        assert b"SIMULATED" not in path.read_bytes() and b"NOT FROZEN" not in path.read_bytes()
    assert (final / "csv" / "preference.csv").read_text().splitlines()[1].endswith(",final")


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, dict):
        yield from (x for inner in value.values() for x in _numbers(inner))
    elif isinstance(value, list):
        yield from (x for inner in value for x in _numbers(inner))
    elif isinstance(value, float):
        yield value


@pytest.mark.parametrize(
    "make",
    [
        lambda row: [row()],
        lambda row: [row(trial_index=i, motion=f"m{i}") for i in range(1, 9)],
        lambda row: [row(participant=f"P{p}", motion=f"m{i}", trial_index=i)
                     for p in range(4) for i in (1, 2, 3)],
        lambda row: [row(participant=f"P{p}", motion=f"m{i}", trial_index=i, won=False)
                     for p in range(4) for i in (1, 2)],
        lambda row: [row(participant=f"P{p}", motion=f"m{p}", target="A" if p < 4 else "C",
                         baseline="B" if p < 4 else "D", won=p % 2 == 0) for p in range(8)],
        lambda row: [row(participant=f"P{p}", motion="m", trial_index=1, response_time_ms="unknown",
                         decision_time_ms="unknown", plays_first="unknown", plays_second="unknown",
                         started_at="unknown", won=p % 2 == 0) for p in range(12)],
    ],
    ids=["one answer", "one participant", "all wins", "no wins", "disconnected", "nothing measured"],
)  # fmt: skip
def test_odd_studies_give_flagged_finite_tables(
    make: Callable, tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    results = estimate(make_answers(tmp_path / "r.csv", make(make_row)), bootstraps=100)
    assert all(math.isfinite(value) for value in _numbers(results))
    flags = [flag for row in results["baselines"].values() for flag in row["flags"]]
    assert flags and any(line.startswith("FEW CLUSTERS") for line in results["warnings"])
    pages = [markdown_report(results), html_report(results, {}), latex.preference_tex(results)]
    for page in [*pages, *tables.all_csv(results).values()]:
        assert not re.search(r"\b(nan|inf|None)\b", page)


@pytest.mark.parametrize("seed", range(24))
def test_random_small_studies_are_finite_everywhere(
    seed: int, tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    """One-sided people, separated or disconnected methods, unbalanced clips, a target always first."""
    rng = np.random.default_rng(seed)
    people, clips, methods = (int(rng.integers(1, high)) for high in (7, 6, 4))
    taste, star, always_first = (
        rng.normal(0, [0, 3, 20][seed % 3], people),
        seed % 2 == 0,
        seed % 5 == 0,
    )
    rows = []
    for person in range(people):
        for trial in range(int(rng.integers(1, 14))):
            target = 0 if star else int(rng.integers(methods + 1))
            baseline = (target + 1 + int(rng.integers(methods))) % (methods + 1)
            rows.append(make_row(
                participant=f"P{person}", trial_index=trial + 1, target=f"m{target}", baseline=f"m{baseline}",
                scene=f"s{rng.integers(2)}", motion=f"c{rng.integers(clips)}",
                won=bool(rng.random() < 1 / (1 + math.exp(-taste[person]))),
                target_first=always_first or bool(rng.random() < 0.5),
            ))  # fmt: skip
    results = estimate(make_answers(tmp_path / "r.csv", rows), bootstraps=100)
    assert all(math.isfinite(value) for value in _numbers(results))
    page = markdown_report(results)
    assert not re.search(r"\b(nan|inf|None)\b", page)


def test_a_study_of_one_answer_is_drawn_without_complaint(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    analyze(make_answers(tmp_path / "r.csv", [make_row()]), tmp_path / "out", bootstraps=100)
    assert (tmp_path / "out" / "figures" / "forest.png").stat().st_size > 5000


def test_every_number_of_the_latex_table_is_a_macro_that_exists(final: Path) -> None:
    macros = dict(
        re.findall(r"\\newcommand\{\\(\w+)\}\{(.*)\}", (final / "results.tex").read_text())
    )
    table = (final / "preference.tex").read_text()
    used = re.findall(r"\\([A-Z]\w+)\{\}", table)
    assert set(used) <= set(macros) and {"PAAKRate", "PAAKBaselineRate", "POSATRate"} <= set(used)
    rows = re.findall(r"^(.*) \\\\$", table, re.M)[1:]
    assert not any(re.search(r"\d", re.sub(r"\\\w+", "", row)) for row in rows)
    results = read_results(final / "results.json")
    assert macros["PAAKRate"] == results["baselines"]["PAAK"]["display"]["rate"]


def test_macro_names_hold_letters_only_and_never_clash() -> None:
    many = [f"方{'法' * count}" for count in range(40)]
    stems = latex.macro_stems(
        ["pace+", "pace", "PACE", "m2", "m-two", "…", "a_b", "a b", "study", *many]
    )
    assert all(re.fullmatch("[A-Za-z]+", stem) for stem in stems.values())
    assert len(set(stems.values())) == len(stems)
    assert stems["pace+"] == "PacePlus" and stems["m2"] == "MTwo"
    assert stems["study"] != "Study"  # the macros of the flow begin so


def test_a_formula_in_a_name_is_defused_in_csv(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    name = '=HYPERLINK("http://x"&A1)'
    rows = [make_row(participant=f"P{p}", trial_index=i, motion=f"m{i}", scene="@room", baseline=name,
                     won=p % 2 == i % 2) for p in range(4) for i in (1, 2, 3)]  # fmt: skip
    results = estimate(make_answers(tmp_path / "r.csv", rows), bootstraps=100)
    files = tables.all_csv(results)
    assert "'=HYPERLINK" in files["preference"] and "'@room" in files["scenes"]
    for name, content in files.items():
        cells = [cell for row in csv.reader(content.splitlines()) for cell in row]
        assert not any(cell.startswith(("=", "@", "+")) for cell in cells), name


class _Page(HTMLParser):
    """Collects addresses and checks that tags are balanced."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [v or "" for k, v in attrs if k in ("href", "src", "xlink:href")]
        if tag not in ("meta", "link", "br", "img"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [v or "" for k, v in attrs if k in ("href", "src", "xlink:href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_report_is_one_well_formed_page_without_remote_assets(simulated: Path) -> None:
    page = _Page()
    text = (simulated / "report.html").read_text()
    page.feed(text)
    assert page.open == []
    assert all(address.startswith("#") for address in page.addresses)
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    assert {address[1:] for address in page.addresses} <= set(ids)
    assert text.count('role="img"') == 6 and "@import" not in text and "url(http" not in text


def test_tables_and_panels_share_one_order(final: Path) -> None:
    results = read_results(final / "results.json")
    assert results["order"] == ["POSA-T", "PAAK"]
    assert [row[0] for row in tables.preference_table(results).rows] == results["order"]
    table = (final / "preference.tex").read_text()
    assert table.index("POSA-T &") < table.index("PAAK &")


def test_figures_show_every_row_within_the_page(final: Path) -> None:
    results = read_results(final / "results.json")
    for name, drawing in figures.all_figures(results).items():
        with figures._style():
            figure = drawing(results)
            figure.draw_without_rendering()
            renderer = FigureCanvasAgg(figure).get_renderer()
            for axes in figure.axes:
                ticks = [
                    t.get_window_extent(renderer) for t in axes.get_xticklabels() if t.get_text()
                ]
                gaps = [b.x0 - a.x1 for a, b in pairwise(ticks)]
                assert all(gap > 2 for gap in gaps), name


def test_the_command_prints_the_table_or_one_json_object(simulated: Path, tmp_path: Path) -> None:
    source = str(simulated.parent / "responses.csv")
    shown = CliRunner().invoke(command, [source, "--out", str(tmp_path), "--bootstraps", "100"])
    assert shown.exit_code == 0 and "[SIMULATED · NOT FROZEN]" in shown.output
    done = CliRunner().invoke(
        command, [source, "--out", str(tmp_path), "--json", "--bootstraps", "100"]
    )
    answer = json.loads(done.output)
    assert answer["baselines"].keys() == {"PAAK", "POSA-T"} and answer["simulated"] is True
    assert CliRunner().invoke(command, [source]).exit_code == 2


@pytest.mark.parametrize("start", [["-m", "analysis.analyze"], ["analysis/analyze.py"]])
def test_both_ways_of_starting_end_with_one_line_on_bad_input(
    start: list[str], tmp_path: Path
) -> None:
    run = [sys.executable, *start, str(tmp_path / "none.csv"), "--out", str(tmp_path / "out")]
    done = subprocess.run(run, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_help_loads_no_numerical_library() -> None:
    heavy = "{'numpy', 'pandas', 'scipy', 'matplotlib', 'statsmodels'}"
    code = f"import sys, analysis.cli; sys.exit(len({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


def test_results_of_another_schema_are_refused(tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text('{"schema_version": 99}')
    with pytest.raises(InputError, match="schema_version: got 99"):
        read_results(tmp_path / "results.json")


def _catalogue(folder: Path, methods: dict[str, str]) -> Path:
    described = tuple({"name": name, "display_name": shown} for name, shown in methods.items())
    folder.mkdir(exist_ok=True)
    write_catalogue(Catalogue("set", "2026-01-01", {}, (), (), described, (), ()), folder)
    return folder


def test_display_names_are_read_but_nothing_is_computed_from_them(
    tmp_path: Path, make_study: Callable, make_answers: Callable
) -> None:
    path = make_answers(tmp_path / "r.csv", make_study({"PAAK": 60, "POSA-T": 70}, participants=6))
    names = {"PACE": "Ours [full]", "PAAK": "PAAK (2023)", "unused": "Other"}
    plain = estimate(path, bootstraps=100)
    named = estimate(path, bootstraps=100, catalogue=_catalogue(tmp_path / "a", names))
    assert named["names"] == {"PACE": "Ours [full]", "PAAK": "PAAK (2023)"} and plain["names"] == {}
    assert {k: v for k, v in named.items() if k not in ("names", "metrics", "warnings")} == {
        k: v for k, v in plain.items() if k not in ("names", "metrics", "warnings")
    }
    page = markdown_report(named)
    assert "Against POSA-T, Ours [full] (PACE) was chosen" in page
    assert "| PAAK (2023) | " in page and "{}PAAK (2023) & " in latex.preference_tex(named)
    assert "\nPAAK," in tables.all_csv(named)["preference"]


def test_a_display_name_of_two_methods_is_not_used(
    tmp_path: Path, make_study: Callable, make_answers: Callable
) -> None:
    path = make_answers(tmp_path / "r.csv", make_study({"PAAK": 60, "POSA-T": 70}, participants=6))
    for names in ({"PAAK": "Rival", "POSA-T": "Rival"}, {"PAAK": "POSA-T"}):
        results = estimate(path, bootstraps=100, catalogue=_catalogue(tmp_path / "set", names))
        assert results["names"] == {}


def test_the_terminal_shows_the_sum_of_all_rows_and_the_loud_lines(
    tmp_path: Path, make_study: Callable, make_answers: Callable, make_row: Callable
) -> None:
    rows = make_study({"PAAK": 60, "POSA-T": 70}, participants=6)
    rows += [make_row(participant=f"P{p:02d}", trial_index=99, trial_kind="catch", expected_method="PACE")
             for p in range(6)]  # fmt: skip
    rows[0]["late"] = "true"
    path = make_answers(tmp_path / "r.csv", rows, exclusions={"drop_late": True})
    results = estimate(path, bootstraps=100)
    shown = " ".join(tables.terminal_table(results).split())
    total = "239 answers of 6 participants analysed + 6 catch + 1 excluded by drop_late"
    assert f"246 rows = {total}." in shown
    assert results["warnings"] and all(f"! {line}" in shown for line in results["warnings"])


def test_the_methods_say_only_what_was_done(
    tmp_path: Path, make_study: Callable, make_answers: Callable
) -> None:
    path = make_answers(tmp_path / "r.csv", make_study({"PAAK": 60}, participants=6), exclusions={})
    page = markdown_report(estimate(path, bootstraps=100))
    assert "between PACE and PAAK." in page and "each of" not in page
    assert "adjusted by Holm's method" not in page and "their differences" not in page
    assert "The study design declares no rules; nothing was excluded." in page
    assert not re.search(r"(?<![−\d.])(\d[\d.]*) to \1\b", page)


@pytest.mark.parametrize(("wins", "shares"), [(9, ("56.3", "43.8")), (8, ("50.0", "50.0"))])
def test_two_halves_that_are_both_rounded_up_are_explained(
    wins: int, shares: tuple[str, str], tmp_path: Path, make_study: Callable, make_answers: Callable
) -> None:
    rows = make_study({"PAAK": wins}, participants=4, scenes=2, clips=2)
    table = tables.preference_table(
        estimate(make_answers(tmp_path / "r.csv", rows), bootstraps=100)
    )
    assert table.rows[0][3:1:-1] == shares
    assert ("two add to 100.1" in table.note) == (wins == 9)


def test_markup_in_a_name_stays_text_in_markdown_and_html(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rows = [make_row(participant=f"P{p}", trial_index=i, motion=f"m{i}", scene="<b onclick=x>",
                     baseline="<script>alert(1)</script>", won=p % 2 == i % 2)
            for p in range(4) for i in (1, 2, 3)]  # fmt: skip
    results = estimate(make_answers(tmp_path / "r.csv", rows), bootstraps=100)
    for page in (markdown_report(results), html_report(results, {})):
        assert "<script" not in page and "<b " not in page
        assert "&lt;script" in page and "&lt;b onclick" in page


def test_several_targets_are_named_row_by_row(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rows = [make_row(participant=f"P{p}", trial_index=i, motion=f"m{i}", won=(p + i) % 3 > 0,
                     target=("A", "B", "C")[i % 3], baseline=("B", "C", "A")[i % 3])
            for p in range(4) for i in range(1, 10)]  # fmt: skip
    results = estimate(make_answers(tmp_path / "r.csv", rows), bootstraps=100)
    assert sorted(results["order"]) == ["A vs B", "B vs C", "C vs A"]
    page = markdown_report(results)
    assert "forced choice between 3 pairs of A, B and C." in page
    assert "Target: the first-named method." in page
    assert r"\caption{\textbf{NOT FROZEN} Preference for the first-named method." in (
        latex.preference_tex(results)
    )
    long = "a method with a name that is long"
    assert (
        figures._label(f"{long} vs other", "n = 9") == "a method with a name …\nvs other\n(n = 9)"
    )

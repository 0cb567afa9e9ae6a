"""Tables of the report, built from `results.json` alone and written as text, Markdown, CSV and HTML."""

from __future__ import annotations

import csv
import html
import io
import textwrap
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from analysis.display import holding
from analysis.results import Results, comparison_label, ordered, target_labels
from analysis.rules import RULES, Rule

FORMULA = ("=", "+", "-", "@", "\t", "\r")


@dataclass(frozen=True)
class Table:
    """A titled table of ready strings; the first column is text, the others are numbers."""

    name: str
    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    words: bool = False
    """All columns hold words and are set flush left."""


def preference_table(results: Results) -> Table:
    """The main table: one row per baseline, headline interval, naive interval labelled as such."""
    level = f"{results['level'] * 100:g} %"
    rows = tuple(
        (
            comparison_label(results, name, with_id=True),
            f"{row['n']:,}", row["display"]["baseline_rate"], row["display"]["rate"],
            row["display"]["ci"], row["display"]["p_holm"], row["display"]["design_effect"],
            row["display"]["ci_naive"],
        )
        for name, row in ordered(results)
    )  # fmt: skip
    header = (
        "compared with", "answers", "baseline %", "target %", f"{level} CI", "p (Holm)",
        "design effect", "naive CI*",
    )  # fmt: skip
    return Table("preference", "Preference per baseline", header, rows, preference_note(results))


def preference_note(results: Results) -> str:
    """What the columns of the main table mean, and on how many people and stimuli they rest."""
    flow = results["flow"]
    notes = [
        f"Target: {target_labels(results)}. Intervals: participant x stimulus cluster-robust "
        "on the logit scale; p against 50 % from the same model, Holm-adjusted over the rows.",
        "* Wilson; assumes independent answers.",
        _conservation(flow),
    ]
    shown = [row["display"] for _, row in ordered(results)]
    if any(Fraction(row["rate"]) + Fraction(row["baseline_rate"]) != 100 for row in shown):
        notes.append(
            "Shares are rounded half-up one by one; a share of exactly x.x5 makes two add to 100.1."
        )
    notes += [
        f"{comparison_label(results, name)}: {flag}."
        for name, row in ordered(results)
        for flag in row["flags"]
    ]
    return " ".join(notes)


def _conservation(flow: dict[str, Any]) -> str:
    """Every row of the file in one sum: analysed, or left out for a reason."""
    people = holding(flow["analysed_participants"], "participant")
    gone = [f"{count:,} mode {mode}" for mode, count in flow["other_mode"].items()]
    gone += [f"{count:,} {kind}" for kind, count in flow["other_kind"].items()]
    gone += [
        f"{count:,} excluded by {rule}" for rule, count in flow["excluded_answers"].items() if count
    ]
    total = " + ".join([f"{flow['analysed']:,} answers of {people} analysed", *gone])
    return f"{holding(flow['rows'], 'row')} = {total}."


def flow_table(results: Results) -> Table:
    """From the rows of the file to the answers analysed; the counts add up."""
    flow = results["flow"]
    rows = [("rows in the file", f"{flow['rows']:,}", f"{flow['participants']}", "")]
    rows += [(f"not analysed: mode {m}", _less(c), "", "") for m, c in flow["other_mode"].items()]
    rows += [(f"not analysed: {k} trials", _less(c), "", "") for k, c in flow["other_kind"].items()]
    rows += [_excluded(rule, results) for rule in RULES if rule.name in flow["excluded_answers"]]
    rows.append(("analysed", f"{flow['analysed']:,}", f"{flow['analysed_participants']}", ""))
    header = ("step", "answers", "participants", "rule alone would remove")
    return Table("flow", "From the file to the analysis", header, tuple(rows))


def _excluded(rule: Rule, results: Results) -> tuple[str, str, str, str]:
    """What a rule removed after those before it, and what it would remove by itself."""
    flow, name = results["flow"], rule.name
    prose = rule.prose[0].lower() + rule.prose[1:].rstrip(".")
    people = flow["excluded_participants"]
    return (
        f"excluded: {prose} ({name} = {results['rules'][name]:g})",
        _less(flow["excluded_answers"][name]), _less(people[name]) if name in people else "",
        f"{flow['hits'][name]:,} {rule.removes}{'' if flow['hits'][name] == 1 else 's'}",
    )  # fmt: skip


def _less(count: int) -> str:
    return f"−{count:,}" if count else "0"


def all_tables(results: Results) -> list[Table]:
    """Every table of the report that has rows, in reading order."""
    from analysis import more_tables as more

    builders = (
        preference_table, more.interval_table, more.effect_table, more.difference_table,
        more.scene_table, flow_table, more.quality_table, more.sensitivity_table,
        more.reliability_table, more.scale_table, more.metric_table,
    )  # fmt: skip
    return [table for table in (build(results) for build in builders) if table.rows]


def terminal_table(results: Results) -> str:
    """The main table as plain text of about 100 columns, with watermark, notes and loud lines."""
    mark = results["watermark"]
    title = f"Preference for {target_labels(results)}" + (f"   [{mark}]" if mark else "")
    table = preference_table(results)
    short = tuple(name.replace("design effect", "deff") for name in table.header)
    loud = [line for text in results["warnings"] for line in _wrapped(f"! {text}", 100)]
    return "\n".join([title, *_aligned((short, *table.rows)), *_wrapped(table.note, 100), *loud])


def markdown(table: Table, mark: str) -> str:
    """A pipe table under its title."""
    cells = [[_escape_pipe(cell) for cell in row] for row in (table.header, *table.rows)]
    lines = ["| " + " | ".join(row) + " |" for row in cells]
    rule = "|---" if table.words else "|---:"
    lines.insert(1, "|---" + rule * (len(table.header) - 1) + "|")
    head = [f"### {table.title}", ""] + ([f"**{mark}**", ""] if mark else [])
    return "\n".join([*head, *lines, *(["", table.note] if table.note else []), ""])


def html_table(table: Table) -> str:
    """A `<table>` with caption, column headers and row headers."""
    head = "".join(f'<th scope="col">{html.escape(cell)}</th>' for cell in table.header)
    body = "".join(
        f'<tr><th scope="row">{html.escape(row[0])}</th>'
        + "".join(f"<td>{html.escape(cell)}</td>" for cell in row[1:])
        + "</tr>\n"
        for row in table.rows
    )
    note = f'<p class="note">{html.escape(table.note)}</p>' if table.note else ""
    caption = f"<caption>{html.escape(table.title)}</caption>"
    kind = ' class="words"' if table.words else ""
    return (
        f"<table{kind}>{caption}<thead><tr>{head}</tr></thead><tbody>\n{body}</tbody></table>{note}"
    )


def all_csv(results: Results) -> dict[str, str]:
    """Tidy files of unrounded values, one per table, by name."""
    rows = ordered(results)
    nested = {
        "scenes": "scenes", "stimuli": "stimuli_rates",
    }  # fmt: skip
    files = {"preference": [{"comparison": name} | _main_values(row) for name, row in rows]}
    for file, key in nested.items():
        files[file] = [{"comparison": name} | inner for name, row in rows for inner in row[key]]
    files["participants"] = [
        {"comparison": name, "k": k, "n": n}
        for name, row in rows
        for k, n in row["participant_counts"]
    ]
    files["sensitivity"] = [
        {"comparison": name} | inner
        for name in results["order"]
        for inner in results["sensitivity"][name]
    ]
    files["differences"] = results["differences"]
    files["scale"] = results["scale"]["methods"]
    files["metrics"] = [{"metric": m} | r for m, r in results["metrics"]["metrics"].items()]
    mark = results["watermark"]
    return {name: tidy_csv(records, mark) for name, records in files.items() if records}


def tidy_csv(records: list[dict[str, Any]], mark: str) -> str:
    """Unrounded values, one record a row, the watermark in a column of its own.

    Text that a spreadsheet would run as a formula is preceded by an apostrophe.
    """
    flat = [_flatten(record) for record in records]
    names = list(dict.fromkeys(column for record in flat for column in record))
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*names, "status"])
    for record in flat:
        cells = [_safe(record.get(name, "")) for name in names]
        writer.writerow([*cells, mark or "final"])
    return stream.getvalue()


def _main_values(row: dict[str, Any]) -> dict[str, Any]:
    """A row of the main table without its nested tables."""
    nested = ("scenes", "stimuli_rates", "participant_counts", "display")
    return {name: value for name, value in row.items() if name not in nested}


def _flatten(record: dict[str, Any]) -> dict[str, Any]:
    """Lists become numbered columns, flags one cell; display strings stay out (round for yourself)."""
    flat: dict[str, Any] = {}
    for name, value in record.items():
        if name == "display":
            continue
        if name == "flags":
            flat[name] = "; ".join(value)
        elif isinstance(value, list) and len(value) == 2:
            flat[f"{name}_low"], flat[f"{name}_high"] = value
        elif isinstance(value, list):
            flat |= {f"{name}_{index}": item for index, item in enumerate(value, 1)}
        elif isinstance(value, dict):
            flat |= {f"{name}_{inner}": item for inner, item in _flatten(value).items()}
        else:
            flat[name] = "" if value is None else value
    return flat


def _safe(cell: Any) -> Any:
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


def _escape_pipe(cell: str) -> str:
    return cell.replace("|", "\\|")


def _aligned(rows: tuple[tuple[str, ...], ...]) -> list[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    widths[0] = min(widths[0], max(24, 100 - sum(width + 2 for width in widths[1:])))
    lines = []
    for row in rows:
        first = row[0] if len(row[0]) <= widths[0] else row[0][: widths[0] - 1] + "…"
        cells = [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join([first.ljust(widths[0]), *cells]).rstrip())
    return [lines[0], "-" * max(len(line) for line in lines), *lines[1:]]


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, width)

"""One self-contained HTML page: tables, figures as inline SVG, no remote assets; prints well."""

from __future__ import annotations

import html
import re

from analysis.figures import CAPTIONS
from analysis.prose import checklist, methods_paragraph, results_paragraph
from analysis.results import Results
from analysis.tables import Table, all_tables, html_table

_SECTIONS = (
    ("Result", ("preference",), ("forest", "shares")),
    ("Methods", (), ()),
    ("How sure is it?", ("intervals", "effects", "differences"), ("participants",)),
    ("Scenes and stimuli", ("scenes",), ("scenes", "stimuli")),
    ("Data and their quality", ("flow", "quality"), ()),
    ("Does it hang on something?", ("sensitivity",), ()),
    ("Agreement and scale", ("reliability", "scale"), ("scale",)),
    ("Link to the metrics", ("metrics",), ()),
)

_CSS = """
body{font:16px/1.5 system-ui,-apple-system,"Segoe UI",sans-serif;color:#1a1a1a;background:#fff;
max-width:66rem;margin:0 auto;padding:1.5rem}
h1{font-size:1.6rem;margin:.2rem 0}h2{font-size:1.2rem;margin:2.2rem 0 .5rem;border-bottom:1px solid #c9c9c9}
.mark{background:#fff1e5;border:2px solid #c05a00;
color:#7a3800;font-weight:700;padding:.5rem .8rem;margin:1rem 0}
.warn{border-left:4px solid #c05a00;padding:.2rem .8rem;margin:.6rem 0;background:#fff8f2}
.scroll{overflow-x:auto}table{border-collapse:collapse;width:100%;margin:.5rem 0;font-size:.92rem}
caption{text-align:left;font-weight:600;padding:.3rem 0}
thead th{border-top:2px solid #1a1a1a;border-bottom:1px solid #1a1a1a;text-align:right;vertical-align:bottom}
thead th:first-child,tbody th{text-align:left;font-weight:400}
tbody tr:last-child>*{border-bottom:2px solid #1a1a1a}
th,td{padding:.28rem .6rem}td{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.words th,.words td,.words thead th{text-align:left;white-space:normal}
dt{font-weight:600;margin-top:.6rem}dd{margin:0 0 0 1rem}
.note,figcaption,footer{font-size:.85rem;color:#4a4a4a}
figure{margin:1rem 0}figure svg{max-width:100%;height:auto}
code{font-size:.85em;overflow-wrap:anywhere}
tbody th{min-width:8.5rem}
@media print{body{max-width:none;padding:0;font-size:11pt}.scroll{overflow:visible}
table{font-size:8.5pt}.note,figcaption,footer{font-size:8.5pt}th,td{padding:.12rem .25rem}
tbody th{min-width:0}h2,caption{break-after:avoid}table,figure{break-inside:avoid}
}
"""


def html_report(results: Results, figures: dict[str, bytes]) -> str:
    """The whole page; `figures` are SVG files by name."""
    title = f"Preference report: {results['input']['study_id']}"
    mark = results["watermark"]
    banner = f'<p class="mark" role="note">{html.escape(mark)}</p>' if mark else ""
    tables = {table.name: table for table in all_tables(results)}
    body = [f"<h1>{html.escape(title)}</h1>", banner, _warnings(results)]
    for heading, names, pictures in _SECTIONS:
        parts = [_part(tables[name]) for name in names if name in tables]
        parts += [_figure(name, figures[name]) for name in pictures if name in figures]
        if heading == "Result":
            parts.insert(0, f"<p>{html.escape(results_paragraph(results))}</p>")
        if heading == "Methods":
            parts.append(f"<p>{html.escape(methods_paragraph(results))}</p>")
        if parts:
            body += [f"<h2>{heading}</h2>", *parts]
    body += ["<h2>A reviewer's questions</h2>", _checklist(results), _footer(results)]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{_CSS}</style></head>\n<body><main>\n"
        + "\n".join(body)
        + "\n</main></body></html>\n"
    )


def inline_svg(svg: bytes, label: str, prefix: str) -> str:
    """An SVG file as an element of a page; its ids are made unique to the figure."""
    text = svg.decode()
    text = text[text.index("<svg") :]
    text = re.sub(r'(?<=\bid=")', prefix, text)
    text = re.sub(r'(?<=href="#)|(?<=url\(#)', prefix, text)
    return text.replace("<svg", f'<svg role="img" aria-label="{html.escape(label)}"', 1)


def _part(table: Table) -> str:
    return f'<div class="scroll">{html_table(table)}</div>'


def _checklist(results: Results) -> str:
    rows = "".join(
        f"<dt>{html.escape(question)}</dt><dd>{html.escape(answer)}</dd>\n"
        for question, answer in checklist(results)
    )
    return f"<dl>{rows}</dl>"


def _figure(name: str, svg: bytes) -> str:
    caption = CAPTIONS[name]
    picture = inline_svg(svg, caption, name + "-")
    return f"<figure>{picture}<figcaption>{html.escape(caption)}</figcaption></figure>"


def _warnings(results: Results) -> str:
    lines = [f'<p class="warn">{html.escape(line)}</p>' for line in results["warnings"]]
    return "\n".join(lines)


def _footer(results: Results) -> str:
    used = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    return (
        f"<footer><p>Data <code>{results['input_sha256']}</code>, rules "
        f"<code>{results['rules_sha256']}</code>, seed {results['seed']}; {html.escape(used)}.</p></footer>"
    )

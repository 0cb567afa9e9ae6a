"""The reference pages name what the code has."""

from __future__ import annotations

import re
from pathlib import Path

import click

from analysis.analyze import write_outputs
from analysis.cli import analyze
from analysis.estimate import estimate
from analysis.results import read_results
from analysis.rules import RULES
from renderer.files import write_json

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "reference" / "analysis.md").read_text()


def test_the_page_names_every_option_and_rule() -> None:
    options = [
        option for one in analyze.params if isinstance(one, click.Option) for option in one.opts
    ]
    assert [option for option in options if f"`{option}" not in PAGE] == []
    assert [rule.name for rule in RULES if f"| `{rule.name}` | {rule.removes}s |" not in PAGE] == []


def test_the_page_links_every_statistic_and_each_says_what_it_was_checked_against() -> None:
    pages = sorted((DOCS / "reference" / "statistics").glob("*.md"))
    assert len(pages) > 10
    for page in pages:
        assert f"(statistics/{page.name})" in PAGE
        text = page.read_text()
        for part in ("**Answers:**", "**Do not use", "**Checked against**"):
            assert part in text, (page.name, part)


def test_the_page_names_every_key_and_file(paper_answers: Path, tmp_path: Path) -> None:
    results = estimate(paper_answers, bootstraps=100)
    named = set(re.findall(r"\w+", PAGE))
    assert set(results) - {"baselines"} <= named
    assert set(next(iter(results["baselines"].values()))) - {"baseline", "target"} <= named
    write_json(tmp_path / "results.json", results)
    write_outputs(read_results(tmp_path / "results.json"), tmp_path)
    files = {path.stem for path in tmp_path.rglob("*.*")}
    assert files <= named

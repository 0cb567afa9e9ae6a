from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from analysis.claims import check_claims, check_text, implied_counts
from analysis.claims_found import names_from_results, read_claim_names
from analysis.claims_text import sentences
from analysis.cli import check_claims as command
from analysis.display import percent
from analysis.estimate import estimate
from analysis.results import Results
from renderer.files import InputError, write_json

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "data" / "analysis"
PAPER_NAMES = ROOT / "docs" / "examples" / "pace-paper.claims.toml"


@pytest.fixture(scope="module")
def paper_results(paper_answers: Path) -> Results:
    return estimate(paper_answers, bootstraps=200)


@pytest.mark.shared
def test_the_papers_abstract_contradicts_its_table(shared_data: Path) -> None:
    paper = (shared_data.parent / "reference" / "paper.tex").read_text()
    claims = check_claims(paper, read_claim_names(PAPER_NAMES))
    wrong = {(c.shown, c.comparison, c.line) for c in claims if c.verdict == "MISMATCH"}
    assert wrong == {("57.1", "PAAK", 24), ("81.0", "Motion Synthesis", 24)}
    notes = {c.shown: c.note for c in claims if c.verdict == "MISMATCH"}
    assert "59.3 % (line 65)" in notes["57.1"] and "implies 480 of 840" in notes["57.1"]
    assert "81.2 % (line 311)" in notes["81.0"] and "implies 680 of 840" in notes["81.0"]
    assert [c.verdict for c in claims if c.shown == "67.9"] == ["OK"] * 3


@pytest.mark.shared
def test_the_paper_is_checked_against_results_too(
    shared_data: Path, paper_results: Results
) -> None:
    paper = (shared_data.parent / "reference" / "paper.tex").read_text()
    claims = check_claims(paper, read_claim_names(PAPER_NAMES), paper_results)
    assert [c.shown for c in claims if c.verdict == "MISMATCH"] == ["57.1", "81.0"]
    assert [c.verdict for c in claims if c.kind == "count"] == ["OK", "OK"]


def test_a_correct_text_has_no_mismatch_with_or_without_data(
    paper_results: Results, tmp_path: Path
) -> None:
    results = tmp_path / "results.json"
    write_json(results, paper_results)
    for known in (results, None):
        claims = check_text(DATA / "clean.tex", DATA / "claims.toml", known)
        assert [c for c in claims if c.verdict == "MISMATCH"] == []
    claims = check_text(DATA / "clean.tex", None, results)  # claims.toml beside the text
    matched = [c for c in claims if c.comparison is not None]
    assert len(matched) == 17 and {c.verdict for c in matched} == {"OK"}
    assert "99" not in {c.shown for c in claims}


def test_every_planted_error_is_found(paper_results: Results, tmp_path: Path) -> None:
    results = tmp_path / "results.json"
    write_json(results, paper_results)
    claims = check_text(DATA / "planted.md", DATA / "claims.toml", results)
    wrong = [(c.line, c.shown) for c in claims if c.verdict == "MISMATCH"]
    assert wrong == [
        (4, "81.3"), (4, "489 of 840"), (8, "67.9"), (8, "32.1"), (12, "57.9–62.6"),
        (12, "in total 44 participants"), (13, "p > 0.5"),
    ]  # fmt: skip
    alone = check_text(DATA / "planted.md", DATA / "claims.toml", None)
    assert [(c.line, c.shown) for c in alone if c.verdict == "MISMATCH"] == [(4, "81.3")]


@given(st.integers(1, 900), st.data())
def test_every_printed_share_implies_its_count(n: int, data: st.DataObject) -> None:
    k = data.draw(st.integers(0, n))
    found = implied_counts(percent(Fraction(k, n)), n)
    assert k in found
    assert all(percent(Fraction(other, n)) == percent(Fraction(k, n)) for other in found)


def test_an_impossible_percentage_is_a_mismatch() -> None:
    names = read_claim_names(PAPER_NAMES)
    possible = {percent(Fraction(k, 840)) for k in range(841)}
    assert len(possible) == 841  # of the 1001 one-decimal values
    impossible = next(f"60.{d}" for d in range(10) if f"60.{d}" not in possible)
    (claim,) = check_claims(
        f"Raters prefer PACE {impossible}% of the time over PAAK.", names, latex=False
    )
    assert (claim.verdict, claim.note) == ("MISMATCH", "no whole number of 840 answers prints so")


def test_sentences_keep_their_place_and_split_rows() -> None:
    source = "A \\textbf{bold} claim~\\cite{x}. Next, e.g. this.\n\nB & 5\\% \\\\ C & 6\\% \\\\"
    found = list(sentences(source, latex=True))
    assert [" ".join(s.text.split()) for s in found] == [
        "A bold claim .", "Next, e.g. this.", "B & 5 %", "C & 6 %",
    ]  # fmt: skip
    assert all(source[s.start + s.text.index("C ")] == "C" for s in found if "C " in s.text)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("schema_version = 2", "schema_version: got 2"),
        ("schema_version = 1", "comparison: got 'none'"),
        ("schema_version = 1\nmethod = 3", "key: got 'method'"),
        ("schema_version = 1\n[comparison.A]\naliases = 3", "comparison.A"),
        ("schema_version = 1\ntarget = 'A'\n[comparison.A]", "target: got 'A', wanted a list"),
        ("schema_version = 1\nanswers = 'x'\n[comparison.A]", "answers: got 'x'"),
        ("schema_version = 1\ncomparison = 3", "comparison: got 3"),
        ("=", "content: got"),
    ],
)
def test_a_wrong_claims_file_is_one_line(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "claims.toml"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        read_claim_names(path)


def test_the_command_exits_with_one_on_a_mismatch_only(tmp_path: Path, make_row: Callable) -> None:
    text = tmp_path / "text.md"
    (tmp_path / "claims.toml").write_text((DATA / "claims.toml").read_text())
    text.write_text("Raters prefer ours 60 % of the time over the generator.\n")
    good = CliRunner().invoke(command, [str(text)])
    assert good.exit_code == 0 and "1 UNMATCHED" in good.output
    text.write_text(
        text.read_text() * 2 + "They prefer ours 70 % of the time over the generator.\n"
    )
    bad = CliRunner().invoke(command, [str(text), "--json"])
    assert bad.exit_code == 1 and '"mismatches": 1' in bad.output


def test_a_number_speaks_of_the_name_in_its_own_clause(tmp_path: Path) -> None:
    """Numbers in brackets behind a name, and contrasts within a sentence."""
    names = tmp_path / "claims.toml"
    names.write_text("schema_version = 1\nanswers = 450\n[comparison.Beta]\n[comparison.Gamma]\n")
    text = (
        "The preference over Gamma (52.0 %) is small, whereas Beta lost (36.7 % preferred Beta).\n\n"
        "It wins 63.3 % against Beta (285/450) and 52.0 % against Gamma.\n"
    )
    found = check_claims(text, read_claim_names(names), latex=False)
    assert [(claim.shown, claim.comparison) for claim in found if claim.line == 1] == [
        ("52.0", "Gamma"), ("36.7", "Beta"),
    ]  # fmt: skip
    assert {(c.shown, c.comparison) for c in found if c.line == 3} == {
        ("63.3", "Beta"), ("52.0", "Gamma"), ("285 of 450", "Beta"),
    }  # fmt: skip
    assert {claim.verdict for claim in found if claim.kind == "percentage"} == {"OK"}


@pytest.mark.parametrize(
    ("text", "verdict"),
    [
        ("p = .012", "OK"), ("p = 0.0123", "OK"), ("p = 1.2e-2", "OK"), ("p < 0.05", "OK"),
        ("p = 1.3e-2", "MISMATCH"), ("p = 0.013", "MISMATCH"), ("p < 0.01", "MISMATCH"),
    ],
)  # fmt: skip
def test_p_values_are_compared_as_they_are_printed(
    text: str, verdict: str, paper_results: Results
) -> None:
    rows = {name: row | {"p": 0.0123, "p_holm": 0.0123, "p_exact": 0.0123}
            for name, row in paper_results["baselines"].items()}  # fmt: skip
    changed = paper_results | {"baselines": rows}
    names = names_from_results(changed)
    found = check_claims(f"PACE was preferred over PAAK ({text}).", names, changed, latex=False)
    assert [(claim.kind, claim.verdict) for claim in found] == [("p", verdict)]


def test_intervals_and_p_belong_to_the_share_before_them(paper_results: Results) -> None:
    low, high = (percent(bound) for bound in paper_results["baselines"]["PAAK"]["ci"])
    text = (
        f"PACE was preferred over PAAK in 59.3 % of all answers [{low}, {high}], p < .001 and over POSA-T "
        f"in 67.9 %. Chosen in 59.3 % [{low}, {high}] (p < .001) over PAAK, in 67.9 % over POSA-T.\n"
    )
    found = check_claims(text, names_from_results(paper_results), paper_results, latex=False)
    beside = [claim for claim in found if claim.kind in ("interval", "p")]
    assert [claim.comparison for claim in beside] == ["PAAK"] * 4
    assert {claim.verdict for claim in found} == {"OK"}

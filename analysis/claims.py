"""Do the numbers of a text agree with the results, and with one another?

Percentages, intervals, counts and p values are found sentence by sentence and attached to a
comparison by the aliases of `claims.toml`. Nothing here knows a method's name.
"""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

from analysis.claims_text import Lines, Sentence, sentences
from analysis.display import round_half_up
from analysis.results import Results, read_results
from renderer.files import InputError

Verdict = Literal["OK", "MISMATCH", "UNMATCHED"]
_NUMBER = r"(?<![\w.])(\d{1,3}(?:\.\d+)?)"
_PERCENT = re.compile(_NUMBER + r"\s*(?:%|percent\b|per cent\b)")
_RANGE = re.compile(r"\[?\s*(\d{1,2}\.\d+)\s*%?\s*(?:–|--|-|,|to)\s*(\d{1,3}\.\d+)\s*%?\s*\]?")
_LEVEL = re.compile(r"\s*(?:CI\b|confidence|interval|credible|level|power)")
_P = re.compile(r"\bp\s*(<|=|≤|>)\s*(0?\.\d+(?:e-\d+)?)")
_OF = re.compile(r"\b(\d[\d,]*)\s*(?:of|out of|/)\s*(?:the\s+)?(\d[\d,]*)\b")
_N = re.compile(r"\b[nN]\s*=\s*(\d[\d,]*)")
_COUNT = re.compile(
    r"\b(\d[\d,]*)\s+(?:\w+\s+)?(participants|raters|subjects|observers|answers|responses|judg\w+)"
)
_PEOPLE = ("participants", "raters", "subjects", "observers")
_TOTAL = re.compile(r"took part|in total|total of|altogether|overall", re.I)
PREFERENCE = ("prefer", "of the time", "chose", "natural", "favour", "favor", "picked", "voted")


@dataclass(frozen=True)
class ClaimNames:
    """What `claims.toml` says of the text."""

    aliases: dict[str, str]
    """Phrase in lower case -> comparison."""
    results: dict[str, str]
    """Comparison -> its name in results.json."""
    target: tuple[str, ...] = ()
    """Phrases for the target, to tell the columns of a table apart."""
    ignore: tuple[str, ...] = ()
    """Words that make a percentage something else (another metric)."""
    answers: int | None = None
    """Answers per comparison, for the k/n a percentage implies; results.json knows better."""


@dataclass(frozen=True)
class Claim:
    """One number of the text and what was found about it."""

    kind: Literal["percentage", "interval", "count", "p"]
    shown: str
    line: int
    comparison: str | None = None
    verdict: Verdict = "UNMATCHED"
    note: str = ""
    share: Literal["target", "other", "either"] = field(default="either", repr=False)
    """Whose share a table column says it is."""


def read_claim_names(path: Path) -> ClaimNames:
    """Read a `claims.toml`; raises `InputError` naming file and field."""
    try:
        record = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(path, "file", "missing", "a claims.toml with names and aliases") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(path, "content", str(error), "valid TOML") from None
    if record.get("schema_version") != 1:
        raise InputError(path, "schema_version", record.get("schema_version"), "the number 1")
    known = {"schema_version", "target", "ignore", "answers", "comparison"}
    for key in record:
        if key not in known:
            raise InputError(path, "key", key, ", ".join(sorted(known)))
    aliases: dict[str, str] = {}
    results: dict[str, str] = {}
    for name, entry in record.get("comparison", {}).items():
        if not isinstance(entry, dict) or not isinstance(entry.get("aliases", []), list):
            raise InputError(path, f"comparison.{name}", entry, "a table with a list of aliases")
        aliases |= {_squeeze(alias): name for alias in [name, *entry.get("aliases", [])]}
        results[name] = str(entry.get("result", name))
    if not aliases:
        raise InputError(path, "comparison", "none", "at least one [comparison.NAME]")
    return ClaimNames(
        aliases, results, tuple(_squeeze(word) for word in record.get("target", [])),
        tuple(word.lower() for word in record.get("ignore", [])), record.get("answers"),
    )  # fmt: skip


def names_from_results(results: Results) -> ClaimNames:
    """Names when there is no `claims.toml`: those of the results themselves."""
    names = results["order"]
    return ClaimNames(
        {_squeeze(name): name for name in names}, {name: name for name in names},
        tuple(_squeeze(name) for name in results["targets"]),
    )  # fmt: skip


def check_claims(
    source: str, names: ClaimNames, results: Results | None = None, *, latex: bool = True
) -> list[Claim]:
    """Every number found, with its verdict; against `results` where given, else against one another."""
    lines, column = Lines(source), None
    claims: list[Claim] = []
    for sentence in sentences(source, latex):
        if not sentence.is_row:
            column = None
        elif not _PERCENT.search(sentence.text):
            found = _header_column(sentence, names)
            column = column if found is None else found
        claims += _find(sentence, names, lines, column)
    judged = [_judge(claim, names, results) for claim in claims]
    return judged if results is not None else _against_one_another(judged)


def check_text(text: Path, claims: Path | None, results: Path | None) -> list[Claim]:
    """`check_claims` for files: names from `claims`, else `claims.toml` beside `text`, else the results."""
    latex = text.suffix.lower() == ".tex"
    if not latex and text.suffix.lower() not in (".md", ".markdown", ".txt"):
        raise InputError(text, "suffix", text.suffix, ".tex, .md or .txt")
    try:
        source = text.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(text, "file", "missing", "an existing text") from None
    except UnicodeDecodeError as error:
        raise InputError(text, "content", str(error), "UTF-8") from None
    known = read_results(results) if results is not None else None
    beside = text.with_name("claims.toml")
    if claims is None and known is not None and not beside.is_file():
        names = names_from_results(known)
    else:
        names = read_claim_names(claims or beside)
    return check_claims(source, names, known, latex=latex)


def claims_table(claims: list[Claim]) -> str:
    """One line a number: verdict, line, number, comparison, note; the verdicts' counts at the end."""
    rows = [
        f"{claim.verdict:<9}  line {claim.line:<5} {_printed(claim):<22} "
        f"{claim.comparison or '-':<20} {claim.note}"
        for claim in claims
    ]
    verdicts = Counter(claim.verdict for claim in claims)
    total = ", ".join(f"{verdicts[v]} {v}" for v in ("OK", "MISMATCH", "UNMATCHED"))
    return "\n".join([*(row.rstrip() for row in rows), total])


def _printed(claim: Claim) -> str:
    return f"{claim.shown} %" if claim.kind in ("percentage", "interval") else claim.shown


def implied_counts(shown: str, n: int) -> list[int]:
    """All k for which k of n prints as this percentage (half-up); none means it cannot be a share of n."""
    digits = len(shown.partition(".")[2])
    near = int(Fraction(shown) / 100 * n)
    reach = range(max(0, near - 1 - n // 100), min(n, near + 2 + n // 100) + 1)
    return [k for k in reach if round_half_up(Fraction(100 * k, n), digits) == shown]


def _find(
    sentence: Sentence, names: ClaimNames, lines: Lines, column: int | None
) -> Iterator[Claim]:
    text = sentence.text
    mentions = _mentions(text, names)
    taken = [m.span() for m in _RANGE.finditer(text) if _is_interval(text, m)]
    preference = (sentence.is_row and bool(mentions)) or any(
        word in text.lower() for word in PREFERENCE
    )
    numbers = [m for m in _PERCENT.finditer(text) if not _LEVEL.match(text[m.end() :])]
    numbers = [m for m in numbers if not any(a <= m.start() < b for a, b in taken)]
    marks = [m.start() for m in numbers]

    def claim(kind: Any, shown: str, at: int, comparison: str | None) -> Claim:
        return Claim(kind, shown, lines.at(sentence.start + at), comparison)

    for match in numbers:
        ignored = any(word in _clause(text, match.start()) for word in names.ignore)
        found = _attached(match.start(), marks, mentions) if preference and not ignored else None
        one = claim("percentage", match.group(1), match.start(), found)
        if column is not None and found is not None:
            mine = text.count("&", 0, match.start()) == column
            one = replace(one, share="target" if mine else "other")
        yield one
    for match in _RANGE.finditer(text):
        if match.span() in taken:
            found = _attached(match.start(), [match.start()], mentions)
            yield claim("interval", f"{match.group(1)}–{match.group(2)}", match.start(), found)
    for match in _P.finditer(text):
        found = _attached(match.start(), [m.start() for m in _P.finditer(text)], mentions)
        yield claim("p", f"p {match.group(1)} {match.group(2)}", match.start(), found)
    yield from _find_counts(text, claim, mentions)


def _find_counts(text: str, claim: Any, mentions: list[tuple[int, int, str]]) -> Iterator[Claim]:
    for match in _OF.finditer(text):
        found = _attached(match.start(), [match.start()], mentions)
        yield claim("count", f"{match.group(1)} of {match.group(2)}", match.start(), found)
    for match in _N.finditer(text):
        found = _attached(match.start(), [match.start()], mentions)
        yield claim("count", f"n = {match.group(1)}", match.start(), found)
    for match in _COUNT.finditer(text):
        if not any(m.start() <= match.start() < m.end() for m in _OF.finditer(text)):
            total = "in total " if _TOTAL.search(text) else ""
            yield claim("count", f"{total}{match.group(1)} {match.group(2)}", match.start(), None)


def _mentions(text: str, names: ClaimNames) -> list[tuple[int, int, str]]:
    """Where comparisons are named: start, end, comparison; longer phrases first, none inside another."""
    found: list[tuple[int, int, str]] = []
    for alias in sorted(names.aliases, key=len, reverse=True):
        pattern = r"(?<![\w])" + r"\s+".join(map(re.escape, alias.split())) + r"(?![\w-])"
        for match in re.finditer(pattern, text, re.I):
            if not any(a < match.end() and match.start() < b for a, b, _ in found):
                found.append((match.start(), match.end(), names.aliases[alias]))
    return sorted(found)


def _attached(at: int, marks: list[int], mentions: list[tuple[int, int, str]]) -> str | None:
    """The comparison a number speaks of.

    Where every number of the sentence has a comparison named after it ("60 % over A, 70 % over B"),
    it is the one named next; else the last one named before it ("over A 60 %, over B 70 %").
    """
    following = min((mark for mark in marks if mark > at), default=1 << 60)
    before = [name for start, _, name in mentions if start < at]
    after = [name for start, _, name in mentions if at < start < following]
    all_follow = sum(start > min(marks) for start, _, _ in mentions) >= len(marks)
    if after and (all_follow or not before):
        return after[0]
    return before[-1] if before else None


def _clause(text: str, at: int) -> str:
    """The part of a sentence around a number, between commas and semicolons."""
    begin = max(text.rfind(mark, 0, at) for mark in ",;(")
    ends = [text.find(mark, at) for mark in ",;)"]
    end = min((e for e in ends if e >= 0), default=len(text))
    return text[begin + 1 : end].lower()


def _is_interval(text: str, match: re.Match[str]) -> bool:
    before = text[max(0, match.start() - 40) : match.start()]
    return match.group().lstrip().startswith("[") or bool(re.search(r"CI|interval|from", before))


def _header_column(sentence: Sentence, names: ClaimNames) -> int | None:
    cells = [_squeeze(cell) for cell in sentence.text.split("&")]
    found = [i for i, cell in enumerate(cells) if any(word in cell for word in names.target)]
    return found[0] if found else None


def _judge(claim: Claim, names: ClaimNames, results: Results | None) -> Claim:
    if claim.kind == "count":
        return _judge_count(claim, names, results)
    row = _row(claim.comparison, names, results)
    if claim.kind == "percentage":
        n = row["n"] if row else names.answers
        if claim.comparison and n:
            claim = _with_counts(claim, n)
        return _judge_percentage(claim, row) if row else claim
    if row is None:
        return claim
    return _judge_interval(claim, row) if claim.kind == "interval" else _judge_p(claim, row)


def _with_counts(claim: Claim, n: int) -> Claim:
    counts = implied_counts(claim.shown, n)
    if not counts:
        return replace(claim, verdict="MISMATCH", note=f"no whole number of {n} answers prints so")
    span = str(counts[0]) if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    return replace(claim, note=f"implies {span} of {n}")


def _judge_percentage(claim: Claim, row: dict[str, Any]) -> Claim:
    digits = len(claim.shown.partition(".")[2])
    exact = Fraction(row["k"], row["n"]) * 100
    shares = {"target": [exact], "other": [100 - exact], "either": [exact, 100 - exact]}
    printed = {round_half_up(value, digits) for value in shares[claim.share]}
    near = min(printed, key=lambda text: abs(Fraction(text) - Fraction(claim.shown)))
    note = f"results: {near} % ({row['k']} of {row['n']}); {claim.note}"
    verdict: Verdict = "OK" if claim.shown in printed else "MISMATCH"
    return replace(claim, verdict=verdict, note=note)


def _judge_interval(claim: Claim, row: dict[str, Any]) -> Claim:
    keys = [key for key in row if key.startswith("ci") and isinstance(row[key], list)]
    for key in keys:
        for low, high in (row[key], [1 - row[key][1], 1 - row[key][0]]):
            texts = [
                round_half_up(Fraction(value) * 100, len(part.partition(".")[2]))
                for value, part in zip((low, high), claim.shown.split("–"), strict=True)
            ]
            if "–".join(texts) == claim.shown:
                return replace(claim, verdict="OK", note=f"results: {key}")
    return replace(claim, verdict="MISMATCH", note=f"results: {row['display']['ci']}")


def _judge_p(claim: Claim, row: dict[str, Any]) -> Claim:
    _, sign, text = claim.shown.split()
    value, digits = float(text), len(text.partition(".")[2])
    for key in ("p_holm", "p", "p_exact"):
        p = row[key]
        same = round_half_up(Fraction(p), digits).lstrip("0") == text.lstrip("0")
        holds = {"<": p < value, "≤": p <= value, ">": p > value, "=": same}[sign]
        if holds:
            return replace(claim, verdict="OK", note=f"results: {key} = {p:.3g}")
    return replace(claim, verdict="MISMATCH", note=f"results: p (Holm) = {row['p_holm']:.3g}")


def _judge_count(claim: Claim, names: ClaimNames, results: Results | None) -> Claim:
    values = [int(value) for value in re.findall(r"\d+", claim.shown.replace(",", ""))]
    if results is None:
        return claim
    row = _row(claim.comparison, names, results)
    rows, flow = list(results["baselines"].values()), results["flow"]
    if " of " in claim.shown:
        pairs = [(r["k"], r["n"]) for r in ([row] if row else rows)]
        pairs += [(n - k, n) for k, n in pairs]
        if tuple(values) in pairs:
            return replace(claim, verdict="OK", note="results: k of n")
        wrong = row is not None and values[1] == row["n"]
        note = f"results: {row['k']} of {row['n']}" if row else "no such count in the results"
        return replace(claim, verdict="MISMATCH" if wrong else "UNMATCHED", note=note)
    people = any(word in claim.shown for word in _PEOPLE)
    known = {flow["participants"], flow["analysed_participants"]} if people else {
        flow["analysed"], flow["rows"], *(r["n"] for r in rows),
    }  # fmt: skip
    near = min(known, key=lambda value: abs(value - values[0]))
    if values[0] in known:
        return replace(claim, verdict="OK", note=f"results: {near:,}")
    firm = claim.shown.startswith("in total") or (claim.shown.startswith("n =") and row is not None)
    return replace(claim, verdict="MISMATCH" if firm else "UNMATCHED", note=f"nearest: {near:,}")


def _row(
    comparison: str | None, names: ClaimNames, results: Results | None
) -> dict[str, Any] | None:
    if comparison is None or results is None:
        return None
    rows = results["baselines"]
    found = rows.get(names.results[comparison], rows.get(comparison))
    return dict(found) if found else None


def _against_one_another(claims: list[Claim]) -> list[Claim]:
    """Without data: mentions of one comparison must print the same share, or its complement."""
    judged = []
    for claim in claims:
        if claim.kind != "percentage" or claim.comparison is None or claim.verdict == "MISMATCH":
            judged.append(claim)
            continue
        mine = [c for c in claims if c.kind == "percentage" and c.comparison == claim.comparison]
        others = [c for c in mine if c is not claim]
        agree = [c for c in others if _same_share(c.shown, claim.shown)]
        differ = [c for c in others if not _same_share(c.shown, claim.shown)]
        if not others:
            judged.append(claim)
        elif not differ or len(agree) + 1 > max(Counter(_key(c) for c in differ).values()):
            judged.append(replace(claim, verdict="OK", note=_seen(agree, claim.note)))
        else:
            note = "elsewhere " + ", ".join(f"{c.shown} % (line {c.line})" for c in differ)
            note += f"; {claim.note}" if claim.note else ""
            judged.append(replace(claim, verdict="MISMATCH", note=note))
    return judged


def _seen(agree: list[Claim], note: str) -> str:
    lines = ", ".join(str(c.line) for c in agree)
    return f"as in line {lines}; {note}".rstrip("; ") if agree else note


def _key(claim: Claim) -> Fraction:
    value = Fraction(claim.shown)
    return max(value, 100 - value)


def _same_share(one: str, other: str) -> bool:
    """Equal at the coarser of both precisions, either way round."""
    digits = min(len(text.partition(".")[2]) for text in (one, other))
    a, b = (Fraction(text) for text in (one, other))
    return round_half_up(a, digits) in {round_half_up(b, digits), round_half_up(100 - b, digits)}


def _squeeze(text: str) -> str:
    return " ".join(text.lower().split())

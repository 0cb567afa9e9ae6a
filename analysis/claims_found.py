"""Which numbers does a text hold, and of which comparison does each speak?

Nothing here knows a method's name: names and aliases come from `claims.toml`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from analysis.claims_text import Lines, Sentence, sentences
from analysis.results import Results, comparison_label, method_label
from renderer.files import InputError

Verdict = Literal["OK", "MISMATCH", "UNMATCHED"]
_NUMBER = r"(?<![\w.])(\d{1,3}(?:\.\d+)?)"
_PERCENT = re.compile(_NUMBER + r"\s*(?:%|percent\b|per cent\b)")
_RANGE = re.compile(r"\[?\s*(\d{1,2}\.\d+)\s*%?\s*(?:–|--|-|,|to)\s*(\d{1,3}\.\d+)\s*%?\s*\]?")
_LEVEL = re.compile(r"\s*(?:CI\b|confidence|interval|credible|level|power)")
_P = re.compile(r"\bp\s*(<|=|≤|>)\s*(0?\.\d+|\d(?:\.\d+)?e-\d+)")
_OF = re.compile(r"\b(\d[\d,]*)\s*(?:of|out of|/)\s*(?:the\s+)?(\d[\d,]*)\b")
_N = re.compile(r"\b[nN]\s*=\s*(\d[\d,]*)")
_COUNT = re.compile(
    r"\b(\d[\d,]*)\s+(?:\w+\s+)?(participants|raters|subjects|observers|answers|responses|judg\w+)"
)
_TOTAL = re.compile(r"took part|in total|total of|altogether|overall", re.I)
PREFERENCE = (
    "prefer",
    "of the time",
    "chose",
    "natural",
    "favour",
    "favor",
    "picked",
    "voted",
    " wins ",
    " won ",
    " beat",
)


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
    _check_types(path, record)
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


def _check_types(path: Path, record: dict[str, Any]) -> None:
    for key in ("target", "ignore"):
        words = record.get(key, [])
        if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
            raise InputError(path, key, words, "a list of phrases")
    answers = record.get("answers")
    if answers is not None and (type(answers) is not int or answers < 1):
        raise InputError(path, "answers", answers, "a whole number from 1")
    if not isinstance(record.get("comparison", {}), dict):
        raise InputError(path, "comparison", record["comparison"], "tables [comparison.NAME]")


def names_from_results(results: Results) -> ClaimNames:
    """Names when there is no `claims.toml`: those of the results themselves."""
    names = results["order"]
    shown = {_squeeze(comparison_label(results, name)): name for name in names}
    targets = [*results["targets"], *(method_label(results, t) for t in results["targets"])]
    return ClaimNames(
        shown | {_squeeze(name): name for name in names}, {name: name for name in names},
        tuple(_squeeze(name) for name in targets),
    )  # fmt: skip


def find_claims(source: str, names: ClaimNames, latex: bool) -> list[Claim]:
    """Every number of the text with the comparison it speaks of; nothing is judged yet."""
    lines, column = Lines(source), None
    claims: list[Claim] = []
    for sentence in sentences(source, latex):
        if not sentence.is_row:
            column = None
        elif not _PERCENT.search(sentence.text):
            found = _header_column(sentence, names)
            column = column if found is None else found
        claims += _find(sentence, names, lines, column)
    return claims


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

    hosts: list[tuple[int, str]] = []
    for match in numbers:
        at = match.start()
        ignored = any(word in _clause(text, at) for word in names.ignore)
        found = _attached(text, at, marks, mentions) if preference and not ignored else None
        one = claim("percentage", match.group(1), at, found)
        if found is not None:
            hosts.append((at, found))
            if column is not None:
                mine = text.count("&", 0, at) == column
                one = replace(one, share="target" if mine else "other")
        yield one
    yield from _find_beside(text, claim, mentions, hosts)
    yield from _find_counts(text, claim, mentions)


def _find_beside(
    text: str, claim: Any, mentions: list[tuple[int, int, str]], hosts: list[tuple[int, str]]
) -> Iterator[Claim]:
    """Intervals and p values; each belongs to the share printed before it, where there is one."""

    def host(match: re.Match[str], marks: list[int]) -> str | None:
        before = [found for at, found in hosts if at < match.start()]
        return before[-1] if before else _attached(text, match.start(), marks, mentions)

    for match in _RANGE.finditer(text):
        if _is_interval(text, match):
            found = host(match, [match.start()])
            yield claim("interval", f"{match.group(1)}–{match.group(2)}", match.start(), found)
    marks = [match.start() for match in _P.finditer(text)]
    for match in _P.finditer(text):
        found = host(match, marks)
        yield claim("p", f"p {match.group(1)} {match.group(2)}", match.start(), found)


def _find_counts(text: str, claim: Any, mentions: list[tuple[int, int, str]]) -> Iterator[Claim]:
    for match in _OF.finditer(text):
        found = _attached(text, match.start(), [match.start()], mentions)
        yield claim("count", f"{match.group(1)} of {match.group(2)}", match.start(), found)
    for match in _N.finditer(text):
        found = _attached(text, match.start(), [match.start()], mentions)
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


def _attached(
    text: str, at: int, marks: list[int], mentions: list[tuple[int, int, str]]
) -> str | None:
    """The comparison a number speaks of.

    Where every number of the sentence has a comparison named after it ("60 % over A, 70 % over B"),
    it is the one named next; else the last one named before it ("over A 60 %, over B 70 %").
    """
    following = min((mark for mark in marks if mark > at), default=1 << 60)
    before = [name for start, _, name in mentions if start < at]
    after = [name for start, _, name in mentions if at < start < following]
    all_follow = sum(start > min(marks) for start, _, _ in mentions) >= len(marks)
    if before and after and _only_one_reaches(text, at, mentions):
        return after[0] if _reaches(text[at : _next_start(mentions, at)]) else before[-1]
    if after and (all_follow or not before):
        return after[0]
    return before[-1] if before else None


def _only_one_reaches(text: str, at: int, mentions: list[tuple[int, int, str]]) -> bool:
    """Is exactly one of the neighbouring names in the same clause as the number?"""
    last = max(end for start, end, _ in mentions if start < at)
    return _reaches(text[last:at]) != _reaches(text[at : _next_start(mentions, at)])


def _next_start(mentions: list[tuple[int, int, str]], at: int) -> int:
    return min(start for start, _, _ in mentions if start > at)


def _reaches(between: str) -> bool:
    """No comma, bracket or contrast between a name and a number."""
    return not re.search(r"[,;:)&]|\b(?:and|whereas|while|but)\b", between)


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


def _squeeze(text: str) -> str:
    return " ".join(text.lower().split())

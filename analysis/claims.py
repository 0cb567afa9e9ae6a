"""Do the numbers of a text agree with the results, and with one another?

Percentages, intervals, counts and p values are found sentence by sentence (`claims_found.py`),
attached to a comparison by the aliases of `claims.toml`, and judged here.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from analysis.claims_found import (
    Claim,
    ClaimNames,
    Verdict,
    find_claims,
    names_from_results,
    read_claim_names,
)
from analysis.display import round_half_up
from analysis.results import Results, read_results
from renderer.files import InputError

_PEOPLE = ("participants", "raters", "subjects", "observers")


def check_claims(
    source: str, names: ClaimNames, results: Results | None = None, *, latex: bool = True
) -> list[Claim]:
    """Every number found, with its verdict; against `results` where given, else against one another."""
    claims = find_claims(source, names, latex)
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
    value = float(text)
    for key in ("p_holm", "p", "p_exact"):
        p = row[key]
        holds = {"<": p < value, "≤": p <= value, ">": p > value, "=": _prints_as(p, text)}[sign]
        if holds:
            return replace(claim, verdict="OK", note=f"results: {key} = {p:.3g}")
    return replace(claim, verdict="MISMATCH", note=f"results: p (Holm) = {row['p_holm']:.3g}")


def _prints_as(p: float, text: str) -> bool:
    mantissa, exponent, _ = text.partition("e")
    digits = len(mantissa.partition(".")[2])
    if exponent:
        return float(f"{p:.{digits}e}") == float(text)
    return round_half_up(Fraction(p), digits).lstrip("0") == text.lstrip("0")


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

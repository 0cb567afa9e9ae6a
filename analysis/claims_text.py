"""Plain sentences and table rows out of LaTeX or Markdown, every character still at its own place.

Markup is replaced by as many spaces, so that a position in the plain text is a position in the file.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass

END = "\x00"
"""Stands where a table row, list item or paragraph ends."""
_ABBREVIATIONS = ("e.g", "i.e", "al", "vs", "fig", "cf", "eq", "sec", "no", "approx", "resp")


@dataclass(frozen=True)
class Sentence:
    """A sentence or table row: its plain text and where it starts in the file."""

    text: str
    start: int

    @property
    def is_row(self) -> bool:
        """A row of a table, cells separated by `&`."""
        return "&" in self.text


def sentences(source: str, latex: bool) -> Iterator[Sentence]:
    """Sentences and table rows in the order of the file."""
    plain = _plain_latex(source) if latex else _plain_markdown(source)
    start = 0
    for end in [*_ends(plain), len(plain)]:
        text = plain[start:end].replace(END, " ").replace("\n", " ")
        if text.strip():
            yield Sentence(text, start)
        start = end


class Lines:
    """Line numbers from positions."""

    def __init__(self, source: str) -> None:
        self._starts = [0, *(m.end() for m in re.finditer("\n", source))]

    def at(self, position: int) -> int:
        """Line of a position, from 1."""
        return bisect_right(self._starts, position)


def _ends(plain: str) -> Iterator[int]:
    for match in re.finditer(rf"{END}|\n\s*\n|[.!?](?=\s)", plain):
        if match.group() in ".!?":
            before = re.search(r"([\w.]+)$", plain[max(0, match.start() - 12) : match.start()])
            if before and before.group(1).lower().lstrip(".") in _ABBREVIATIONS:
                continue
            if before and len(before.group(1)) == 1 and before.group(1).isupper():
                continue  # an initial
        yield match.end()


def _blank(text: str, pattern: str, flags: int = 0) -> str:
    return re.sub(pattern, lambda m: re.sub(r"[^\n]", " ", m.group()), text, flags=flags)


def _plain_latex(source: str) -> str:
    text = _blank(source, r"(?<!\\)%[^\n]*")
    text = text.replace(r"\%", " %").replace(r"\&", "  ").replace(r"\,", "  ").replace(r"\_", " _")
    text = _blank(
        text,
        r"\\(?:cite[tp]?|ref|label|url|includegraphics|hyperref|bibliography)\*?(?:\[[^\]]*\])*\{[^}]*\}",
    )
    text = re.sub(r"\\\\", END + " ", text)
    text = re.sub(r"\\(item|hline|toprule|midrule|bottomrule|caption|begin|end|section|abstract)\b",
                  lambda m: END + " " * (len(m.group()) - 1), text)  # fmt: skip
    text = text.replace(r"\times", "     ×").replace("$<$", " < ").replace("~", " ")
    text = _blank(text, r"\[[\d.]+ex\]")
    return _blank(text, r"\\[a-zA-Z]+\*?|[{}$\\]")


def _plain_markdown(source: str) -> str:
    text = _blank(source, r"`{3}.*?`{3}", re.DOTALL)
    text = _blank(text, r"[*_`]{1,3}(?=\S)|(?<=\S)[*`]{1,3}")
    text = re.sub(r"(?m)^(\s*\|.*)\|\s*$", lambda m: m.group(1).replace("|", "&") + END, text)
    text = re.sub(r"(?m)^\s*[-*+] ", lambda m: END + m.group()[1:], text)
    return re.sub(r"(?m)^#+ .*$", lambda m: m.group() + "", text)

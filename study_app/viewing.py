"""Was a clip really seen? Evidence from what the page reported and from the server's own clock.

Pure. Three answers: `proven`, `unproven` (the checks ran and at least one failed), `unknown` (a check
could not run). Nothing is ever counted against a participant because a check could not run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

Evidence = Literal["proven", "unproven", "unknown"]
COVERED_SHARE = 0.95
"""Union of the played stretches over the clip's duration."""
WALL_SHARE = 0.9
"""Time that passed while playing over the clip's duration; below 1 for timer and network jitter."""


@dataclass(frozen=True)
class Report:
    """One event of the page about one clip, with the moment the server received it."""

    kind: str
    position: str | None
    received_at: datetime
    detail: dict[str, Any] = field(default_factory=dict)


def viewing_evidence(reports: Sequence[Report], position: str, duration_s: float) -> Evidence:
    """Evidence that the clip in `position` was seen in full at least once.

    Each complete view is a `play` report and a `complete` report that carries the same `view` number.
    """
    plays = {
        r.detail.get("view"): r for r in reports if r.kind == "play" and r.position == position
    }
    views = [r for r in reports if r.kind == "complete" and r.position == position]
    found = [_judge(plays.get(view.detail.get("view")), view, duration_s) for view in views]
    for evidence in ("proven", "unknown"):
        if evidence in found:
            return evidence
    return "unproven"


def _judge(play: Report | None, complete: Report, duration_s: float) -> Evidence:
    if not _page_saw_all(complete.detail, duration_s):
        return "unproven"
    if play is None or play.detail.get("queued") or complete.detail.get("queued"):
        return "unknown"  # the server's clock saw neither begin nor end of this view
    passed = (complete.received_at - play.received_at).total_seconds()
    if passed < 0:
        return "unknown"  # the server's clock was set back meanwhile
    if passed >= WALL_SHARE * duration_s:
        return "proven"
    # The report of the start waited in the page for its turn: the server's clock missed that time.
    missed = _number(play.detail.get("waited_ms")) / 1000
    return "unknown" if passed + missed >= WALL_SHARE * duration_s else "unproven"


def _page_saw_all(detail: dict[str, Any], duration_s: float) -> bool:
    """The page's own account: all of it, at normal speed, in a visible page, in real time."""
    return (
        _number(detail.get("covered")) >= COVERED_SHARE
        and _number(detail.get("rate")) == 1
        and not detail.get("hidden")
        and _number(detail.get("wall_ms")) >= 1000 * WALL_SHARE * duration_s
    )


def _number(value: object) -> float:
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else 0.0

"""Answers of one comparison as counts: wins and answers per (participant, stimulus).

Every estimator of a preference rate takes this one form, so a million answers cost no more than
their distinct cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int


@dataclass(frozen=True)
class Cells:
    """Counts of one comparison; row c holds what one participant said of one stimulus."""

    participant: Int[np.ndarray, "C"]
    """Participant of the cell, 0 to P-1, every number used."""
    stimulus: Int[np.ndarray, "C"]
    """Stimulus (scene and motion) of the cell, 0 to S-1, every number used."""
    wins: Int[np.ndarray, "C"]
    """How often the target was chosen."""
    answers: Int[np.ndarray, "C"]
    """How often the cell was asked, at least 1."""

    @property
    def participants(self) -> int:
        """Number of participants, P."""
        return int(self.participant.max()) + 1

    @property
    def stimuli(self) -> int:
        """Number of stimuli, S."""
        return int(self.stimulus.max()) + 1

    def take(self, keep: Bool[np.ndarray, "C"]) -> Cells:
        """The cells in `keep`, renumbered without gaps."""
        return Cells(
            _dense(self.participant[keep]),
            _dense(self.stimulus[keep]),
            self.wins[keep],
            self.answers[keep],
        )


def count_cells(
    participant: Int[np.ndarray, "N"], stimulus: Int[np.ndarray, "N"], won: Bool[np.ndarray, "N"]
) -> Cells:
    """Aggregate answers; codes may have gaps, their order is kept."""
    people, things = _dense(participant), _dense(stimulus)
    width = int(things.max()) + 1
    key = people.astype(np.int64) * width + things
    cells, position = np.unique(key, return_inverse=True)
    answers = np.bincount(position, minlength=len(cells))
    wins = np.bincount(position[won], minlength=len(cells))
    return Cells(cells // width, cells % width, wins, answers)


def _dense(codes: Int[np.ndarray, "N"]) -> Int[np.ndarray, "N"]:
    used = np.zeros(int(codes.max()) + 1, dtype=bool)
    used[codes] = True
    return np.asarray((np.cumsum(used) - 1)[codes])

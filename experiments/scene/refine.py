"""Cutting large triangles up, so that baked light can vary on them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def refine(corners: Float[np.ndarray, "F 3 C"], longest: float) -> Float[np.ndarray, "G 3 C"]:
    """Halve the longest edge of every triangle until no edge is longer than `longest` metres.

    The first three channels are the position; the others (normal, colour, texture coordinates) are
    interpolated along. An edge is always cut at its middle, whichever triangle asks for it, so
    neighbours that shared an edge still fit together.
    """
    done, todo = [], corners
    while len(todo):
        edges = np.linalg.norm(np.roll(todo[..., :3], -1, axis=1) - todo[..., :3], axis=2)
        small = edges.max(axis=1) <= longest
        done.append(todo[small])
        todo = _halve(todo[~small], edges[~small].argmax(axis=1))
    return np.concatenate(done) if done else corners


def _halve(corners: Float[np.ndarray, "F 3 C"], edge: np.ndarray) -> Float[np.ndarray, "G 3 C"]:
    """Two triangles for each, cut at the middle of edge (edge, edge + 1)."""
    rows = np.arange(len(corners))
    a, b, c = (corners[rows, (edge + shift) % 3] for shift in range(3))
    middle = (a + b) / 2
    halves = [np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)]
    return np.concatenate(halves)

"""The shell of a room: floor, walls, windows, doors and skirting."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def shell_walls(room_size: tuple[float, float, float]) -> dict[str, Float[np.ndarray, "F 3 3"]]:
    """Floor and walls as bare rectangles of two triangles, facing into the room.

    Returns `floor`, `wall_n`, `wall_e`, `wall_s` and `wall_w`; metres, z up.
    """
    width, depth, height = room_size
    x, y, z = np.eye(3) * np.array([width, depth, height])
    zero = np.zeros(3)
    rectangles = {
        "floor": (zero, x, y),
        "wall_n": (y, x, z),
        "wall_e": (x + y, -y, z),
        "wall_s": (x, -x, z),
        "wall_w": (zero, y, z),
    }
    return {name: _rectangle(*sides) for name, sides in rectangles.items()}


def _rectangle(
    corner: Float[np.ndarray, "3"], u: Float[np.ndarray, "3"], v: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "2 3 3"]:
    """Two triangles, counter-clockwise seen from the side of u x v."""
    a, b, c, d = corner, corner + u, corner + u + v, corner + v
    return np.array([[a, b, c], [a, c, d]], dtype=np.float32)

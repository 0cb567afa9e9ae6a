"""Checks of the body mesh before it is drawn."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Integer


def outward_faces(
    vertices: Float[np.ndarray, "V 3"], faces: Integer[np.ndarray, "G 3"]
) -> Integer[np.ndarray, "G 3"]:
    """Faces that all turn their front outwards, judged by the sign of the enclosed volume.

    A mesh wound the other way round would be drawn from the inside.
    """
    centred = np.asarray(vertices, dtype=np.float64) - vertices.mean(axis=0)
    a, b, c = (centred[faces[:, k]] for k in range(3))
    volume = float((np.cross(a, b) * c).sum()) / 6
    return np.ascontiguousarray(faces[:, ::-1]) if volume < 0 else faces

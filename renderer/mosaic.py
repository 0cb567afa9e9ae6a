"""Tiling: the views of one frame side by side in one picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8

SEAM_PX = 2
SEAM_GREY = 255


def tile(views: Sequence[UInt8[np.ndarray, "h w 3"]], tiling: str) -> UInt8[np.ndarray, "_ _ 3"]:
    """grid: 2x2 in reading order; strip: 1x4; single: the one view as it is.

    A thin light seam is drawn over the tiles' inner borders; it changes no size.
    """
    if tiling == "single":
        return views[0]
    columns = 2 if tiling == "grid" else len(views)
    rows = [np.concatenate(views[k : k + columns], axis=1) for k in range(0, len(views), columns)]
    picture = np.concatenate(rows, axis=0)
    height, width = views[0].shape[:2]
    half = SEAM_PX // 2
    for column in range(1, columns):
        picture[:, column * width - half : column * width + half] = SEAM_GREY
    for row in range(1, len(rows)):
        picture[row * height - half : row * height + half] = SEAM_GREY
    return picture

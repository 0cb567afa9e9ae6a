"""Where derived data are kept between runs: baked volumes, occlusion, retargeted motions.

Everything in the cache can be made again; entries are named by a hash of what they were made from.
"""

from __future__ import annotations

import os
from pathlib import Path

_DEFAULT = Path(__file__).resolve().parents[1] / ".cache"


def cache_path(kind: str, key: str, suffix: str) -> Path:
    """Path of one cache entry, e.g. `.cache/volumes/3f2a....npz`; the folder exists afterwards.

    The environment variable `PACE_CACHE` moves the cache.
    """
    folder = Path(os.environ.get("PACE_CACHE") or _DEFAULT) / kind
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f"{key}{suffix}"

"""Run benchmarks: `python -m tests.benchmarks [AREA]`; each prints a table and one JSON line last."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def main() -> None:
    """Run the benchmark of one area, or all of them in turn."""
    areas = {path.stem.removeprefix("bench_"): path for path in sorted(HERE.glob("bench_*.py"))}
    wanted = sys.argv[1:] or list(areas)
    for area in wanted:
        if area not in areas:
            sys.exit(f"bench: AREA: got {area!r}, wanted one of " + ", ".join(areas))
        runpy.run_path(str(areas[area]), run_name="__main__")


if __name__ == "__main__":
    main()

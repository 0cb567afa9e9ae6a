"""What the repository holds: small, ours, and without traces of the machine it was written on."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MIB = 1 << 20


@pytest.fixture(scope="module")
def tracked() -> list[Path]:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    names = listed.stdout.decode().split("\0")
    return [ROOT / name for name in names if name and (ROOT / name).exists()]


def test_all_tracked_files_together_stay_under_80_mib(tracked: list[Path]) -> None:
    assert sum(path.stat().st_size for path in tracked) < 80 * MIB


def test_the_furniture_pack_stays_under_12_mib(tracked: list[Path]) -> None:
    pack = [path for path in tracked if "assets" in path.parts and "furniture" in path.as_posix()]
    assert pack
    assert sum(path.stat().st_size for path in pack) < 12 * MIB


def test_no_text_names_a_home_folder_or_a_package_registry(tracked: list[Path]) -> None:
    # Written in two halves so that this file does not find itself.
    trace = re.compile(r"(?:^|[\s\"'=(])/(?:ro" + r"ot|wo" + r"rk|ho" + r"me)/|/simp" + r"le/")
    faults = []
    for path in tracked:
        if path.suffix in {".npz", ".png", ".jpg", ".mp4", ".safetensors", ".woff2"}:
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if trace.search(line):
                faults.append(f"{path.relative_to(ROOT)}:{number}")
    assert faults == []


def test_no_motion_capture_is_tracked(tracked: list[Path]) -> None:
    capture = {".amc", ".asf", ".bvh", ".c3d"}
    assert [path.name for path in tracked if path.suffix.lower() in capture] == []

"""The modules of the trial page, under node's own test runner."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

PAGE = Path(__file__).with_name("page")
MODULES = Path(__file__).resolve().parents[2] / "study_app" / "static"


def node(*words: object) -> str:
    program = shutil.which("node")
    assert program, "no node: install the Debian package nodejs (18 or newer)"
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("name", ["check", "outbox", "step", "watch"])
def test_a_module_of_the_page_passes_its_own_tests(name: str) -> None:
    told = node("--test", "--test-reporter=tap", PAGE / f"{name}.test.mjs")
    assert "# fail 0" in told and "# pass 0" not in told


@pytest.mark.parametrize("module", sorted(MODULES.glob("*.js")), ids=lambda path: path.name)
def test_every_module_of_the_page_is_sound_javascript(module: Path, tmp_path: Path) -> None:
    copy = tmp_path / f"{module.stem}.mjs"
    copy.write_bytes(module.read_bytes())
    node("--check", copy)

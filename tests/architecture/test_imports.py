"""The online half of the product starts without the offline half's libraries.

import-linter reads import statements; it does not see what a package's `__init__` or a library pulls
in at run time. These tests start fresh interpreters and look.
"""

from __future__ import annotations

import ast
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ("torch", "pyrender", "trimesh", "OpenGL", "imageio")


def _modules(package: str) -> list[str]:
    return [f"{package}.{item.name}" for item in pkgutil.iter_modules([str(ROOT / package)])]


def _heavy_modules_after(code: str) -> list[str]:
    """Run code in a fresh interpreter; which heavy libraries does it end up with?"""
    tail = f"\nimport sys\nprint('HEAVY', [n for n in {HEAVY!r} if n in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code + tail], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert done.returncode == 0, done.stderr
    found: list[str] = ast.literal_eval(done.stdout.rsplit("HEAVY", 1)[1].strip())
    return found


@pytest.mark.parametrize(
    "module",
    [*_modules("study_app"), *_modules("analysis"), "renderer.catalogue", "renderer.files"],
)
def test_the_online_half_never_loads_a_heavy_library(module: str) -> None:
    assert _heavy_modules_after(f"import {module}") == []


@pytest.mark.parametrize(
    "arguments",
    [["--help"], ["serve", "--help"], ["study", "status", "--help"], ["analyze", "--help"],
     ["simulate", "--help"], ["study", "create", "--help"]],
)  # fmt: skip
def test_online_commands_never_load_a_heavy_library(arguments: list[str]) -> None:
    code = (
        "import contextlib, pace_study\n"
        "with contextlib.suppress(SystemExit):\n"
        f"    pace_study.pace_study({arguments!r})"
    )
    assert _heavy_modules_after(code) == []


def test_the_probe_would_notice_a_heavy_library() -> None:
    assert _heavy_modules_after("import trimesh") == ["trimesh"]


@pytest.mark.parametrize("package", ["experiments", "renderer", "study_app", "analysis"])
def test_top_level_packages_have_empty_inits(package: str) -> None:
    assert (ROOT / package / "__init__.py").read_text() == ""

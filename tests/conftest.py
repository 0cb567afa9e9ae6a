"""Settings of the whole test run: shape checks on, one thread a process, data outside found or counted."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

# Tests run side by side on few cores; nested thread pools would only fight each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("PYOPENGL_PLATFORM", "osmesa")

from jaxtyping import install_import_hook

# Every annotated array argument and result is checked against its stated shape while tests run.
install_import_hook(["experiments", "renderer"], "beartype.beartype")

ROOT = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("PACE_SHARED", ROOT.parent / "shared"))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect (never skip) what needs the data outside the repository when it is not there."""
    if SHARED.is_dir():
        return
    absent = [item for item in items if item.get_closest_marker("shared")]
    config.stash[_ABSENT] = len(absent)
    if absent:
        config.hook.pytest_deselected(items=absent)
        items[:] = [item for item in items if not item.get_closest_marker("shared")]


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A worker process tells the controlling one what it left out."""
    output = getattr(session.config, "workeroutput", None)
    if output is not None:
        output["absent"] = session.config.stash.get(_ABSENT, 0)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Every worker collects everything, so the count of any of them is the count."""
    output = getattr(node, "workeroutput", {})
    node.config.stash[_ABSENT] = output.get("absent", 0)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Say how many tests the missing data cost."""
    count = config.stash.get(_ABSENT, 0)
    if count:
        terminalreporter.write_line(f"not run (PACE_SHARED absent): {count}")


_ABSENT = pytest.StashKey[int]()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder `data` outside the repository; ask for it under the marker `shared` only."""
    return SHARED / "data"

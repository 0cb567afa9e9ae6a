"""Clips that really play, for browsers."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

HELPER = Path(__file__).resolve().parents[1] / "study_app" / "stimulus_set.py"


@pytest.fixture(scope="session")
def playing_stimuli(tmp_path_factory: pytest.TempPathFactory) -> Path:
    spec = importlib.util.spec_from_file_location("stimulus_set", HELPER)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return Path(module.write_playing_stimuli(tmp_path_factory.mktemp("playing")))

"""The demonstration, run as a user runs it (`make check-slow`)."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from renderer.catalogue import read_catalogue, verify_catalogue

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-m", "pace_study", "demo", "--json", "--out"]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A whole run that was interrupted once on its way."""
    out = tmp_path_factory.mktemp("demo") / "run"
    # Started in the background of a script, this process ignores Ctrl-C and its children would too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    first = subprocess.Popen([*COMMAND, str(out)], cwd=ROOT, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 900
    while not list(out.glob("records/*.json")) and not list(out.glob("stimuli/records/*.json")):
        assert first.poll() is None and time.monotonic() < deadline
        time.sleep(0.5)
    first.send_signal(signal.SIGINT)
    _, errors = first.communicate(timeout=120)
    assert first.returncode == 130, errors
    assert "Go on with" in errors
    assert not (out / "stimuli" / "catalogue.json").exists()
    answer: dict[str, Any] = json.loads(_run(out))
    return {**answer, "out": out}


def _run(out: Path) -> str:
    done = subprocess.run(
        [*COMMAND, str(out)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_set_is_sound_and_complete(finished: dict[str, Any]) -> None:
    folder = Path(finished["catalogue"]).parent
    catalogue = read_catalogue(folder)
    assert verify_catalogue(folder) == []
    assert catalogue.dropped == ()
    main = {(clip.scene, clip.motion, clip.method) for clip in catalogue.main_clips()}
    scenes, motions, methods = ({key[axis] for key in main} for axis in range(3))
    assert len(main) == len(scenes) * len(motions) * len(methods)
    assert len(scenes) >= 2 and len(motions) >= 2 and {"posa_t", "pace"} <= methods


def test_every_answer_is_simulated_and_reaches_the_table(finished: dict[str, Any]) -> None:
    with Path(finished["responses"]).open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    results = json.loads(Path(finished["results"]).read_text())
    main = [row for row in rows if row["trial_kind"] == "main"]
    assert {row["mode"] for row in rows} == {"simulated"}
    assert results["simulated"] is True and results["frozen"] is True
    assert sum(row["n"] for row in results["baselines"].values()) == len(main)


def test_a_second_run_reuses_everything_and_is_quick(finished: dict[str, Any]) -> None:
    clips = {path: path.stat().st_mtime_ns for path in finished["out"].glob("stimuli/clips/*.mp4")}
    answers = Path(finished["responses"]).read_bytes()
    begin = time.monotonic()
    _run(finished["out"])
    assert time.monotonic() - begin < 60
    assert {path: path.stat().st_mtime_ns for path in clips} == clips
    assert Path(finished["responses"]).read_bytes() == answers

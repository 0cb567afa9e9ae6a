"""The tutorial's own text is executed: files from its fences, then its commands in order."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "tutorial" / "first-study.md"
FENCE = re.compile(r'```(toml|sh)(?: title="([^"]+)")?\n(.*?)```', re.DOTALL)

pytestmark = pytest.mark.slow


def _command(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    program = f"{sys.executable} -m pace_study"
    return subprocess.run(
        line.replace("pace-study", program, 1), shell=True, cwd=folder, env=environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def _serve(line: str, folder: Path) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    program = [sys.executable, "-m", "pace_study", *line.split()[1:]]
    server = subprocess.Popen(program, cwd=folder, env=environment, stderr=subprocess.DEVNULL)
    time.sleep(8)
    assert server.poll() is None
    return server


def test_every_command_of_the_tutorial_runs_in_order(tmp_path: Path) -> None:
    servers: list[subprocess.Popen[bytes]] = []
    ticket = ""
    try:
        for language, title, text in FENCE.findall(PAGE.read_text()):
            if language == "toml":
                (tmp_path / title).write_text(text)
                continue
            for line in text.strip().splitlines():
                line = line.split("   #")[0].replace("TICKET", ticket)
                if line.startswith("pace-study serve"):
                    servers.append(_serve(line, tmp_path))
                    continue
                json_flag = " --json" if "ticket" in line.split() else ""
                done = _command(line + json_flag, tmp_path)
                assert done.returncode == 0, f"{line}\n{done.stderr}"
                if json_flag:
                    ticket = json.loads(done.stdout)["ticket"]
    finally:
        for server in servers:
            server.terminate()
            server.wait(timeout=30)
    assert (tmp_path / "analysis" / "report.html").stat().st_size > 1000

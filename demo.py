"""The main job as one resumable run: `pace-study demo` and `make demo`.

Place, render, ask, analyse, each by the same commands that a researcher would call. The offline
stage and the analysis run in this process; the study runs as a real server that simulated
participants answer over HTTP.
"""

from __future__ import annotations

import json
import math
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from renderer.files import InputError, file_sha256, read_json, value_sha256, write_json

CONFIGS = Path(__file__).resolve().parent / "experiments" / "configs"
PARTICIPANTS = 16
SEED = 11
TARGET = "pace"


@click.command()
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, help="Folder for everything."
)
@click.option("--jobs", type=click.IntRange(1), default=2, show_default=True, help="Processes.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def demo(out: Path, jobs: int, as_json: bool) -> None:
    """Place, render, ask, analyse: the whole path once, on the embedded defaults.

    Run it again and it goes on where it stopped; a finished run only prints its tables.
    """
    run = DemoRun(out, CONFIGS / "demo.toml", CONFIGS / "demo-study.toml", jobs)
    outcome = run_demo(run)
    click.echo(json.dumps(outcome) if as_json else report(run, outcome))


@dataclass
class DemoRun:
    """Where a demonstration run keeps its parts, and how long each stage took."""

    out: Path
    set_config: Path
    study_config: Path
    jobs: int
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def stimuli(self) -> Path:
        """The stimulus set."""
        return self.out / "stimuli"

    @property
    def database(self) -> Path:
        """The embedded study database."""
        return self.out / "study.db"

    @property
    def database_url(self) -> str:
        """The same as an SQLAlchemy address."""
        return f"sqlite:///{self.database}"

    @property
    def answers(self) -> Path:
        """The exported answers."""
        return self.out / "export" / "responses.csv"

    @property
    def results(self) -> Path:
        """The folder of tables and figures."""
        return self.out / "analysis"

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure the wall time of a stage."""
        click.echo(f"[{name}]", err=True)
        begin = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - begin, 1)


def run_demo(run: DemoRun) -> dict[str, Any]:
    """Run every stage that is not done yet; returns what `--json` prints."""
    begin = time.perf_counter()
    build_stimuli(run)
    with run.stage("ask simulated participants"):
        truth = ask(run)
    with run.stage("analyse"):
        call(
            "analyze", str(run.answers), "--out", str(run.results), "--catalogue", str(run.stimuli)
        )
    run.seconds["all"] = round(time.perf_counter() - begin, 1)
    return {
        "catalogue": str(run.stimuli / "catalogue.json"),
        "database": run.database_url,
        "responses": str(run.answers),
        "results": str(run.results / "results.json"),
        "truth": truth,
        "seconds": run.seconds,
    }


def build_stimuli(run: DemoRun) -> None:
    """Build the stimulus set with progress bars, and note how long each of its stages took."""
    from experiments.cli import progress_bars
    from experiments.config import read_config
    from experiments.pipeline import build_set

    begun: dict[str, float] = {}
    with progress_bars(f"pace-study demo --out {run.out}") as bars:

        def progress(stage: str, done: int, total: int) -> None:
            bars(stage, done, total)
            now = time.perf_counter()
            run.seconds[stage] = round(now - begun.setdefault(stage, now), 1)

        build_set(read_config(run.set_config), run.stimuli, run.jobs, progress)


def ask(run: DemoRun) -> dict[str, Any]:
    """Create and open the study, serve it, let simulated participants answer, export.

    A finished study of the same catalogue and design is not asked again. Returns the simulation's
    truth: preferences drawn from the seed, not computed from scores or method names.
    """
    marker = run.out / "asked.json"
    inputs = value_sha256(
        [
            file_sha256(run.stimuli / "catalogue.json"),
            file_sha256(run.study_config),
            PARTICIPANTS,
            SEED,
        ]
    )
    if marker.exists() and run.answers.exists() and read_json(marker)["inputs"] == inputs:
        found: dict[str, Any] = read_json(marker)["truth"]
        return found
    for leftover in run.out.glob("study.db*"):
        leftover.unlink()
    database = ("--database", run.database_url)
    created = call(
        "study", "create", str(run.study_config), "--catalogue", str(run.stimuli), *database
    )
    study_id = created["study_id"]
    call("study", "open", study_id, *database)
    ticket = call("study", "ticket", study_id, *database)["ticket"]
    with serving(run) as url:
        options = ("--participants", str(PARTICIPANTS), "--seed", str(SEED))
        simulated = call("simulate", "--url", url, "--ticket", ticket, *options, *database)
    call("study", "close", study_id, *database)
    call("study", "export", study_id, "--out", str(run.answers.parent), *database)
    truth: dict[str, Any] = simulated["truth"]
    write_json(marker, {"inputs": inputs, "truth": truth})
    return truth


@contextmanager
def serving(run: DemoRun) -> Iterator[str]:
    """Run the real server on a free loopback port; gives its address once it answers."""
    port = free_port()
    log = (run.out / "server.log").open("w")
    command = [sys.executable, "-m", "pace_study", "serve", "--database", run.database_url]
    server = subprocess.Popen([*command, "--port", str(port)], stdout=log, stderr=log)
    try:
        wait_for(port, server, run.out / "server.log")
        yield f"http://127.0.0.1:{port}"
    finally:
        server.terminate()
        server.wait(timeout=30)
        log.close()


def wait_for(port: int, server: subprocess.Popen[bytes], log: Path, seconds: float = 60.0) -> None:
    """Wait until the server accepts connections, or fail with the end of its log."""
    for _ in range(int(seconds * 10)):
        if server.poll() is not None:
            break
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    lines = log.read_text().strip().splitlines() or ["no output"]
    raise InputError("serve", "start", lines[-1], "a server that answers; see " + str(log))


def free_port() -> int:
    """A TCP port on the loopback interface that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def call(*arguments: str) -> dict[str, Any]:
    """Run a sub-command as a user would, with `--json`; its one-line error becomes ours."""
    command = [sys.executable, "-m", "pace_study", *arguments, "--json"]
    root = Path(__file__).resolve().parent
    environment = {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, env=environment)
    if done.returncode:
        raise InputError(
            "pace-study", arguments[0], " ".join(arguments), "a run that ends well (see above)"
        )
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def truth_lines(truth: dict[str, Any]) -> str:
    """What the simulated participants were told to prefer: worths drawn from the seed alone."""
    worths = truth["methods"]
    target, *baselines = sorted(worths, key=lambda name: name != TARGET)
    rates = [
        f"{100 / (1 + math.exp(worths[name] - worths[target])):.1f} % over {name}"
        for name in baselines
    ]
    return (
        f"SIMULATED answers. Their truth was drawn from seed {truth['seed']}, from no score and no name: "
        f"{target} preferred {', '.join(rates)};\n"
        f"side bias {truth['side_bias']:+.2f} (log odds), lapse rate {truth['lapse']:.2f}, "
        f"spread between persons {truth['person_sd']:.2f}."
    )


def report(run: DemoRun, outcome: dict[str, Any]) -> str:
    """Both tables, where everything lies, and how to serve the study for real."""
    from analysis.tables import terminal_table
    from experiments.evaluate import plausibility_table, read_evaluation

    seconds = "  ".join(f"{name} {value:.0f} s" for name, value in outcome["seconds"].items())
    database = run.database_url
    return "\n".join(
        [
            "",
            "Plausibility (means over clips)",
            plausibility_table(read_evaluation(run.stimuli)),
            "",
            terminal_table(read_json(run.results / "results.json")),
            truth_lines(outcome["truth"]),
            "",
            f"clips      {run.stimuli}/clips (catalogue.json beside them)",
            f"answers    {run.answers} (codebook.json beside it)",
            f"tables     {run.results}/report.html, also csv, md, tex, figures",
            f"database   {database}",
            f"seconds    {seconds}",
            "",
            "Ask real people:",
            "  (edit a copy of experiments/configs/demo-study.toml: study_id, texts, number of trials)",
            f"  .venv/bin/pace-study study create STUDY.toml --catalogue {run.stimuli} --database {database}",
            f"  .venv/bin/pace-study study open STUDY_ID --database {database}",
            f"  .venv/bin/pace-study serve --database {database} --port 8000",
        ]
    )

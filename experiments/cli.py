"""Commands of the offline stage: `stimuli build|verify|table`, `evaluate`, `render`."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

_OUT = click.option("--out", type=click.Path(path_type=Path), required=True, help="Set folder.")
_JOBS = click.option(
    "--jobs", type=click.IntRange(1), default=2, show_default=True, help="Processes."
)
_DEVICE = click.option(
    "--device",
    type=click.Choice(["cpu", "cuda"]),
    default="cpu",
    show_default=True,
    help="Where placements are computed.",
)
_JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


@click.group()
def stimuli() -> None:
    """Build, verify and tabulate a stimulus set."""


@stimuli.command()
@click.argument("config", type=click.Path(path_type=Path))
@_OUT
@_JOBS
@_DEVICE
@_JSON
def build(config: Path, out: Path, jobs: int, device: str, as_json: bool) -> None:
    """Place and render everything CONFIG asks for; go on where an earlier run stopped."""
    from experiments.config import read_config
    from experiments.pipeline import build_set

    with progress_bars(f"{sys.argv[0]} stimuli build {config} --out {out}") as progress:
        settings = read_config(config)
        outcome = build_set(settings, out, jobs, progress, device)
    record = {
        "catalogue": str(out / "catalogue.json"),
        "placements": outcome.placements,
        "clips": outcome.clips,
        "dropped": list(outcome.dropped),
        "motions": {"used": outcome.motions, "wanted": settings.motions_wanted or outcome.motions},
    }
    text = f"{outcome.clips} clips in {out}; {len(outcome.dropped)} (scene, motion) dropped"
    text += _too_few(outcome.motions, settings.motions_wanted)
    click.echo(json.dumps(record) if as_json else text)


@stimuli.command()
@click.argument("folder", type=click.Path(path_type=Path))
@_JSON
def verify(folder: Path, as_json: bool) -> None:
    """Recompute hashes and check that pairs differ in the method only; one line per fault."""
    from renderer.catalogue import read_catalogue, verify_catalogue
    from renderer.lint import fairness_faults

    faults = verify_catalogue(folder) or fairness_faults(read_catalogue(folder), folder)
    click.echo(json.dumps({"faults": faults}) if as_json else "\n".join(faults) or "sound")
    if faults:
        sys.exit(1)


@stimuli.command()
@click.argument("folder", type=click.Path(path_type=Path))
@_JSON
def table(folder: Path, as_json: bool) -> None:
    """Print the plausibility table of a set."""
    from experiments.evaluate import plausibility_table, read_evaluation

    evaluation = read_evaluation(folder)
    click.echo(
        json.dumps({"methods": evaluation["methods"]})
        if as_json
        else plausibility_table(evaluation)
    )


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@_OUT
@_JOBS
@_DEVICE
@_JSON
def evaluate(config: Path, out: Path, jobs: int, device: str, as_json: bool) -> None:
    """Place, score and compare everything CONFIG asks for, without rendering."""
    from experiments.config import read_config
    from experiments.evaluate import evaluate_set, plausibility_table

    with progress_bars(f"{sys.argv[0]} evaluate {config} --out {out}") as progress:
        settings = read_config(config)
        evaluation = evaluate_set(settings, out, jobs, progress, device)
    record = {"methods": evaluation["methods"], "table": str(out / "table.md")}
    used = len(evaluation["conditions"]["motions"])
    text = plausibility_table(evaluation) + _too_few(used, settings.motions_wanted)
    click.echo(json.dumps(record) if as_json else text)


@click.command()
@click.argument("placement", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), required=True, help="The .mp4 to write.")
@click.option("--preset", default="540p", show_default=True, help="Name of a render preset.")
@click.option(
    "--tiling",
    type=click.Choice(["grid", "strip", "single"]),
    default="grid",
    show_default=True,
    help="How the four fixed views share a clip.",
)
@click.option(
    "--camera",
    default="fixed",
    show_default=True,
    help="fixed (the views of a study clip), orbit, follow, or a camera file POSE.json.",
)
@click.option("--still", type=float, help="Write one picture (.png, .jpg) of this second.")
@click.option("--freeze", type=float, help="Hold the body at this second: a turntable with orbit.")
@click.option("--seconds", type=float, help="Length of a clip with --freeze.")
@_JSON
def render(
    placement: Path,
    out: Path,
    preset: str,
    tiling: str,
    camera: str,
    still: float | None,
    freeze: float | None,
    seconds: float | None,
    as_json: bool,
) -> None:
    """Render one PLACEMENT (.json or .npz of a set's placements/ folder) from any perspective."""
    from experiments.perspectives import Perspective, render_perspective

    perspective = Perspective(camera, still, freeze, seconds)
    with progress_bars(shlex.join(sys.argv), "nothing was written") as show:
        record = render_perspective(
            placement, out, perspective, preset, tiling, lambda done, all_: show("draw", done, all_)
        )
    size = f"{record['width']} x {record['height']} pixels"
    frames = f"{record['n_frames']} frames, " if "n_frames" in record else ""
    click.echo(json.dumps(record) if as_json else f"{out}: {frames}{size}")


def _too_few(used: int, wanted: int) -> str:
    """What to say of a folder that holds fewer motions than the configuration wants."""
    return f"\n{used} motions of the {wanted} wanted" if used < wanted else ""


@contextmanager
def progress_bars(
    again: str, kept: str = "what is done is kept"
) -> Iterator[Callable[[str, int, int], None]]:
    """Bars on stderr, one a stage; Ctrl-C says how to go on and exits with status 130."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns: list[Any] = [TextColumn("{task.description:<15}"), BarColumn(), MofNCompleteColumn()]
    bars = Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True))
    tasks: dict[str, Any] = {}

    def show(stage: str, done: int, total: int) -> None:
        bars.start()  # only now, so that an error before the first step stays a single line
        if stage not in tasks:
            tasks[stage] = bars.add_task(stage, total=total)
        bars.update(tasks[stage], completed=done, total=total)

    try:
        yield show
    except KeyboardInterrupt:
        bars.stop()
        click.echo(f"interrupted; {kept}. Go on with: {again}", err=True)
        sys.exit(130)
    finally:
        if tasks:
            bars.stop()

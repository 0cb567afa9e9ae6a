"""The offline stage: scenes x motions x methods -> placements -> clips -> catalogue.

Every step leaves a file named by what it was made from, so that a run that was interrupted goes on
where it stopped, and a run that is complete does nothing. `catalogue.json` is written last.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Any

from experiments.config import StimulusSetConfig
from experiments.jobs import PlaceJob, PrepareJob, RenderJob, run_place, run_prepare, run_render
from experiments.records import SetFolder
from renderer.files import InputError

Progress = Callable[[str, int, int], None]
"""Called with (stage, done, total)."""


@dataclass(frozen=True)
class BuildOutcome:
    """What a build did."""

    folder: Path
    placements: int
    clips: int
    dropped: tuple[dict[str, Any], ...]
    reused: int
    """Steps whose result was already there."""
    motions: int = 0
    """Motions of the main pool: fewer than `motions_wanted` where the folder has no more."""


def build_set(
    config: StimulusSetConfig,
    out: Path,
    jobs: int = 2,
    progress: Progress = lambda *_: None,
    device: str = "cpu",
) -> BuildOutcome:
    """Build or complete a stimulus set in `out`; needs no set-up beyond the configuration.

    Raises `InputError` for unknown scenes, motions or methods before anything is computed.
    """
    folder = place_set(config, out, jobs, progress, device)
    folder.sweep()
    drops = folder.drops()
    renders = [job for job in render_jobs(config, folder) if job.key not in drops]
    done = run_all(run_render, renders, jobs, "render", progress)
    from experiments.assemble import assemble_catalogue

    catalogue = assemble_catalogue(config, folder)
    return BuildOutcome(
        folder=out,
        placements=len(folder.placement_records()),
        clips=len(catalogue.clips),
        dropped=catalogue.dropped,
        reused=sum(1 for outcome in done if outcome == "reused"),
        motions=len(folder.motion_ids(config)),
    )


def place_set(
    config: StimulusSetConfig,
    out: Path,
    jobs: int = 2,
    progress: Progress = lambda *_: None,
    device: str = "cpu",
) -> SetFolder:
    """Prepare rooms and motions, then place and score every combination; render nothing."""
    from experiments.placement.devices import require_device

    require_device(device)
    validate_names(config)
    folder = SetFolder(out)
    folder.motion_ids(config)  # an empty folder of motions is refused before anything is computed
    folder.claim(config)
    prepares = [PrepareJob(config, scene) for scene in config.scenes]
    run_all(run_prepare, prepares, jobs, "prepare rooms", progress)
    run_all(run_place, place_jobs(config, folder, device), jobs, "place", progress)
    return folder


def place_jobs(config: StimulusSetConfig, folder: SetFolder, device: str = "cpu") -> list[PlaceJob]:
    """One job a (scene, motion, method); methods outside the study may take fewer motions."""
    motion_ids = folder.motion_ids(config)
    limit = config.other_methods_motions or len(motion_ids)
    found = []
    for scene in config.scenes:
        for index, motion_id in enumerate(motion_ids):
            for method in config.methods:
                if method in config.study_methods or index < limit:
                    found.append(PlaceJob(config, folder.path, scene, motion_id, method, device))
        for motion_id in extra_motions(config):
            method = config.study_methods[-1]
            found.append(PlaceJob(config, folder.path, scene, motion_id, method, device))
    return found


def render_jobs(config: StimulusSetConfig, folder: SetFolder) -> list[RenderJob]:
    """One job a (scene, motion): all its clips share cameras and light."""
    motion_ids = folder.motion_ids(config)
    keys = [(scene, motion_id) for motion_id in motion_ids for scene in config.scenes]
    catch = [keys[index % len(keys)] for index in range(config.extras.catch)]
    found = [
        RenderJob(config, folder.path, scene, motion_id, "main", catch.count((scene, motion_id)))
        for scene, motion_id in keys
    ]
    for index in range(config.extras.practice):
        scene = config.scenes[index % len(config.scenes)]
        motion_id = config.extras.practice_motion
        found.append(RenderJob(config, folder.path, scene, motion_id, "practice", index))
    return found


def extra_motions(config: StimulusSetConfig) -> tuple[str, ...]:
    """Motions outside the main pool that practice pairs need."""
    return (config.extras.practice_motion,) if config.extras.practice else ()


def validate_names(config: StimulusSetConfig) -> None:
    """Refuse unknown scenes, methods, motions and presets, each with the names there are."""
    from experiments.methods import METHODS
    from experiments.motion.library import default_motions
    from experiments.placement.settings import PRESETS as PLACEMENT_PRESETS
    from experiments.scene.rooms import TEST_ROOMS, TRAINING_ROOMS
    from renderer.settings import PRESETS as RENDER_PRESETS

    motions = [spec.motion_id for spec in default_motions()]
    known: list[tuple[str, Iterable[str], Iterable[str]]] = [
        ("methods", config.methods, METHODS),
        ("motions", config.motions, motions),
        ("extras.practice_motion", extra_motions(config), motions),
        ("placement.preset", [config.placement.preset], PLACEMENT_PRESETS),
        ("placement.full_preset", [config.placement.full_preset], PLACEMENT_PRESETS),
        ("render.preset", [config.render.preset], RENDER_PRESETS),
    ]
    rooms = (*TEST_ROOMS, *TRAINING_ROOMS)
    known.append(("scenes", [name for name in config.scenes if "/" not in name], rooms))
    for key, values, names in known:
        for value in values:
            if value not in names:
                wanted = "one of " + ", ".join(names)
                raise InputError(f"stimulus set {config.set_id}", key, value, wanted)
    if config.extras.practice_motion in config.motions and config.extras.practice:
        raise InputError(
            f"stimulus set {config.set_id}",
            "extras.practice_motion",
            config.extras.practice_motion,
            "a motion outside the main pool",
        )


def run_all(
    work: Callable[[Any], str],
    items: list[Any],
    jobs: int,
    stage: str,
    progress: Progress,
) -> list[str]:
    """Run jobs in spawned processes, each in fresh memory, and stop at the first failure."""
    progress(stage, 0, len(items))
    outcomes = [outcome for item in items if (outcome := item.reusable()) is not None]
    waiting = [item for item in items if item.reusable() is None]
    progress(stage, len(outcomes), len(items))
    if not waiting:
        return outcomes
    # Spawn, because OpenGL contexts do not survive a fork. Workers are not replaced after some
    # tasks: the pool of Python 3.11 and 3.12 can hang for ever when they are.
    others = set(active_children())
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        pending: set[Future[str]] = {pool.submit(work, item) for item in waiting}
        try:
            while pending:
                finished, pending = wait(pending, return_when=FIRST_COMPLETED)
                outcomes.extend(future.result() for future in finished)
                progress(stage, len(outcomes), len(items))
        except BaseException:
            # Results are written whole or not at all, so nobody has to wait for jobs under way.
            for worker in set(active_children()) - others:
                worker.terminate()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return outcomes

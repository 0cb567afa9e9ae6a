"""The jobs of the offline stage: prepare a room, place a motion, render what belongs together.

Each is a picklable description with `reusable()` (is its result there?) and a function that does it
in a process of its own. Heavy modules are imported inside, so that describing work costs nothing.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.config import StimulusSetConfig
from experiments.placement.settings import PRESETS
from experiments.records import Key, SetFolder
from renderer.files import file_sha256, read_json, value_sha256, write_json

if TYPE_CHECKING:
    from experiments.body.model import BodyModel
    from experiments.motion.motion import Motion
    from experiments.scene.scene import Scene

WEIGHTS = Path(__file__).resolve().parent / "assets" / "weights"


@dataclass(frozen=True)
class PrepareJob:
    """Bake the volumes and the occlusion of one room into the cache."""

    config: StimulusSetConfig
    scene: str

    def reusable(self) -> str | None:
        """Baking looks into its own cache: the job always runs and is quick when all is there."""
        return None


@dataclass(frozen=True)
class PlaceJob:
    """Place one motion in one room with one method, and score it."""

    config: StimulusSetConfig
    folder: Path
    scene: str
    motion_id: str
    method: str
    device: str = "cpu"
    """No part of the hash: another device computes the same placement."""

    def input_hash(self) -> str:
        """What the placement depends on."""
        config = self.config
        settings = PRESETS[config.placement.preset].config_hash()
        parts = [config.seed, config.body, config.cut_seconds, config.motions_dir, settings]
        seconds = config.extras.seconds if self.is_extra else None
        own = [self.scene, self.motion_id, self.method, seconds]
        return value_sha256([*parts, *own, shipped_weights()])

    @property
    def is_extra(self) -> bool:
        """Whether the motion belongs to practice pairs only."""
        extras = self.config.extras
        return extras.practice > 0 and self.motion_id == extras.practice_motion

    def reusable(self) -> str | None:
        """`"reused"` if a record of the same input exists, else None."""
        path = SetFolder(self.folder).record_path(self.scene, self.motion_id, self.method)
        same = path.exists() and read_json(path).get("input_hash") == self.input_hash()
        return "reused" if same else None


@lru_cache(maxsize=1)
def shipped_weights() -> dict[str, str]:
    """Hashes of the networks' weights: a placement made with others is made again."""
    return {path.name: file_sha256(path) for path in sorted(WEIGHTS.glob("*.safetensors"))}


@dataclass(frozen=True)
class RenderJob:
    """Render all clips of one (scene, motion) that share cameras."""

    config: StimulusSetConfig
    folder: Path
    scene: str
    motion_id: str
    role: str
    """main or practice."""
    extra: int
    """main: how many catch pairs to add; practice: ordinal of the pair."""

    @property
    def key(self) -> Key:
        """(scene, motion)."""
        return self.scene, self.motion_id

    @property
    def record_path(self) -> Path:
        """Where the outcome is noted."""
        name = f"{self.role}{self.extra}" if self.role == "practice" else self.role
        return SetFolder(self.folder).clip_record_path(self.scene, self.motion_id, name)

    def clip_path(self, role: str, method: str) -> Path:
        """Where a single finished clip is noted until all clips of the job are."""
        return self.record_path.with_suffix("") / f"{role}__{method}.json"

    def input_hash(self) -> str:
        """What the clips depend on: the placements' bytes and every render setting."""
        folder = SetFolder(self.folder)
        hashes = []
        for method in self.methods():
            archive = folder.placement_stem(self.scene, self.motion_id, method).with_suffix(".npz")
            hashes.append(file_sha256(archive) if archive.exists() else "none")
        settings = [dataclasses.asdict(self.config.render), dataclasses.asdict(self.config.extras)]
        return value_sha256([settings, hashes, self.scene, self.motion_id, self.role, self.extra])

    def methods(self) -> tuple[str, ...]:
        """Whose placements are shown."""
        every = self.config.study_methods
        return every if self.role == "main" else every[-1:]

    def reusable(self) -> str | None:
        """`"reused"` if the same input was rendered and every file is still there."""
        if not self.record_path.exists():
            return None
        record = read_json(self.record_path)
        files = [
            self.folder / clip[name] for clip in record["clips"] for name in ("file", "poster")
        ]
        same = record["input_hash"] == self.input_hash() and all(item.exists() for item in files)
        return "reused" if same else None


def run_prepare(job: PrepareJob) -> str:
    """Bake what later jobs of this room will read."""
    _one_thread()
    from experiments.scene.baking import load_room
    from experiments.scene.stage_parts import stage_parts

    load_room(job.scene)
    stage_parts(job.scene)
    return "done"


def run_place(job: PlaceJob) -> str:
    """Place and score; a method that finds no place leaves a record with the reason."""
    _one_thread()
    from experiments.methods import METHODS
    from experiments.motion_class import motion_class
    from experiments.placement.errors import PlacementError
    from experiments.placement.placement import write_placement

    folder = SetFolder(job.folder)
    scene, body, motion = load_inputs(job.config, job.scene, job.motion_id, job.is_extra)
    record: dict[str, Any] = {
        "scene": job.scene,
        "motion": job.motion_id,
        "method": job.method,
        "study_method": job.method in job.config.study_methods and not job.is_extra,
        "extra": job.is_extra,
        "input_hash": job.input_hash(),
        "failure": "",
        "scores": {},
        "motion_class": motion_class(motion, body),
        "n_frames": motion.n_frames,
        "sdf_cell_m": scene.volumes.cell,
    }
    try:
        preset = PRESETS[job.config.placement.preset]
        settings = dataclasses.replace(preset, device=job.device)
        method = METHODS[job.method]
        placement = method.place(motion, scene, body, settings, job.config.seed)
    except PlacementError as error:
        record["failure"] = str(error)
    else:
        shared = method.shares_motion
        record["scores"] = score(placement.motion, motion, scene, body, settings, shared)
        record["terms"] = placement.terms
        record["info"] = placement.info
        write_placement(placement, folder.placement_stem(job.scene, job.motion_id, job.method))
    write_json(folder.record_path(job.scene, job.motion_id, job.method), record)
    return "done"


def score(
    placed: Motion,
    original: Motion,
    scene: Scene,
    body: BodyModel,
    settings: Any,
    shares_motion: bool = True,
) -> dict[str, float]:
    """Plausibility scores of a placed motion as plain numbers for the catalogue."""
    from experiments.metrics import plausibility

    return plausibility(placed, original, scene, body, settings, shares_motion).as_dict()


def load_inputs(
    config: StimulusSetConfig, scene_name: str, motion_id: str, is_extra: bool = False
) -> tuple[Scene, BodyModel, Motion]:
    """The room, the body and the motion (cut as the configuration says) of a job."""
    from experiments.body.embedded import load_body
    from experiments.motion.library import load_motion, trim
    from experiments.motion.motion import read_motion

    if config.motions_dir and not is_extra:
        motion = read_motion(Path(config.motions_dir) / f"{motion_id}.npz")
    else:
        motion = load_motion(motion_id, config.body)
    seconds = config.extras.seconds if is_extra else config.cut_seconds
    motion = trim(motion, seconds) if seconds else motion
    return _room(scene_name), load_body(config.body), motion


@lru_cache(maxsize=2)
def _room(name: str) -> Scene:
    # One object for all jobs of a room: what was found out about it is then found again.
    from experiments.scene.baking import load_room

    return load_room(name)


def run_render(job: RenderJob) -> str:
    """Choose cameras once and render every clip of the job."""
    _one_thread()
    from experiments.clips import render_job

    render_job(job)
    return "done"


def _one_thread() -> None:
    # Jobs run side by side, one a core; thread pools inside each would only contend.
    import torch

    torch.set_num_threads(1)

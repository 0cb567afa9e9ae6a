"""Assemble the catalogue of a finished stimulus set, and check it before anyone sees it."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import platform
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from experiments.config import StimulusSetConfig
from experiments.evaluate import write_evaluation
from experiments.methods import METHODS
from experiments.motion.library import default_motions
from experiments.records import SetFolder
from experiments.scene.baking import load_room
from renderer.catalogue import (
    FILE_NAME,
    Catalogue,
    Clip,
    read_catalogue,
    verify_catalogue,
    write_catalogue,
)
from renderer.files import InputError
from renderer.lint import fairness_faults
from renderer.versions import render_versions

_LIBRARIES = ("torch", "numpy", "scipy", "trimesh", "pyrender-maintained", "imageio-ffmpeg")


def assemble_catalogue(config: StimulusSetConfig, folder: SetFolder) -> Catalogue:
    """Write `evaluation.json`, then `catalogue.json`; refuse a set whose pairs are not fair.

    A catalogue that already says the same is left as it is, with its first date.
    """
    write_evaluation(config, folder)
    drops = folder.drops()
    records = folder.clip_records()
    clips = [
        Clip(**{**clip, "views": tuple(clip["views"])}) for r in records for clip in r["clips"]
    ]
    cameras = [camera for record in records for camera in record["cameras"]]
    unseen = _unseen(config, cameras)
    hidden = {(drop["scene"], drop["motion"]) for drop in unseen}
    catalogue = Catalogue(
        set_id=config.set_id,
        created_at=_created_at(folder.path),
        generator=_generator(config),
        scenes=tuple(_scene_record(name) for name in config.scenes),
        motions=tuple(_motion_records(config, folder)),
        methods=tuple(_method_records(config)),
        cameras=tuple(cameras),
        clips=tuple(
            clip
            for clip in sorted(clips, key=lambda clip: clip.clip_id)
            if clip.role != "main" or (clip.scene, clip.motion) not in hidden
        ),
        dropped=(*drops.values(), *unseen),
    )
    earlier = _earlier(folder.path)
    if earlier and dataclasses.replace(catalogue, generator=earlier.generator) == earlier:
        # Nothing was made anew, so the record of who made it stays true.
        return earlier
    faults = fairness_faults(catalogue, folder.path)
    if faults:
        raise InputError(folder.path, "clips", faults[0], "pairs that differ in the method only")
    write_catalogue(catalogue, folder.path)
    faults = verify_catalogue(folder.path)
    if faults:
        raise InputError(folder.path, FILE_NAME, faults[0], "clips that match their hashes")
    return catalogue


def _unseen(config: StimulusSetConfig, cameras: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """(scene, motion) whose worst view shows too little, decided for all study methods together."""
    found = []
    for camera in cameras:
        worst = min(view["score"] for view in camera["views"])
        if camera["role"] == "main" and worst < config.render.min_visible:
            reason = f"worst view shows {worst:.2f} of the body, under {config.render.min_visible}"
            place = {"scene": camera["scene"], "motion": camera["motion"]}
            found.append({**place, "method": "all", "reason": reason})
    return found


def _earlier(folder: Path) -> Catalogue | None:
    return read_catalogue(folder) if (folder / FILE_NAME).exists() else None


def _created_at(folder: Path) -> str:
    earlier = _earlier(folder)
    return earlier.created_at if earlier else datetime.now(UTC).isoformat(timespec="seconds")


def _generator(config: StimulusSetConfig) -> dict[str, Any]:
    libraries = {name: importlib.metadata.version(name) for name in _LIBRARIES}
    return {
        "package": "pace-study " + importlib.metadata.version("pace-study"),
        "git_revision": _git_revision(),
        "config_sha256": config.sha256(),
        "seed": config.seed,
        "body": config.body,
        "placement_preset": config.placement.preset,
        "libraries": {**libraries, "python": platform.python_version()},
        "render": render_versions(),
    }


def _git_revision() -> str:
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    return found.stdout.strip() or "unknown"


def _scene_record(name: str) -> dict[str, Any]:
    scene = load_room(name)
    return {
        "scene": scene.scene_id,
        "content_hash": scene.content_hash,
        "room_size": list(scene.room_size),
        "objects": len(scene.instances),
        "sdf_cell_m": scene.volumes.cell,
    }


def _motion_records(config: StimulusSetConfig, folder: SetFolder) -> list[dict[str, Any]]:
    known = {spec.motion_id: spec for spec in default_motions()}
    rows = []
    for motion_id in folder.motion_ids(config):
        spec = known.get(motion_id) if not config.motions_dir else None
        label, source = (spec.label, spec.source) if spec else (motion_id, config.motions_dir)
        rows.append({"motion": motion_id, "label": label, "source": source})
    return rows


def _method_records(config: StimulusSetConfig) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "display_name": METHODS[name].display_name,
            "study_method": name in config.study_methods,
            "shares_motion": METHODS[name].shares_motion,
            "preset": config.placement.preset,
        }
        for name in config.methods
    ]

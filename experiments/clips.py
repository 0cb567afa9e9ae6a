"""Clips of one (scene, motion): one camera rig, one light, every study method."""

from __future__ import annotations

import dataclasses
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from jaxtyping import Float

from experiments.body.embedded import load_body
from experiments.motion.library import trim
from experiments.motion.motion import Motion
from experiments.placement.placement import read_placement
from experiments.records import SetFolder
from experiments.scene.baking import load_room
from experiments.scene.stage_parts import stage_parts
from renderer.cameras import CameraRig, choose_cameras
from renderer.files import file_sha256, read_json, write_json
from renderer.render import RenderedClip, render_clip
from renderer.settings import RenderSettings, preset
from renderer.stage import Stage

if TYPE_CHECKING:
    from experiments.body.model import BodyModel
    from experiments.jobs import RenderJob

LIFTED = "lifted"
"""Method name of the faulty clip of catch and practice pairs."""


@dataclasses.dataclass(frozen=True)
class Take:
    """One clip to be made."""

    role: str
    method: str
    vertices: Float[np.ndarray, "T V 3"]
    fps: float
    """Of the motion; the clip's own rate is a render setting."""
    scores: dict[str, float]
    placement: str


def render_job(job: RenderJob) -> None:
    """Render the clips of a job and write its record last.

    Main clips share one rig chosen from the room and all study methods' bodies, so that the
    cameras tell nothing about the method. Catch and practice pairs have a rig of their own, chosen
    from the sound and the lifted body together.
    """
    body, settings = load_body(job.config.body), render_settings(job)
    scene, parts = load_room(job.scene), stage_parts(job.scene)
    groups: list[list[Take]] = []
    if job.role == "main":
        groups.append(main_takes(job, body))
    if job.role == "practice" or job.extra:
        groups.append(extra_takes(job, body))
    clips: list[dict[str, Any]] = []
    rigs: list[dict[str, Any]] = []
    for takes in groups:
        bodies = [take.vertices for take in takes]
        rig = choose_cameras(
            parts, scene.room_size, scene.floor_z, bodies, body.regions, body.faces, settings
        )
        rigs.append(
            {"role": takes[0].role, "scene": job.scene, "motion": job.motion_id, **rig.to_dict()}
        )
        for take in takes:
            stage = Stage(
                parts, scene.room_size, take.vertices, body.faces, take.fps, scene.floor_z,
                regions=body.regions,
            )  # fmt: skip
            clips.append(_finished(job, take) or _render_take(job, take, stage, rig, settings))
    write_json(job.record_path, {"input_hash": job.input_hash(), "clips": clips, "cameras": rigs})
    shutil.rmtree(job.record_path.with_suffix(""), ignore_errors=True)


def render_settings(job: RenderJob) -> RenderSettings:
    """The preset of the configuration with its tiling and frame rate."""
    chosen = job.config.render
    return preset(chosen.preset, tiling=chosen.tiling, fps=float(chosen.fps))


def main_takes(job: RenderJob, body: BodyModel) -> list[Take]:
    """One take a study method."""
    return [_take(job, body, "main", method) for method in job.methods()]


def extra_takes(job: RenderJob, body: BodyModel) -> list[Take]:
    """A sound take and the same body lifted off the floor."""
    role = "practice" if job.role == "practice" else "catch"
    method = job.config.study_methods[-1]
    sound = _take(job, body, role, method, job.config.extras.seconds)
    lift = np.array([0.0, 0.0, job.config.extras.lift_m], np.float32)
    lifted = dataclasses.replace(sound, method=LIFTED, vertices=sound.vertices + lift, scores={})
    return [sound, lifted]


def skinned(body: BodyModel, motion: Motion) -> Float[np.ndarray, "T V 3"]:
    """Vertices of the full mesh, world frame, metres, float32."""
    pose = torch.as_tensor(motion.pose, dtype=torch.float32)
    transl = torch.as_tensor(motion.transl, dtype=torch.float32)
    with torch.no_grad():
        vertices = body.posed(pose, transl).vertices
    return np.ascontiguousarray(vertices.numpy())


def _take(
    job: RenderJob, body: BodyModel, role: str, method: str, seconds: float | None = None
) -> Take:
    folder = SetFolder(job.folder)
    stem = folder.placement_stem(job.scene, job.motion_id, method)
    motion = read_placement(stem).motion
    motion = trim(motion, seconds) if seconds else motion
    record = read_json(folder.record_path(job.scene, job.motion_id, method))
    scores = record["scores"] if role == "main" else {}
    source = f"placements/{stem.name}.json"
    return Take(role, method, skinned(body, motion), motion.fps, scores, source)


def _finished(job: RenderJob, take: Take) -> dict[str, Any] | None:
    """The record of a clip that an earlier, interrupted run of this job made, if it is whole."""
    path = job.clip_path(take.role, take.method)
    if not path.exists():
        return None
    note = read_json(path)
    clip: dict[str, Any] = note["clip"]
    video, poster = job.folder / clip["file"], job.folder / clip["poster"]
    whole = video.exists() and poster.exists() and file_sha256(video) == clip["sha256"]
    return clip if whole and note["input_hash"] == job.input_hash() else None


def _render_take(
    job: RenderJob, take: Take, stage: Stage, rig: CameraRig, settings: RenderSettings
) -> dict[str, Any]:
    clips = job.folder / "clips"
    clips.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=clips, prefix=".partial-") as temporary:
        video, poster = Path(temporary) / "clip.mp4", Path(temporary) / "clip.jpg"
        rendered = render_clip(stage, rig, settings, video, poster)
        clip_id = rendered.sha256[:16]
        video.replace(clips / f"{clip_id}.mp4")
        poster.replace(clips / f"{clip_id}.jpg")
    record = _clip_record(job, take, clip_id, rig, settings, rendered)
    note = {"input_hash": job.input_hash(), "clip": record}
    write_json(job.clip_path(take.role, take.method), note)
    return record


def _clip_record(
    job: RenderJob,
    take: Take,
    clip_id: str,
    rig: CameraRig,
    settings: RenderSettings,
    rendered: RenderedClip,
) -> dict[str, Any]:
    return {
        "clip_id": clip_id,
        "file": f"clips/{clip_id}.mp4",
        "poster": f"clips/{clip_id}.jpg",
        "role": take.role,
        "method": take.method,
        "scene": job.scene,
        "motion": job.motion_id,
        "views": [
            view.name for view in (rig.views if settings.tiling != "single" else [rig.best()])
        ],
        "tiling": settings.tiling,
        "scores": take.scores,
        "placement": take.placement,
        "sha256": rendered.sha256,
        "frames_sha256": rendered.frames_sha256,
        "fps": rendered.fps,
        "n_frames": rendered.n_frames,
        "duration_s": rendered.duration_s,
        "width": rendered.width,
        "height": rendered.height,
        "codec": rendered.codec,
    }

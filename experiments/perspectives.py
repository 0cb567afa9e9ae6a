"""One placement from any perspective: the four study views, an orbit, a follower, a flown path."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Integer

from experiments.body.embedded import load_body
from experiments.clips import skinned
from experiments.placement.placement import read_placement
from experiments.scene.baking import load_room
from experiments.scene.stage_parts import stage_parts
from renderer.camera_path import follow, orbit, read_path
from renderer.cameras import CameraRig, CameraView, choose_cameras
from renderer.cutaway import Cutaway
from renderer.files import InputError
from renderer.framing import swept_box
from renderer.render import Progress, output_frames, render_clip, render_path, render_stills
from renderer.settings import RenderSettings, preset
from renderer.stage import Stage
from renderer.video import write_image
from renderer.visibility import sample_bodies

FIXED, ORBIT, FOLLOW = "fixed", "orbit", "follow"
FOLLOW_REACH_M = 1.15
"""Radius around the body's centre that a following camera keeps in the picture, metres."""


@dataclass(frozen=True)
class Perspective:
    """Where to look from, and when."""

    camera: str = FIXED
    """fixed (the four views of a study clip), orbit, follow, or the path of a camera file."""
    still: float | None = None
    """Draw one picture at this second instead of a clip."""
    freeze: float | None = None
    """Hold the body still at this second while the camera moves: a turntable."""
    seconds: float | None = None
    """Length of a clip with a frozen body; otherwise the motion's own."""


def render_perspective(
    placement: Path,
    out: Path,
    perspective: Perspective,
    preset_name: str,
    tiling: str,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Render a placement into a clip or a still; returns a record of what was written.

    Raises `InputError` for a placement, camera file, time or target that cannot be used.
    """
    _require_sense(out, perspective)
    settings = preset(preset_name, tiling=tiling)
    shot = _Shot.of(placement, settings)
    if perspective.camera == FIXED and perspective.freeze is None:
        return shot.fixed(out, perspective.still, progress)
    return shot.moving(out, perspective, progress)


@dataclass(frozen=True)
class _Shot:
    """A staged placement and what cameras are chosen from."""

    stage: Stage
    settings: RenderSettings
    rig: CameraRig
    box: np.ndarray
    hidden_from: Callable[[np.ndarray], frozenset[str]]

    @classmethod
    def of(cls, placement: Path, settings: RenderSettings) -> _Shot:
        placed = read_placement(placement)
        body, scene = load_body(placed.motion.body), load_room(placed.scene)
        parts, size, floor = stage_parts(placed.scene), scene.room_size, scene.floor_z
        vertices = skinned(body, placed.motion)
        stage = Stage(
            parts, size, vertices, body.faces, placed.motion.fps, floor, regions=body.regions
        )
        rig = choose_cameras(parts, size, floor, [vertices], body.regions, body.faces, settings)
        box = swept_box([vertices], size, floor)
        samples = sample_bodies([vertices], body.faces, body.regions, size, floor)
        cutaway = Cutaway.of_room(parts, size, floor)
        return cls(
            stage, settings, rig, box,
            lambda eye: frozenset(cutaway.hidden_from(eye, box, samples)),
        )  # fmt: skip

    def fixed(self, out: Path, still: float | None, progress: Progress | None) -> dict[str, Any]:
        """The four study views as a clip, or the best of them as a picture."""
        if still is None:
            return dataclasses.asdict(
                render_clip(
                    self.stage, self.rig, self.settings, out, out.with_suffix(".jpg"), progress
                )
            )
        return self._still(out, self.rig.best(), self._frame(still, "still"))

    def moving(
        self, out: Path, perspective: Perspective, progress: Progress | None
    ) -> dict[str, Any]:
        """A clip of a moving camera, or one picture of it."""
        frames = self._frames(perspective)
        views = self._views(perspective, frames)
        if perspective.still is not None:
            index = min(round(perspective.still * self.settings.fps), len(views) - 1)
            self._frame(perspective.still, "still")
            return self._still(out, views[index], int(frames[index]))
        poster = out.with_suffix(".jpg")
        return dataclasses.asdict(
            render_path(self.stage, views, frames, self.settings, out, poster, progress)
        )

    def _views(
        self, perspective: Perspective, frames: Integer[np.ndarray, " N"]
    ) -> tuple[CameraView, ...]:
        aspect = self.settings.width / self.settings.height
        best, fps = self.rig.best(), self.settings.fps
        if perspective.camera == ORBIT:
            return orbit(self.box, best.azimuth_deg, len(frames), aspect, self.hidden_from)
        if perspective.camera == FOLLOW:
            lowest = self.stage.vertices[frames].min(1)
            highest = self.stage.vertices[frames].max(1)
            return follow((lowest + highest) / 2, fps, best, FOLLOW_REACH_M, aspect)
        if perspective.camera == FIXED:
            return (best,) * len(frames)
        times = np.arange(len(frames)) / fps
        return read_path(Path(perspective.camera), times, self.hidden_from)

    def _frames(self, perspective: Perspective) -> Integer[np.ndarray, " N"]:
        """The body's frame of every output frame."""
        moving = output_frames(len(self.stage.vertices), self.stage.fps, self.settings.fps)
        if perspective.freeze is None:
            return moving
        count = len(moving)
        if perspective.seconds is not None:
            count = max(1, round(perspective.seconds * self.settings.fps))
        return np.full(count, self._frame(perspective.freeze, "freeze"))

    def _frame(self, second: float, option: str) -> int:
        last = (len(self.stage.vertices) - 1) / self.stage.fps
        if not 0.0 <= second <= last + 1e-6:
            raise InputError("render", option, second, f"0 to {last:.2f} seconds of the motion")
        return round(second * self.stage.fps)

    def _still(self, out: Path, view: CameraView, frame: int) -> dict[str, Any]:
        picture = render_stills(self.stage, [(view, frame)], self.settings)[0]
        write_image(out, picture)
        height, width = picture.shape[:2]
        return {"file": out.name, "width": width, "height": height, "frame": frame}


def _require_sense(out: Path, perspective: Perspective) -> None:
    wanted = (".png", ".jpg") if perspective.still is not None else (".mp4",)
    if out.suffix.lower() not in wanted:
        raise InputError("render", "out", out.name, "a file name ending in " + " or ".join(wanted))
    if perspective.seconds is not None and perspective.freeze is None:
        raise InputError("render", "seconds", perspective.seconds, "only together with freeze")
    if perspective.seconds is not None and not 0.1 <= perspective.seconds <= 600:
        raise InputError("render", "seconds", perspective.seconds, "0.1 to 600")
    for name, value in (("still", perspective.still), ("freeze", perspective.freeze)):
        if value is not None and not math.isfinite(value):
            raise InputError("render", name, value, "seconds")
    known = (FIXED, ORBIT, FOLLOW)
    if perspective.camera not in known and not perspective.camera.endswith(".json"):
        raise InputError("render", "camera", perspective.camera, "fixed, orbit, follow or a .json")

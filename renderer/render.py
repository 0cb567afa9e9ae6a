"""Stage and cameras in, clip or still out: the renderer's front door."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Integer, UInt8

from renderer.camera_path import same_cutaway
from renderer.cameras import CameraRig, CameraView
from renderer.files import InputError, file_sha256
from renderer.mosaic import tile
from renderer.settings import RenderSettings
from renderer.stage import Stage
from renderer.video import CODEC, EncodedVideo, write_image, write_video

if TYPE_CHECKING:
    from renderer.session import Session

Progress = Callable[[int, int], None]
"""Called with the number of frames done and the number of all."""


@dataclass(frozen=True)
class RenderedClip:
    """A finished clip, with the two hashes that prove what it holds."""

    file: str
    poster: str
    sha256: str
    frames_sha256: str
    n_frames: int
    width: int
    height: int
    fps: float
    duration_s: float
    codec: str


def render_clip(
    stage: Stage,
    rig: CameraRig,
    settings: RenderSettings,
    target_mp4: Path,
    poster: Path,
    progress: Progress | None = None,
) -> RenderedClip:
    """Render every frame from the rig's views, tile, encode; write clip and poster whole or not at all.

    Raises `InputError` for a stage that cannot be drawn (no frames, vertices that are not finite,
    a texture without coordinates), a missing OSMesa or ffmpeg, and an encoder that fails.
    """
    require_drawable(stage)
    views = rig.views if settings.tiling != "single" else (rig.best(),)
    index = output_frames(len(stage.vertices), stage.fps, settings.fps)
    with open_session(stage, views, settings) as session:
        first: list[UInt8[np.ndarray, "h w 3"]] = []

        def frames() -> Iterator[UInt8[np.ndarray, "h w 3"]]:
            for done, source in enumerate(index, start=1):
                frame = tile(session.frame(stage.vertices[source]), settings.tiling)
                if done == 1:
                    first.append(frame)
                yield frame
                if progress is not None:
                    progress(done, len(index))

        video = write_video(frames(), target_mp4, settings.clip_size, settings.fps, settings.crf)
        write_image(poster, first[0])
    return _record(target_mp4, poster, video, settings)


def render_path(
    stage: Stage,
    views: Sequence[CameraView],
    frames: Integer[np.ndarray, " N"],
    settings: RenderSettings,
    target_mp4: Path,
    poster: Path,
    progress: Progress | None = None,
) -> RenderedClip:
    """A clip of a moving camera: `views[n]` shows the body of frame `frames[n]`, drawn in full.

    Output runs at `settings.fps`; one view fills the picture. Raises as `render_clip` does.
    """
    require_drawable(stage)
    settings = dataclasses.replace(settings, tiling="single")
    first: list[UInt8[np.ndarray, "h w 3"]] = []

    def pictures() -> Iterator[UInt8[np.ndarray, "h w 3"]]:
        done = 0
        for run in same_cutaway(tuple(views)):
            with open_session(stage, run[:1], settings) as session:
                for view in run:
                    picture = session.full_from(stage.vertices[frames[done]], view)
                    done += 1
                    if done == 1:
                        first.append(picture)
                    yield picture
                    if progress is not None:
                        progress(done, len(views))

    video = write_video(pictures(), target_mp4, settings.clip_size, settings.fps, settings.crf)
    write_image(poster, first[0])
    return _record(target_mp4, poster, video, settings)


def render_still(
    stage: Stage, rig: CameraRig, view: str, frame: int, settings: RenderSettings
) -> UInt8[np.ndarray, "h w 3"]:
    """One view of one frame as an RGB picture, drawn in full."""
    return render_stills(stage, [(rig.view(view), frame)], settings)[0]


def render_stills(
    stage: Stage, shots: Sequence[tuple[CameraView, int]], settings: RenderSettings
) -> list[UInt8[np.ndarray, "h w 3"]]:
    """RGB pictures of (camera, frame) pairs, each drawn in full."""
    require_drawable(stage)
    pictures = []
    for view, frame in shots:
        if not -len(stage.vertices) <= frame < len(stage.vertices):
            raise InputError("stage", "frame", frame, f"0 to {len(stage.vertices) - 1}")
        with open_session(stage, (view,), settings) as session:
            pictures.append(session.full(stage.vertices[frame], 0))
    return pictures


def output_frames(n_frames: int, fps: float, wanted_fps: float) -> Integer[np.ndarray, " N"]:
    """Source frame of every output frame: the nearest in time, over the same duration."""
    count = int(np.floor((n_frames - 1) / fps * wanted_fps + 1e-6)) + 1
    nearest = np.round(np.arange(count) / wanted_fps * fps).astype(np.int64)
    return np.minimum(nearest, n_frames - 1)


def require_drawable(stage: Stage) -> None:
    """Refuse a stage that cannot be drawn, naming what is wrong with it."""
    if len(stage.vertices) == 0:
        raise InputError("stage", "vertices", "0 frames", "at least one frame")
    if not stage.parts:
        raise InputError("stage", "parts", 0, "at least one part of a room")
    if not (np.isfinite(stage.fps) and stage.fps > 0):
        raise InputError("stage", "fps", stage.fps, "frames a second above 0")
    finite = np.isfinite(stage.vertices).all(axis=(1, 2))
    if not finite.all():
        frame = int(np.argmin(finite))
        raise InputError("stage", "vertices", f"not finite in frame {frame}", "finite metres")
    require_faces(stage.vertices[0], stage.faces)


def require_faces(vertices: Float[np.ndarray, "V 3"], faces: Integer[np.ndarray, "G 3"]) -> None:
    """Refuse faces that point outside the vertices."""
    if len(faces) == 0:
        raise InputError("stage", "faces", 0, "at least one triangle")
    if int(faces.min()) < 0 or int(faces.max()) >= len(vertices):
        wanted = f"vertex indices from 0 to {len(vertices) - 1}"
        worst = int(faces.min()) if int(faces.min()) < 0 else int(faces.max())
        raise InputError("stage", "faces", worst, wanted)


def open_session(stage: Stage, views: Sequence[CameraView], settings: RenderSettings) -> Session:
    """A drawing session for this stage; use it as a context manager."""
    # OpenGL binds to its platform on import, so it is imported when the platform is known.
    from renderer.session import Session

    return Session(stage, tuple(views), settings)


def _record(
    target_mp4: Path, poster: Path, video: EncodedVideo, settings: RenderSettings
) -> RenderedClip:
    width, height = settings.clip_size
    return RenderedClip(
        file=target_mp4.name,
        poster=poster.name,
        sha256=file_sha256(target_mp4),
        frames_sha256=video.frames_sha256,
        n_frames=video.n_frames,
        width=width,
        height=height,
        fps=settings.fps,
        duration_s=video.n_frames / settings.fps,
        codec=CODEC,
    )

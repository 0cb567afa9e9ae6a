"""H.264 clips and posters: deterministic bytes, no trace of where they come from, and a probe.

ffmpeg is a program beside ours (the one that `imageio-ffmpeg` brings), fed through a pipe.
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import IO

import numpy as np
from jaxtyping import UInt8

from renderer.files import InputError, atomic_path

CODEC = "h264"


@dataclass(frozen=True)
class EncodedVideo:
    """What was written: number of frames and the hash of their raw RGB bytes."""

    n_frames: int
    frames_sha256: str


@dataclass(frozen=True)
class ProbedVideo:
    """What a decoder finds in a video file."""

    codec: str
    pixel_format: str
    width: int
    height: int
    fps: float
    n_frames: int
    duration_s: float
    tags: tuple[str, ...]
    """Metadata entries `key=value` other than the container's own brands and handlers."""


def write_video(
    frames: Iterable[UInt8[np.ndarray, "h w 3"]],
    target: Path,
    size: tuple[int, int],
    fps: float,
    crf: int = 18,
) -> EncodedVideo:
    """Encode RGB frames of `size` (width, height) as H.264 in MP4; whole file or none.

    yuv420p, BT.709, limited range, index in front, a key frame every second, no metadata. Threads
    are pinned and the encoder's banner is removed: equal frames give equal bytes.
    Raises `InputError` when ffmpeg is missing, fails or is killed.
    """
    digest, count = hashlib.sha256(), 0
    with atomic_path(target) as temporary, tempfile.TemporaryFile() as log:
        process = _start(_encode_command(temporary, size, fps, crf), log)
        assert process.stdin is not None
        try:
            for frame in frames:
                data = np.ascontiguousarray(frame).data
                digest.update(data)
                process.stdin.write(data)
                count += 1
            process.stdin.close()
        except BrokenPipeError:
            # ffmpeg ended first; its exit status below says why.
            process.communicate()
        except BaseException:
            process.kill()
            process.communicate()
            raise
        _require_success(process, log, target)
        if count == 0:
            raise InputError(target, "frames", 0, "at least one frame")
    return EncodedVideo(count, digest.hexdigest())


def write_image(target: Path, image: UInt8[np.ndarray, "h w 3"]) -> None:
    """Write a PNG or JPEG (by suffix), whole or not at all."""
    from PIL import Image

    if target.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise InputError(target, "suffix", target.suffix, ".png or .jpg")
    with atomic_path(target) as temporary:
        Image.fromarray(image).save(temporary, quality=92, subsampling=0)


def probe(path: Path) -> ProbedVideo:
    """Decode a whole video and say what it holds; `InputError` if it cannot be decoded."""
    if not path.is_file():
        raise InputError(path, "file", "missing", "a video file")
    command = [
        ffmpeg_path(), "-hide_banner", "-nostdin", "-xerror", "-i", str(path),
        "-map", "0:v:0", "-fps_mode", "passthrough", "-f", "framemd5", "-",
    ]  # fmt: skip
    result = _run(command)
    if result.returncode != 0:
        raise InputError(path, "content", _last_line(result.stderr), "a video that decodes")
    return _parse_probe(path, result.stdout, result.stderr)


def ffmpeg_path() -> str:
    """The ffmpeg program; `InputError` when there is none."""
    import imageio_ffmpeg

    try:
        found: str = imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise _missing(str(error).split("\n")[0]) from None
    if os.path.sep in found and not os.access(found, os.X_OK):
        raise _missing(found)
    return found


def ffmpeg_version() -> str:
    """First line of `ffmpeg -version`, shortened to the version."""
    text = _run([ffmpeg_path(), "-version"]).stdout
    match = re.match(r"ffmpeg version (\S+)", text)
    return match.group(1) if match else "unknown"


def _encode_command(target: Path, size: tuple[int, int], fps: float, crf: int) -> list[str]:
    rate = Fraction(fps).limit_denominator(1001)
    one_second = str(max(1, round(rate)))
    return [
        ffmpeg_path(), "-hide_banner", "-nostdin", "-loglevel", "error", "-y",
        "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}",
        "-r", f"{rate.numerator}/{rate.denominator}", "-i", "-", "-an",
        "-vf", "scale=in_range=full:out_range=limited:out_color_matrix=bt709"
        ":flags=accurate_rnd+full_chroma_int,format=yuv420p",
        "-c:v", "libx264", "-preset", "medium", "-crf", str(crf), "-threads", "2",
        "-g", one_second, "-keyint_min", one_second, "-sc_threshold", "0",
        "-color_primaries", "bt709", "-color_trc", "bt709", "-colorspace", "bt709",
        "-color_range", "tv", "-map_metadata", "-1", "-metadata:s:v:0", "encoder=",
        "-fflags", "+bitexact", "-flags:v", "+bitexact",
        "-bsf:v", "filter_units=remove_types=6", "-movflags", "+faststart",
        "-f", "mp4", str(target),
    ]  # fmt: skip


def _start(command: list[str], log: IO[bytes]) -> subprocess.Popen[bytes]:
    try:
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=log,
        )
    except OSError as error:
        raise _missing(f"{command[0]}: {error.strerror}") from None


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(
            command, check=False, capture_output=True, text=True, errors="replace"
        )
    except OSError as error:
        raise _missing(f"{command[0]}: {error.strerror}") from None


def _require_success(process: subprocess.Popen[bytes], log: IO[bytes], target: Path) -> None:
    status = process.wait()
    if status == 0:
        return
    log.seek(0)
    said = _first_line(log.read().decode(errors="replace"))
    found = f"killed by signal {-status}" if status < 0 else f"exit {status}: {said}"
    raise InputError(target, "ffmpeg", found, "an encode that ends well")


def _missing(found: str) -> InputError:
    return InputError(
        "renderer", "ffmpeg", found, "the program ffmpeg (Python package imageio-ffmpeg)"
    )


def _first_line(text: str) -> str:
    """The cause: what ffmpeg says afterwards are its consequences."""
    lines = [re.sub(r"^\[[^]]*\] ", "", line.strip()) for line in text.splitlines() if line.strip()]
    return lines[0] if lines else "no message"


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "no message"


def _parse_probe(path: Path, frames: str, log: str) -> ProbedVideo:
    stream = re.search(r"Stream #0:\d+.*?: Video: (\w+).*?, (yuv\w+|rgb\w+|gray\w*)", log)
    size = re.search(r"#dimensions 0: (\d+)x(\d+)", frames)
    base = re.search(r"#tb 0: (\d+)/(\d+)", frames)
    rows = [line for line in frames.splitlines() if line and not line.startswith("#")]
    if not (stream and size and base and rows):
        raise InputError(path, "content", _last_line(log), "a video with frames")
    tick = Fraction(int(base.group(1)), int(base.group(2)))
    ticks = sum(int(row.split(",")[3]) for row in rows)
    fps = len(rows) / (ticks * tick)
    return ProbedVideo(
        codec=stream.group(1),
        pixel_format=stream.group(2),
        width=int(size.group(1)),
        height=int(size.group(2)),
        fps=float(fps),
        n_frames=len(rows),
        duration_s=float(ticks * tick),
        tags=_tags(log),
    )


_CONTAINER_TAGS = ("major_brand", "minor_version", "compatible_brands", "handler_name", "vendor_id")


def _tags(log: str) -> tuple[str, ...]:
    """Metadata lines of the input file in ffmpeg's log."""
    source = log.split("Output #0")[0]
    found = re.findall(r"^\s+(\w+)\s*: (.+)$", source, flags=re.MULTILINE)
    return tuple(
        f"{key}={value.strip()}"
        for key, value in found
        if key not in _CONTAINER_TAGS and key not in ("Duration", "Metadata", "Stream")
    )

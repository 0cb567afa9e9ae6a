"""Makes a small stimulus set for tests: a real catalogue over real clips, or over files never opened."""

from __future__ import annotations

import struct
import subprocess
import zlib
from pathlib import Path

import imageio_ffmpeg

from renderer.catalogue import Catalogue, Clip, write_catalogue
from renderer.files import file_sha256

METHODS = ("pace", "paak", "posa_t")
SCENES = ("bedroom", "library")
MOTIONS = tuple(f"walk_{n}" for n in range(6))


def encode_clip(path: Path, source: str, seconds: float) -> None:
    """A real H.264 clip of a test picture."""
    command = [
        imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", "-f", "lavfi",
        "-i", f"{source}=size=320x180:rate=20", "-t", str(seconds),
        "-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart", str(path),
    ]  # fmt: skip
    subprocess.run(command, check=True)


def tiny_png() -> bytes:
    """A grey picture of 16 x 9 pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    rows = zlib.compress(b"".join(b"\0" + b"\x80" * 16 for _ in range(9)))
    header = struct.pack(">IIBBBBB", 16, 9, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    )


def write_stimuli(
    folder: Path,
    masters: list[Path],
    scenes: tuple[str, ...] = SCENES,
    motions: tuple[str, ...] = MOTIONS,
    methods: tuple[str, ...] = METHODS,
    seconds: float = 1.0,
) -> Path:
    """A catalogue with every method in every scene and motion, two catch and two practice pairs."""
    (folder / "clips").mkdir(parents=True)
    (folder / "poster.png").write_bytes(tiny_png())
    wanted = [("main", s, m, x) for s in scenes for m in motions for x in methods]
    wanted += [("catch", s, motions[0], x) for s in scenes for x in ("pace", "lifted")]
    wanted += [("practice", s, "sit_0", x) for s in scenes for x in ("posa_t", "lifted")]
    clips = [
        _clip(folder, masters[number % len(masters)], number, row, seconds)
        for number, row in enumerate(wanted)
    ]
    named = tuple({"name": name} for name in methods)
    scenes = tuple({"scene": name} for name in scenes)
    motions = tuple({"motion": name} for name in motions)
    catalogue = Catalogue(
        "tiny", "2026-01-01T00:00:00Z", {"seed": 0}, scenes, motions, named, (), tuple(clips)
    )
    write_catalogue(catalogue, folder)
    return folder


def _clip(folder: Path, master: Path, number: int, row: tuple[str, ...], seconds: float) -> Clip:
    """The master clip, made unique by an empty box at its end, which players pass over."""
    role, scene, motion, method = row
    file = f"clips/{number:04d}.mp4"
    unique = struct.pack(">I4sQ", 16, b"free", number)
    (folder / file).write_bytes(master.read_bytes() + unique)
    digest = file_sha256(folder / file)
    return Clip(
        clip_id=digest[:16], file=file, sha256=digest, frames_sha256=digest, poster="poster.png",
        role=role, method=method, scene=scene, motion=motion, views=("front",), tiling="grid",
        fps=20.0, n_frames=round(20 * seconds), duration_s=seconds, width=320, height=180,
        codec="h264", scores={}, placement="",
    )  # type: ignore[arg-type]  # fmt: skip


def write_playing_stimuli(folder: Path) -> Path:
    """A set whose clips play for one second."""
    masters = [folder / "a.mp4", folder / "b.mp4"]
    for master, source in zip(masters, ("testsrc2", "mandelbrot"), strict=True):
        encode_clip(master, source, 1.0)
    return write_stimuli(folder / "set", masters)


def write_still_stimuli(folder: Path) -> Path:
    """The same catalogue over files that no player needs to open: quick to make, for logic tests."""
    (folder / "m.mp4").write_bytes(bytes(range(256)) * 8)
    return write_stimuli(folder / "set", [folder / "m.mp4"])

"""A small real stimulus set (clips that play), databases of both kinds, and a running server."""

from __future__ import annotations

import itertools
import os
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from renderer.catalogue import Catalogue, Clip, write_catalogue
from renderer.files import file_sha256
from study_app.db import Database, upgrade

ROOT = Path(__file__).resolve().parents[2]
METHODS = ("pace", "paak", "posa_t")
SCENES = ("bedroom", "library")
MOTIONS = tuple(f"walk_{n}" for n in range(6))

STUDY = """
study_id = "tiny"
title = "Human motion in rooms"
question = "In which clip does the person look more realistic?"
target = "pace"
baselines = ["paak", "posa_t"]
trials_per_cell = 1
seed = 3
"""


def encode_clip(path: Path, source: str, seconds: float) -> None:
    """A real H.264 clip of a test picture."""
    import imageio_ffmpeg

    command = [
        imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", "-f", "lavfi",
        "-i", f"{source}=size=320x180:rate=20", "-t", str(seconds),
        "-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart", str(path),
    ]  # fmt: skip
    subprocess.run(command, check=True)


def tiny_png() -> bytes:
    """A grey picture of 16 x 9 pixels."""
    import zlib

    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    rows = zlib.compress(b"".join(b"\0" + b"\x80" * 16 for _ in range(9)))
    header = struct.pack(">IIBBBBB", 16, 9, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    )


def write_stimuli(folder: Path, masters: list[Path], seconds: float = 1.0) -> Path:
    """A catalogue with every method in every scene and motion, two catch and two practice pairs."""
    (folder / "clips").mkdir(parents=True)
    (folder / "poster.png").write_bytes(tiny_png())
    wanted = [("main", s, m, x) for s in SCENES for m in MOTIONS for x in METHODS]
    wanted += [("catch", s, "walk_0", x) for s in SCENES for x in ("pace", "lifted")]
    wanted += [("practice", s, "sit_0", x) for s in SCENES for x in ("posa_t", "lifted")]
    clips = [
        _clip(folder, masters[number % len(masters)], number, row, seconds)
        for number, row in enumerate(wanted)
    ]
    named = tuple({"name": name} for name in METHODS)
    scenes = tuple({"scene": name} for name in SCENES)
    motions = tuple({"motion": name} for name in MOTIONS)
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


@pytest.fixture(scope="session")
def stimuli(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stimuli")
    masters = [folder / "a.mp4", folder / "b.mp4"]
    for master, source in zip(masters, ("testsrc2", "mandelbrot"), strict=True):
        encode_clip(master, source, 1.0)
    return write_stimuli(folder / "set", masters)


@pytest.fixture(scope="session")
def still_stimuli(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same catalogue over files that no player needs to open: quick to make, for logic tests."""
    folder = tmp_path_factory.mktemp("still")
    (folder / "m.mp4").write_bytes(bytes(range(256)) * 8)
    return write_stimuli(folder / "set", [folder / "m.mp4"])


def _postgresql_bin() -> Path:
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    assert found, "no PostgreSQL server: install the Debian package postgresql"
    return found[-1].parent


def _as_postgres(command: list[str]) -> list[str]:
    """PostgreSQL refuses to run as root; its own unprivileged user runs it there."""
    return ["runuser", "-u", "postgres", "--", *command] if os.geteuid() == 0 else command


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[str]:
    """An own cluster on a free port, thrown away afterwards; gives its address without database."""
    programs = _postgresql_bin()
    folder = Path(tempfile.mkdtemp(prefix="pace-pg-", dir="/tmp"))
    if os.geteuid() == 0:
        shutil.chown(folder, "postgres", "postgres")
    data, port = folder / "data", free_port()
    initdb = [str(programs / "initdb"), "-D", str(data), "-U", "pace", "-A", "trust", "--no-sync"]
    options = f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={folder}"
    options += " -c fsync=off -c max_connections=200"
    control = [str(programs / "pg_ctl"), "-D", str(data), "-w"]
    start = [*control, "-l", str(folder / "log"), "-o", options, "start"]
    quiet: dict[str, Any] = {"check": True, "stdout": subprocess.DEVNULL, "cwd": "/tmp"}
    subprocess.run(_as_postgres(initdb), **quiet)
    subprocess.run(_as_postgres(start), **quiet)
    try:
        yield f"postgresql://pace@127.0.0.1:{port}"
    finally:
        subprocess.run(_as_postgres([*control, "-m", "immediate", "stop"]), **quiet)
        shutil.rmtree(folder, ignore_errors=True)


_numbers = itertools.count()


def _new_postgresql(server: str) -> str:
    import psycopg

    name = f"pace_{next(_numbers)}"
    with psycopg.connect(f"{server}/postgres", autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    return f"{server}/{name}"


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """An empty database; every test that asks for it runs on both kinds."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path}/study.sqlite"
    return _new_postgresql(request.getfixturevalue("postgresql_server"))


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    """A database with the newest schema, on both kinds."""
    database = Database(database_url)
    upgrade(database)
    yield database
    database.close()


@pytest.fixture
def sqlite_url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path}/study.sqlite"


@pytest.fixture
def study_file(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a study file: the usual one with some lines added."""

    def write(extra: str = "", base: str = STUDY) -> Path:
        path = tmp_path / "study.toml"
        path.write_text(base + extra, encoding="utf-8")
        return path

    return write


@pytest.fixture
def pace() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs `pace-study` as a user would, in a process of its own."""

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "pace_study", *map(str, words)]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)

    return run


@pytest.fixture
def serve() -> Iterator[Callable[[str], str]]:
    """Starts the real server over a database; gives its address when it is ready."""
    import json

    processes: list[subprocess.Popen[str]] = []

    def start(url: str, **environment: str) -> str:
        command = [sys.executable, "-m", "pace_study", "serve", "--database", url, "--port", "0"]
        process = subprocess.Popen(
            [*command, "--json"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | environment,
        )
        processes.append(process)
        assert process.stdout is not None
        return str(json.loads(process.stdout.readline())["url"])

    yield start
    for process in processes:
        process.terminate()
        process.wait(20)
        assert process.stdout is not None
        process.stdout.close()


def wait_until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "condition was not met in time"
        time.sleep(0.02)

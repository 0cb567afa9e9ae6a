"""A throw-away PostgreSQL cluster of one's own, run by an unprivileged user on a free port."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


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


class Cluster(str):
    """The address of a running server without a database, with the means to take it away."""

    folder: Path
    start_words: list[str]
    stop_words: list[str]

    def start(self) -> None:
        self._run(self.start_words)

    def stop(self) -> None:
        """At once, as a crash would."""
        self._run(self.stop_words)

    def _run(self, words: list[str]) -> None:
        subprocess.run(_as_postgres(words), check=True, stdout=subprocess.DEVNULL, cwd=self.folder)


@contextmanager
def postgresql_cluster() -> Iterator[Cluster]:
    """An own cluster on a free port, thrown away afterwards; gives its address without database."""
    programs = _postgresql_bin()
    folder = Path(tempfile.mkdtemp(prefix="pace-pg-"))
    if os.geteuid() == 0:
        shutil.chown(folder, "postgres", "postgres")
    data, port = folder / "data", free_port()
    initdb = [str(programs / "initdb"), "-D", str(data), "-U", "pace", "-A", "trust", "--no-sync"]
    options = f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={folder}"
    options += " -c fsync=off -c max_connections=200"
    control = [str(programs / "pg_ctl"), "-D", str(data), "-w"]
    start = [*control, "-l", str(folder / "log"), "-o", options, "start"]
    quiet: dict[str, Any] = {"check": True, "stdout": subprocess.DEVNULL, "cwd": folder}
    subprocess.run(_as_postgres(initdb), **quiet)
    cluster = Cluster(f"postgresql://pace@127.0.0.1:{port}")
    cluster.folder, cluster.start_words = folder, start
    cluster.stop_words = [*control, "-m", "immediate", "stop"]
    cluster.start()
    try:
        yield cluster
    finally:
        cluster.stop()
        shutil.rmtree(folder, ignore_errors=True)

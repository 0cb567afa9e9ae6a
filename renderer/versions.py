"""Versions of what draws and encodes, for the catalogue's record of how clips were made."""

from __future__ import annotations

import importlib.metadata
import re

from renderer.offscreen import offscreen
from renderer.video import ffmpeg_version

_PACKAGES = ("pyrender-maintained", "PyOpenGL", "imageio-ffmpeg", "numpy", "trimesh", "embreex")


def render_versions(platform: str = "auto") -> dict[str, str]:
    """Platform, GL renderer, Mesa, LLVM, ffmpeg and the Python packages that decide the pixels.

    Raises `InputError` when no platform's library or ffmpeg is there.
    """
    with offscreen(platform) as name:
        from OpenGL import GL

        version = GL.glGetString(GL.GL_VERSION).decode()
        renderer = GL.glGetString(GL.GL_RENDERER).decode()
    packages = {name: importlib.metadata.version(name) for name in _PACKAGES}
    return {
        "platform": name,
        "gl_version": version,
        "gl_renderer": renderer,
        "mesa": _found(r"Mesa (\S+)", version),
        "llvm": _found(r"LLVM ([\d.]+)", renderer),
        "ffmpeg": ffmpeg_version(),
        **packages,
    }


def _found(pattern: str, text: str) -> str:
    match = re.search(pattern, text)
    return match.group(1) if match else "unknown"

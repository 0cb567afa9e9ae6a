"""The off-screen OpenGL context: one a process, OSMesa or EGL, released on request.

OpenGL binds itself to a platform when it is first imported, and its state belongs to a process. So
`PYOPENGL_PLATFORM` is set here before that import, a second use at the same time is refused, and a
forked child is told to be spawned instead.
"""

from __future__ import annotations

import atexit
import ctypes.util
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from renderer.files import InputError

_ADVICE = {
    "osmesa": "libOSMesa (system package libosmesa6), or the render setting platform = 'egl'",
    "egl": "EGL without a screen (system packages libegl1, libgl1-mesa-dri), or platform = 'osmesa'",
}
_EITHER = "OSMesa (system package libosmesa6) or EGL (libegl1, libgl1-mesa-dri)"


class _Held:
    """The context of this process, kept between clips because shaders are compiled into it."""

    platform: str = ""
    context: Any = None
    pid: int = 0
    number: int = 0
    in_use: bool = False
    clean_ups: ClassVar[list[Callable[[], None]]] = []


@contextmanager
def offscreen(platform: str = "auto") -> Iterator[str]:
    """Make this process's context current; gives the name of the platform in use.

    The context outlives the block, so that the next clip finds its shaders compiled; `release`
    destroys it. Raises `InputError` when the library is missing, when another block is still
    open, and in a process forked from one that renders.
    """
    _require_free()
    name = choose_platform(platform)
    if _Held.context is None:
        _create(name, platform)
    elif _Held.platform != name:
        raise _refusal(name, f"{_Held.platform} is in use in this process")
    _Held.in_use = True
    try:
        _Held.context.make_current()
        yield name
    finally:
        _Held.in_use = False


def release() -> None:
    """Destroy this process's context, if any."""
    if _Held.context is not None and _Held.pid == os.getpid():
        _Held.context.make_current()
        while _Held.clean_ups:
            _Held.clean_ups.pop()()
        _Held.context.delete_context()
    _Held.context, _Held.platform, _Held.in_use = None, "", False


def before_release(clean_up: Callable[[], None]) -> None:
    """Call this while the context is still current, when it is about to be destroyed."""
    if clean_up not in _Held.clean_ups:
        _Held.clean_ups.append(clean_up)


def context_number() -> int:
    """A number that is new for every context of this process: a key for what lives in one."""
    return _Held.number


def choose_platform(platform: str) -> str:
    """Resolve `auto`: OSMesa where its library is found (Mesa 25.1 removed it), else EGL."""
    if platform != "auto":
        return platform
    if _Held.context is not None:
        return _Held.platform
    return "osmesa" if ctypes.util.find_library("OSMesa") else "egl"


def _require_free() -> None:
    if _Held.context is None:
        return
    if _Held.pid != os.getpid():
        raise InputError(
            "renderer", "process", "forked from a process that renders", "a spawned process"
        )
    if _Held.in_use:
        raise InputError(
            "renderer", "context", "a second renderer in this process", "one at a time"
        )


def _create(name: str, asked: str) -> None:
    bound = os.environ.get("PYOPENGL_PLATFORM")
    if "OpenGL" in sys.modules and bound != name:
        raise _refusal(name, f"OpenGL was imported for {bound}")
    os.environ["PYOPENGL_PLATFORM"] = name
    try:
        context = _new_context(name)
    except Exception as error:
        # PyOpenGL reports a missing library as ImportError, AttributeError or its own types.
        found = f"{type(error).__name__}: {error}".replace("'", "")
        if asked == "auto":
            raise InputError("renderer", "platform", f"auto ({found})", _EITHER) from None
        raise _refusal(name, found) from None
    _Held.platform, _Held.context, _Held.pid = name, context, os.getpid()
    _Held.number += 1


def _new_context(name: str) -> Any:
    # The buffer that comes with the context is not drawn to: 16 x 16 pixels are enough.
    context: Any
    if name == "osmesa":
        from pyrender.platforms.osmesa import OSMesaPlatform

        context = OSMesaPlatform(16, 16)
    else:
        from pyrender.platforms import egl

        device = egl.get_device_by_index(int(os.environ.get("EGL_DEVICE_ID", "0")))
        context = egl.EGLPlatform(16, 16, device=device)
    context.init_context()
    context.make_current()
    return context


def _refusal(name: str, found: str) -> InputError:
    return InputError("renderer", "platform", f"{name} ({found})", _ADVICE[name])


atexit.register(release)

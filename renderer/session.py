"""A drawing session: the context, the static room and one body, from opening to closing.

Opening a session imports OpenGL under the platform of the settings. The static room of the last
session is kept: the clips of several methods share room and cameras, and drawing the empty room
is the dearest part of a short clip.
"""

from __future__ import annotations

from contextlib import ExitStack
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, UInt8

from renderer.body_mesh import outward_faces
from renderer.cameras import CameraView
from renderer.offscreen import before_release, context_number, offscreen
from renderer.settings import RenderSettings
from renderer.stage import Stage

if TYPE_CHECKING:
    from renderer.fast_path import FastPath
    from renderer.static_room import StaticRoom


class Session:
    """Draws one body in one room from fixed cameras. A context manager; one at a time."""

    def __init__(
        self, stage: Stage, views: tuple[CameraView, ...], settings: RenderSettings
    ) -> None:
        self._stage, self._views, self._settings = stage, views, settings
        self._stack = ExitStack()
        self._room: StaticRoom | None = None
        self._fast: FastPath | None = None

    def __enter__(self) -> Session:
        with ExitStack() as stack:
            stack.enter_context(offscreen(self._settings.platform))
            from renderer.body_layer import BodyLayer
            from renderer.fast_path import FastPath

            self._room = _kept_room(self._stage, self._views, self._settings)
            faces = outward_faces(self._stage.vertices[0], self._stage.faces)
            self._body = BodyLayer(faces, self._stage.vertices[0], self._stage.body_colour)
            self._fast = FastPath(self._room, self._body)
            stack.callback(self._fast.close)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.close()
        self._fast, self._room = None, None

    def frame(self, vertices: Float[np.ndarray, "V 3"]) -> list[UInt8[np.ndarray, "h w 3"]]:
        """All views of one body pose, each redrawn only where it changed."""
        room, fast = self._opened()
        fast.place(vertices)
        return [fast.draw(state) for state in room.views]

    def full(self, vertices: Float[np.ndarray, "V 3"], view: int) -> UInt8[np.ndarray, "h w 3"]:
        """One view drawn in full by pyrender's own passes: the reference of `frame`."""
        room, fast = self._opened()
        fast.place(vertices)
        state = room.views[view]
        picture = room.full_redraw_of(state.view, state.slot, self._body)
        fast.forget_shadow(state.slot)
        return picture

    def full_from(
        self, vertices: Float[np.ndarray, "V 3"], view: CameraView
    ) -> UInt8[np.ndarray, "h w 3"]:
        """A full picture from any camera that hides what the session's first view hides."""
        room, fast = self._opened()
        if view.hidden != room.views[0].view.hidden:
            raise ValueError("the session was opened for another cutaway")
        fast.place(vertices)
        slot = room.views[0].slot
        picture = room.full_redraw_of(view, slot, self._body)
        fast.forget_shadow(slot)
        return picture

    def dirty_share(self, view: int) -> float:
        """Share of the picture that the last frame redrew in this view."""
        room, fast = self._opened()
        rect = fast.rect_of(room.views[view])
        area = self._settings.width * self._settings.height
        return 0.0 if rect.is_empty else rect.width * rect.height / area

    def _opened(self) -> tuple[StaticRoom, FastPath]:
        if self._room is None or self._fast is None:
            raise RuntimeError("the session is not open: use it in a with block")
        return self._room, self._fast


class _Kept:
    """The room of the last session and what it was made from."""

    key: tuple[Any, ...] | None = None
    room: Any = None


def _kept_room(stage: Stage, views: tuple[CameraView, ...], settings: RenderSettings) -> StaticRoom:
    from renderer.static_room import StaticRoom
    from renderer.surfaces import surfaces_of

    look = (settings.width, settings.height, settings.msaa, settings.shadow_size)
    key = (stage.room_size, stage.floor_z, views, look, context_number())
    same_parts = _Kept.room is not None and _Kept.room.given_parts is stage.parts
    if not (same_parts and _Kept.key == key):
        forget_room()
        _Kept.room = StaticRoom(
            stage.parts, stage.room_size, stage.floor_z, views, settings,
            surfaces_of(context_number()),
        )  # fmt: skip
        _Kept.key = key
        before_release(forget_room)
    kept: StaticRoom = _Kept.room
    return kept


def forget_room() -> None:
    """Free the kept room's OpenGL objects."""
    if _Kept.room is not None:
        _Kept.room.delete()
    _Kept.room, _Kept.key = None, None

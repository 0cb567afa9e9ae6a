"""One frame quickly: only the rectangle that the body and its shadows can change is drawn.

Exact, not approximate: the rectangle is a bound, and inside it every triangle that can win a sample
is drawn in the same order into the same multisampled buffer as in a full redraw (tests compare
every pixel with pyrender's own passes).
Import only inside an `offscreen` block.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from jaxtyping import UInt8
from OpenGL import GL
from pyrender.constants import ProgramFlags

from renderer import light
from renderer.body_layer import BodyLayer
from renderer.dirty import Rect, contact_reach, dirty_rect, shadow_rect
from renderer.gl_renderer import FLAGS
from renderer.static_room import ShadowSlot, StaticRoom, ViewState, copy_depth
from renderer.surfaces import CONTACT_SIZE

_SHADOW_REACH_TEXELS = 6.0
"""Texels by which the shading point may look up the shadow map beside itself: the lift along the
normal (3.2), the 3 x 3 filter (1.5 x sqrt 2) and rounding."""
_DIRECTION = light.light_direction(light.KEY_AZIMUTH_DEG, light.KEY_ELEVATION_DEG)


class FastPath:
    """Redraws views of a static room with one body in it."""

    def __init__(self, room: StaticRoom, body: BodyLayer) -> None:
        self._room, self._body = room, body
        if not body.primitive._in_context():
            body.primitive._add_to_context()
        self._body_rects: dict[int, Rect] = {}
        self._drawn_for: dict[int, int] = {}
        self._frame = 0
        self._programs = {
            kind: _Program(room, primitive) for kind, primitive in self._kinds().items()
        }
        self._depth_program = _Program(room, body.primitive, depth_only=True)

    def place(self, vertices: np.ndarray) -> None:
        """Move the body; draws what all views share."""
        self._body.place(vertices)
        self._room.renderer.draw_contact(self._body.primitive)
        self._frame += 1

    def draw(self, state: ViewState) -> UInt8[np.ndarray, "h w 3"]:
        """The picture of this view with the body where it was placed."""
        rect = self.rect_of(state)
        picture = state.background.copy()
        if rect.is_empty:
            return picture
        self._update_shadow(state.slot)
        pixels = self._draw_rect(state, rect)
        height = picture.shape[0]
        picture[height - rect.top : height - rect.bottom, rect.left : rect.right] = pixels
        return picture

    def rect_of(self, state: ViewState) -> Rect:
        """The pixels that are redrawn for the present body."""
        room = self._room
        shadow = _SHADOW_REACH_TEXELS * room.box.texel(room.settings.shadow_size)
        contact = contact_reach(room.sky.texel(CONTACT_SIZE))
        return dirty_rect(
            state.projection, self._body.vertices, _DIRECTION, room.lowest_z, shadow, contact
        )

    def forget_shadow(self, slot: ShadowSlot) -> None:
        """Say that someone else drew into this slot's working map."""
        self._body_rects.pop(id(slot), None)
        self._drawn_for.pop(id(slot), None)

    def close(self) -> None:
        """Free the body's buffers."""
        self._body.primitive.delete()

    def _kinds(self) -> dict[str, Any]:
        kinds: dict[str, Any] = {"body": self._body.primitive}
        for batch, primitive in zip(self._room.batches, self._room.primitives, strict=True):
            kinds.setdefault("plain" if batch.texture is None else "textured", primitive)
        return kinds

    def _update_shadow(self, slot: ShadowSlot) -> None:
        """Put the room's shadow map back where the body was, and draw the body into it."""
        key = id(slot)
        if self._drawn_for.get(key) == self._frame:
            return
        size = self._room.settings.shadow_size
        before = self._body_rects.get(key, Rect(0, 0, size, size))
        if not before.is_empty:
            extent = (before.width, before.height)
            copy_depth(slot.static, slot.working, size, (before.left, before.bottom), extent)
        renderer = self._room.renderer
        renderer._configure_shadow_framebuffer()
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, renderer._shadow_fb)
        slot.working._bind_as_depth_attachment()
        GL.glDrawBuffer(GL.GL_NONE)
        GL.glReadBuffer(GL.GL_NONE)
        GL.glViewport(0, 0, size, size)
        _set_state()
        view, projection = renderer.light_matrices
        self._depth_program.use(view, projection)
        self._body.draw()
        self._body_rects[key] = shadow_rect(self._room.box, self._body.vertices, size)
        self._drawn_for[key] = self._frame

    def _draw_rect(self, state: ViewState, rect: Rect) -> UInt8[np.ndarray, "h w 3"]:
        renderer, settings = self._room.renderer, self._room.settings
        renderer._configure_main_framebuffer()
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, renderer._main_fb_ms)
        GL.glViewport(0, 0, settings.width, settings.height)
        GL.glEnable(GL.GL_SCISSOR_TEST)
        GL.glScissor(rect.left, rect.bottom, rect.width, rect.height)
        _set_state()
        GL.glClearColor(*light.BACKGROUND, 1.0)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)
        _bind_texture(0, int(state.slot.working._texid))
        _bind_texture(1, renderer.contact.texture)
        self._draw_room(state, rect)
        self._use("body", state)
        self._body.draw()
        GL.glUseProgram(0)
        pixels = self._read(rect)
        GL.glDisable(GL.GL_SCISSOR_TEST)
        return pixels

    def _draw_room(self, state: ViewState, rect: Rect) -> None:
        used = ""
        for slot, offset, count in state.geometry.select(rect):
            kind = "plain" if slot < 0 else "textured"
            if kind != used:
                self._use(kind, state)
                used = kind
            if slot >= 0:
                _bind_texture(2, int(self._room.textures[slot]._texid))
            state.geometry.bind()
            GL.glDrawElements(GL.GL_TRIANGLES, count, GL.GL_UNSIGNED_INT, ctypes.c_void_p(offset))
        GL.glBindVertexArray(0)

    def _use(self, kind: str, state: ViewState) -> None:
        program = self._programs[kind]
        program.use(state.projection.view, state.projection.projection)
        program.set_vector("cam_pos", state.view.matrix[:3, 3])
        program.set_vector("occlusion_pick", self._room.occlusion_pick(state.view))

    def _read(self, rect: Rect) -> UInt8[np.ndarray, "h w 3"]:
        renderer = self._room.renderer
        box = (rect.left, rect.bottom, rect.right, rect.top)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, renderer._main_fb_ms)
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, renderer._main_fb)
        GL.glBlitFramebuffer(*box, *box, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, renderer._main_fb)
        pixels = np.zeros((rect.height, rect.width, 4), dtype=np.uint8)
        GL.glReadPixels(
            rect.left, rect.bottom, rect.width, rect.height, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, pixels
        )
        upright: np.ndarray = pixels[::-1, :, :3]
        return upright


class _Program:
    """A compiled shader with the places of its uniforms looked up once."""

    def __init__(self, room: StaticRoom, primitive: Any, depth_only: bool = False) -> None:
        flags = ProgramFlags.NONE if depth_only else ProgramFlags.USE_MATERIAL
        program = room.renderer._get_primitive_program(primitive, FLAGS, flags)
        self._id = program._program_id
        self._places: dict[str, int] = {}
        if depth_only:
            return
        program._bind()
        renderer = room.renderer
        view, projection = renderer.light_matrices
        for name, value in {
            **renderer.shared_uniforms,
            "directional_lights[0].direction": -light.light_pose()[:3, 2],
            "directional_lights[0].color": np.array(light.KEY_COLOUR),
            "directional_lights[0].intensity": light.KEY_INTENSITY,
            "directional_lights[0].light_matrix": projection.dot(view),
            "directional_lights[0].shadow_map": 0,
            "contact_map": 1,
            "material.base_color_texture": 2,
            "material.base_color_factor": np.asarray(primitive.material.baseColorFactor),
        }.items():
            program.set_uniform(name, value)
        program._unbind()

    def use(self, view: np.ndarray, projection: np.ndarray) -> None:
        """Bind, and set the camera."""
        GL.glUseProgram(self._id)
        for name, matrix in (("V", view), ("P", projection)):
            place = self._place(name)
            if place >= 0:
                GL.glUniformMatrix4fv(place, 1, GL.GL_TRUE, matrix.astype(np.float32))

    def set_vector(self, name: str, value: np.ndarray) -> None:
        """Set a vec3 or vec4 of the bound program."""
        place = self._place(name)
        if place >= 0:
            setter = GL.glUniform3fv if len(value) == 3 else GL.glUniform4fv
            setter(place, 1, value.astype(np.float32))

    def _place(self, name: str) -> int:
        if name not in self._places:
            self._places[name] = int(GL.glGetUniformLocation(self._id, name))
        return self._places[name]


def _set_state() -> None:
    GL.glEnable(GL.GL_DEPTH_TEST)
    GL.glDepthMask(GL.GL_TRUE)
    GL.glDepthFunc(GL.GL_LESS)
    GL.glDepthRange(0.0, 1.0)
    GL.glEnable(GL.GL_CULL_FACE)
    GL.glCullFace(GL.GL_BACK)
    GL.glDisable(GL.GL_BLEND)
    GL.glPolygonMode(GL.GL_FRONT_AND_BACK, GL.GL_FILL)
    GL.glEnable(GL.GL_MULTISAMPLE)


def _bind_texture(unit: int, texture: int) -> None:
    GL.glActiveTexture(GL.GL_TEXTURE0 + unit)
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)

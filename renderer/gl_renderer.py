"""pyrender's renderer with a fixed light, a fixed drawing order and this project's shading.

Import only inside an `offscreen` block: importing binds OpenGL to its platform.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyrender
from OpenGL import GL
from pyrender.constants import RenderFlags
from pyrender.shader_program import ShaderProgramCache

from renderer import light
from renderer.light import LightBox

FLAGS = RenderFlags.OFFSCREEN | RenderFlags.SHADOWS_DIRECTIONAL
CONTACT_SIZE = 512
_SHADERS = Path(__file__).parent / "shaders"
_KEPT_PROGRAMS: dict[int, ShaderProgramCache] = {}
"""Compiled shaders by context: they outlive a room, compiling costs more than drawing it."""


class RoomRenderer(pyrender.Renderer):  # type: ignore[misc]
    """Draws a pyrender scene of one room.

    Against pyrender's own renderer: the light's box depends on the room alone; meshes are drawn in
    the order in which they were added (pyrender iterates over a set, whose order changes from
    process to process); the number of samples is a setting; contact darkening is bound.
    """

    def __init__(
        self,
        width: int,
        height: int,
        samples: int,
        shadow_size: int,
        box: LightBox,
        sky: LightBox,
        context_key: int,
    ) -> None:
        super().__init__(width, height)
        self._buffers_made = False
        self._program_cache = _KEPT_PROGRAMS.setdefault(
            context_key, ShaderProgramCache(shader_dir=str(_SHADERS))
        )
        self.samples, self.shadow_size = samples, shadow_size
        self.light_matrices = (box.view, box.projection)
        self.contact = ContactMap(sky, self._program_cache)
        self.shared_uniforms: dict[str, Any] = {
            "sky_light": np.array(light.SKY_AMBIENT),
            "ground_light": np.array(light.GROUND_AMBIENT),
            "fill_light": np.array(light.FILL_COLOUR),
            "fill_direction": light.light_direction(
                light.FILL_AZIMUTH_DEG, light.FILL_ELEVATION_DEG
            ),
            "shadow_texel": box.texel(shadow_size),
            "shadow_range": light.DEPTH_RANGE,
            "contact_matrix": sky.projection @ sky.view,
        }

    def delete(self) -> None:
        """Free everything but the compiled shaders."""
        self._program_cache = ShaderProgramCache()
        self.contact.delete()
        super().delete()
        self._shadow_fb = None

    def __del__(self) -> None:
        # pyrender would free its numbers again here, which by now may belong to a newer room.
        pass

    def _compute_max_n_lights(self, flags: int) -> list[int]:
        return [1, 1, 1]

    def _get_light_cam_matrices(
        self, scene: Any, light_node: Any, flags: int
    ) -> tuple[np.ndarray, np.ndarray]:
        return self.light_matrices

    def _sorted_mesh_nodes(self, scene: Any) -> list[Any]:
        return sorted(scene.mesh_nodes, key=lambda node: node.name)

    def _bind_lighting(self, scene: Any, program: Any, node: Any, flags: int) -> None:
        super()._bind_lighting(scene, program, node, flags)
        for name, value in self.shared_uniforms.items():
            program.set_uniform(name, value)
        unit = self._get_next_active_texture()
        GL.glActiveTexture(GL.GL_TEXTURE0 + unit)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.contact.texture)
        program.set_uniform("contact_map", unit)

    def _configure_shadow_mapping_viewport(self, light: Any, flags: int) -> None:
        super()._configure_shadow_mapping_viewport(light, flags)
        GL.glViewport(0, 0, self.shadow_size, self.shadow_size)

    def _configure_main_framebuffer(self) -> None:
        if self._buffers_made:
            return
        self._buffers_made = True
        size = (self.viewport_width, self.viewport_height)
        self._main_cb, self._main_db = _renderbuffers(*size, 0)
        self._main_fb = _framebuffer(self._main_cb, self._main_db)
        self._main_cb_ms, self._main_db_ms = _renderbuffers(*size, self.samples)
        self._main_fb_ms = _framebuffer(self._main_cb_ms, self._main_db_ms)
        self._main_fb_dims = size


class ContactMap:
    """Coverage and height of the body's underside over the floor plan, for contact darkening."""

    def __init__(self, sky: LightBox, programs: ShaderProgramCache) -> None:
        self.texture = int(GL.glGenTextures(1))
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.texture)
        GL.glTexImage2D(
            GL.GL_TEXTURE_2D, 0, GL.GL_RG32F, CONTACT_SIZE, CONTACT_SIZE, 0, GL.GL_RG,
            GL.GL_FLOAT, None,
        )  # fmt: skip
        for name, value in (
            (GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR),
            (GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR),
            (GL.GL_TEXTURE_WRAP_S, GL.GL_CLAMP_TO_BORDER),
            (GL.GL_TEXTURE_WRAP_T, GL.GL_CLAMP_TO_BORDER),
        ):
            GL.glTexParameteri(GL.GL_TEXTURE_2D, name, value)
        GL.glBindTexture(GL.GL_TEXTURE_2D, 0)
        self._depth = int(GL.glGenRenderbuffers(1))
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, self._depth)
        GL.glRenderbufferStorage(
            GL.GL_RENDERBUFFER, GL.GL_DEPTH_COMPONENT24, CONTACT_SIZE, CONTACT_SIZE
        )
        self._frame = int(GL.glGenFramebuffers(1))
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        GL.glFramebufferTexture2D(
            GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, GL.GL_TEXTURE_2D, self.texture, 0
        )
        GL.glFramebufferRenderbuffer(
            GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, GL.GL_RENDERBUFFER, self._depth
        )
        self._sky, self._programs = sky, programs
        self.draw(None)

    def draw(self, primitive: Any | None) -> None:
        """Redraw the map for this body; None clears it (no body)."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        GL.glViewport(0, 0, CONTACT_SIZE, CONTACT_SIZE)
        GL.glDisable(GL.GL_SCISSOR_TEST)
        GL.glDisable(GL.GL_BLEND)
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glClearColor(0.0, 0.0, 0.0, 0.0)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)
        if primitive is not None:
            program = self._programs.get_program("contact.vert", "contact.frag")
            if not program._in_context():
                program._add_to_context()
            program._bind()
            program.set_uniform("V", self._sky.view)
            program.set_uniform("P", self._sky.projection)
            primitive._bind()
            GL.glDrawElements(GL.GL_TRIANGLES, primitive.indices.size, GL.GL_UNSIGNED_INT, None)
            primitive._unbind()
            program._unbind()
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, 0)

    def delete(self) -> None:
        """Free texture, depth buffer and framebuffer."""
        if self._frame:
            GL.glDeleteFramebuffers(1, [self._frame])
            GL.glDeleteRenderbuffers(1, [self._depth])
            GL.glDeleteTextures([self.texture])
        self._frame = 0


def _renderbuffers(width: int, height: int, samples: int) -> tuple[int, int]:
    buffers = GL.glGenRenderbuffers(2)
    formats = (GL.GL_RGBA, GL.GL_DEPTH_COMPONENT24)
    for buffer, kind in zip(buffers, formats, strict=True):
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
        GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, kind, width, height)
    return int(buffers[0]), int(buffers[1])


def _framebuffer(colour: int, depth: int) -> int:
    frame = int(GL.glGenFramebuffers(1))
    GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, frame)
    for point, buffer in (
        (GL.GL_COLOR_ATTACHMENT0, colour),
        (GL.GL_DEPTH_ATTACHMENT, depth),
    ):
        GL.glFramebufferRenderbuffer(GL.GL_DRAW_FRAMEBUFFER, point, GL.GL_RENDERBUFFER, buffer)
    return frame

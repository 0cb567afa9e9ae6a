"""pyrender's renderer with a fixed light, a fixed drawing order and this project's shading.

Import only inside an `offscreen` block: importing binds OpenGL to its platform.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyrender
from OpenGL import GL
from pyrender.constants import RenderFlags
from pyrender.shader_program import ShaderProgramCache

from renderer import light
from renderer.light import LightBox
from renderer.surfaces import Surfaces

FLAGS = RenderFlags.OFFSCREEN | RenderFlags.SHADOWS_DIRECTIONAL


class RoomRenderer(pyrender.Renderer):  # type: ignore[misc]
    """Draws a pyrender scene of one room.

    Against pyrender's own renderer: the light's box depends on the room alone; meshes are drawn in
    the order in which they were added (pyrender iterates over a set, whose order changes from
    process to process); the number of samples is a setting; contact darkening is bound; meshes
    named in `shadowless` cast no shadow.
    """

    def __init__(
        self,
        width: int,
        height: int,
        samples: int,
        shadow_size: int,
        box: LightBox,
        sky: LightBox,
        surfaces: Surfaces,
    ) -> None:
        super().__init__(width, height)
        self.surfaces = surfaces
        self.shadowless: frozenset[str] = frozenset()
        self._casting = False
        self._program_cache = surfaces.programs
        self.samples, self.shadow_size = samples, shadow_size
        self.light_matrices = (box.view, box.projection)
        self.contact, self._sky = surfaces.contact, sky
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
        """Free what belongs to this room; shaders and render targets are kept for the next."""
        self._program_cache = ShaderProgramCache()
        for name in ("_main_fb", "_main_cb", "_main_db", "_shadow_fb"):
            setattr(self, name, None)
        super().delete()

    def draw_contact(self, primitive: Any | None) -> None:
        """Redraw the contact map for this body; None clears it."""
        self.contact.draw(self._sky, primitive)

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
        nodes = [n for n in scene.mesh_nodes if not (self._casting and n.name in self.shadowless)]
        return sorted(nodes, key=lambda node: node.name)

    def _shadow_mapping_pass(self, scene: Any, light_node: Any, flags: int) -> None:
        self._casting = True
        try:
            super()._shadow_mapping_pass(scene, light_node, flags)
        finally:
            self._casting = False

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
        size = (self.viewport_width, self.viewport_height)
        drawn, resolved = self.surfaces.picture(*size, self.samples)
        self._main_fb, self._main_cb, self._main_db = resolved
        self._main_fb_ms, self._main_cb_ms, self._main_db_ms = drawn
        self._main_fb_dims = size

    def _configure_shadow_framebuffer(self) -> None:
        self._shadow_fb = self.surfaces.shadow_frame

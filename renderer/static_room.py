"""The static room in OpenGL: its meshes, and per view the finished picture and shadow map.

Import only inside an `offscreen` block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyrender
from jaxtyping import Float, UInt8
from OpenGL import GL
from pyrender.primitive import Primitive

from renderer import light
from renderer.batches import Batch, make_batches
from renderer.body_layer import BodyLayer
from renderer.cameras import FAR_M, NEAR_M, CameraView
from renderer.dirty import Projection
from renderer.gl_renderer import FLAGS, RoomRenderer
from renderer.leftovers import leftover_parts, shown_groups
from renderer.settings import RenderSettings
from renderer.stage import StagePart
from renderer.surfaces import Surfaces
from renderer.view_geometry import ViewGeometry
from renderer.visible_set import visible_triangles

_BODY_NODE = "~body"
"""Sorts behind all room nodes, so the body is drawn last."""


@dataclass
class ViewState:
    """What stays the same for one camera over all frames."""

    view: CameraView
    projection: Projection
    background: UInt8[np.ndarray, "h w 3"]
    slot: ShadowSlot
    geometry: ViewGeometry


@dataclass
class ShadowSlot:
    """Shadow maps of one set of shown groups: of the room alone, and the one being worked on."""

    shown: frozenset[str]
    static: pyrender.Texture
    working: pyrender.Texture


class StaticRoom:
    """All GL objects of one room under one camera rig."""

    def __init__(
        self,
        parts: Sequence[StagePart],
        room_size: tuple[float, float, float],
        floor_z: float,
        views: Sequence[CameraView],
        settings: RenderSettings,
        surfaces: Surfaces,
    ) -> None:
        self.settings = settings
        self.given_parts = parts
        self.parts = (*parts, *leftover_parts(parts, room_size, floor_z))
        hidden_sets = sorted({view.hidden for view in views})
        self._pick = {hidden: np.eye(4)[k] for k, hidden in enumerate(hidden_sets)}
        self.batches = make_batches(self.parts, hidden_sets)
        self.lowest_z = min(float(batch.corners[..., 2].min()) for batch in self.batches)
        self.box = light.light_box(room_size, floor_z)
        self.sky = light.sky_box(room_size, floor_z)
        self.renderer = RoomRenderer(
            settings.width, settings.height, settings.msaa, settings.shadow_size, self.box,
            self.sky, surfaces,
        )  # fmt: skip
        self.scene, self.light, self._camera_node = self._empty_scene()
        self.textures: dict[int, pyrender.Texture] = {}
        self.primitives, self._nodes = self._add_batches()
        lit_through = light.walls_towards_key()
        self.renderer.shadowless = frozenset(
            node.name
            for batch, node in zip(self.batches, self._nodes, strict=True)
            if batch.group in lit_through
        )
        self._body_node: pyrender.Node | None = None
        self.views: list[ViewState] = []
        self._slots: dict[frozenset[str], ShadowSlot] = {}
        for view in views:
            self._add_view(view)

    def _add_view(self, view: CameraView) -> None:
        """Draw the empty room for this camera and keep its picture and shadow map."""
        projection = self.aim(view)
        shown = frozenset(shown_groups(self.parts, view.hidden))
        slot = self._slots.get(shown) or self._new_slot(shown)
        background = self.full_redraw_of(view, slot, body=None)
        copy_depth(slot.working, slot.static, self.settings.shadow_size)
        visible = visible_triangles(
            self.batches, self.primitives, shown, projection, self.settings.msaa,
            self.renderer.surfaces,
        )  # fmt: skip
        geometry = ViewGeometry(self.batches, visible, projection)
        self.views.append(ViewState(view, projection, background, slot, geometry))

    def full_redraw_of(
        self, view: CameraView, slot: ShadowSlot, body: BodyLayer | None
    ) -> UInt8[np.ndarray, "h w 3"]:
        """Picture of everything by pyrender's own passes: the reference of the fast path."""
        self.aim(view)
        for batch, node in zip(self.batches, self._nodes, strict=True):
            node.mesh.is_visible = batch.group in slot.shown
        self._set_body(body)
        self.renderer.draw_contact(None if body is None else body.primitive)
        self.renderer.shared_uniforms["occlusion_pick"] = self.occlusion_pick(view)
        self.light._shadow_texture = slot.working
        # pyrender loads what is new to it and frees what its scene (or its setter) drops; these
        # textures and the body are loaded and freed by their owners.
        self.renderer._shadow_textures = {slot.working}
        colour, _ = self.renderer.render(self.scene, FLAGS)
        picture: np.ndarray = np.ascontiguousarray(colour)
        return picture

    def occlusion_pick(self, view: CameraView) -> Float[np.ndarray, "4"]:
        """Which of the four baked occlusions this view uses, as a one-hot vector."""
        pick: np.ndarray = self._pick[view.hidden]
        return pick

    def aim(self, view: CameraView) -> Projection:
        """Point the scene's camera; gives world-to-pixel of this view."""
        pose = view.matrix
        camera = pyrender.PerspectiveCamera(yfov=view.yfov, znear=NEAR_M, zfar=FAR_M)
        self._camera_node.camera = camera
        self.scene.set_pose(self._camera_node, pose)
        size = (self.settings.width, self.settings.height)
        return Projection(np.linalg.inv(pose), camera.get_projection_matrix(*size), *size)

    def delete(self) -> None:
        """Free every GL object of this room."""
        self._set_body(None)
        self.light._shadow_texture = None
        for state in self.views:
            state.geometry.delete()
        size, surfaces = self.settings.shadow_size, self.renderer.surfaces
        for slot in self._slots.values():
            surfaces.give_back(size, slot.static)
            surfaces.give_back(size, slot.working)
        self.renderer._shadow_textures = set()
        self.renderer.delete()
        self._slots, self.views = {}, []

    def _empty_scene(self) -> tuple[pyrender.Scene, pyrender.DirectionalLight, pyrender.Node]:
        scene = pyrender.Scene(bg_color=[*light.BACKGROUND, 1.0], ambient_light=[0.0, 0.0, 0.0])
        key = pyrender.DirectionalLight(color=light.KEY_COLOUR, intensity=light.KEY_INTENSITY)
        scene.add_node(pyrender.Node(light=key, matrix=light.light_pose()))
        camera = pyrender.Node(camera=pyrender.PerspectiveCamera(yfov=0.5), matrix=np.eye(4))
        scene.add_node(camera)
        scene.main_camera_node = camera
        return scene, key, camera

    def _add_batches(self) -> tuple[list[Primitive], list[pyrender.Node]]:
        primitives, nodes = [], []
        for index, batch in enumerate(self.batches):
            primitive = _primitive(batch, self.textures)
            node = pyrender.Node(name=f"{index:06d}", mesh=pyrender.Mesh([primitive]))
            self.scene.add_node(node)
            primitives.append(primitive)
            nodes.append(node)
        return primitives, nodes

    def _set_body(self, body: BodyLayer | None) -> None:
        mesh = None if body is None else body.mesh
        if self._body_node is not None and self._body_node.mesh is not mesh:
            self.scene.remove_node(self._body_node)
            self._body_node = None
        if mesh is not None and self._body_node is None:
            self._body_node = pyrender.Node(name=_BODY_NODE, mesh=mesh)
            self.scene.add_node(self._body_node)
            if body is not None and body.primitive._in_context():
                self.renderer._meshes = self.renderer._meshes | {mesh}

    def _new_slot(self, shown: frozenset[str]) -> ShadowSlot:
        size = self.settings.shadow_size
        textures = [self.renderer.surfaces.take_shadow_map(size) for _ in range(2)]
        slot = ShadowSlot(shown, textures[0], textures[1])
        self._slots[shown] = slot
        return slot


def copy_depth(
    source: pyrender.Texture,
    target: pyrender.Texture,
    size: int,
    corner: tuple[int, int] = (0, 0),
    extent: tuple[int, int] | None = None,
) -> None:
    """Copy texels bit by bit, no conversion on the way."""
    width, height = extent or (size, size)
    GL.glCopyImageSubData(
        int(source._texid), GL.GL_TEXTURE_2D, 0, *corner, 0,
        int(target._texid), GL.GL_TEXTURE_2D, 0, *corner, 0, width, height, 1,
    )  # fmt: skip


def _primitive(batch: Batch, textures: dict[int, pyrender.Texture]) -> Primitive:
    texture = textures.get(batch.texture_slot)
    if texture is None and batch.texture is not None:
        texture = pyrender.Texture(source=batch.texture, source_channels="RGB")
        textures[batch.texture_slot] = texture
    count = 3 * len(batch.corners)
    opaque = np.ones((count, 1), dtype=np.float32)
    uv = np.zeros((count, 2), np.float32) if batch.uv is None else batch.uv.reshape(-1, 2)
    return Primitive(
        positions=batch.corners.reshape(-1, 3),
        normals=batch.normals.reshape(-1, 3),
        # Four openness values travel in the slot that pyrender has for four numbers a vertex.
        tangents=batch.occlusion.reshape(-1, 4),
        texcoord_0=uv,
        color_0=np.hstack([batch.colours.reshape(-1, 3), opaque]),
        material=pyrender.MetallicRoughnessMaterial(
            baseColorTexture=texture, baseColorFactor=[1.0] * 4, metallicFactor=0.0
        ),
    )

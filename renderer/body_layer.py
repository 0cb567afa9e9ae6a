"""The body as a pyrender mesh whose vertices are replaced frame by frame."""

from __future__ import annotations

import ctypes

import numpy as np
import pyrender
from jaxtyping import Float, Integer
from OpenGL import GL
from pyrender.primitive import Primitive

from renderer.batches import to_linear
from renderer.normals import NormalsOf

ROUGHNESS = 0.7


class BodyLayer:
    """Positions and normals in one interleaved vertex buffer, written anew for every frame."""

    def __init__(
        self,
        faces: Integer[np.ndarray, "G 3"],
        first: Float[np.ndarray, "V 3"],
        colour: tuple[float, float, float],
    ) -> None:
        self._normals = NormalsOf(faces, len(first))
        linear = to_linear(np.array(colour, dtype=np.float64))
        self.colour = np.append(linear, 1.0)
        self.vertices = np.ascontiguousarray(first, dtype=np.float32)
        self.primitive = Primitive(
            positions=self.vertices,
            normals=self._normals(self.vertices),
            indices=faces,
            material=pyrender.MetallicRoughnessMaterial(
                baseColorFactor=self.colour.tolist(), metallicFactor=0.0, roughnessFactor=ROUGHNESS
            ),
        )
        self.mesh = pyrender.Mesh([self.primitive])

    def place(self, vertices: Float[np.ndarray, "V 3"]) -> None:
        """Move the body: vertices in world coordinates, metres."""
        self.vertices = np.ascontiguousarray(vertices, dtype=np.float32)
        normals = self._normals(self.vertices)
        self.primitive.positions, self.primitive.normals = self.vertices, normals
        if not self.primitive._in_context():
            return
        data = np.ascontiguousarray(np.hstack([self.vertices, normals]), dtype=np.float32)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self.primitive._buffers[0])
        GL.glBufferSubData(GL.GL_ARRAY_BUFFER, 0, data.nbytes, data)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, 0)

    def draw(self) -> None:
        """Issue the draw call; program and framebuffer are the caller's."""
        self.primitive._bind()
        GL.glDrawElements(
            GL.GL_TRIANGLES,
            self.primitive.indices.size,
            GL.GL_UNSIGNED_INT,
            ctypes.c_void_p(0),
        )
        self.primitive._unbind()

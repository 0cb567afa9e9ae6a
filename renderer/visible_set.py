"""Which triangles of the static room a fixed camera can see at all.

The room and the camera stand still, and a body only covers things. So a triangle that wins no
sample of the empty room's picture wins none in any frame, and leaving it out changes no pixel. Of
a furnished room a view keeps a small part. Import only inside an `offscreen` block.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Integer
from OpenGL import GL
from pyrender.shader_program import ShaderProgram, ShaderProgramCache

from renderer.batches import Batch
from renderer.dirty import Projection


def visible_triangles(
    batches: Sequence[Batch],
    primitives: Sequence[Any],
    shown: Collection[str],
    camera: Projection,
    samples: int,
    programs: ShaderProgramCache,
) -> Bool[np.ndarray, " F"]:
    """Mask over all triangles of all batches: True where one sample of the picture shows it.

    Every triangle is drawn with its number as colour into a buffer with the picture's own sample
    positions, and every sample is read back.
    """
    target = _IdTarget(camera.width, camera.height, max(samples, 1))
    try:
        target.bind()
        _draw_numbers(batches, primitives, shown, camera, programs)
        numbers = target.read(_program(programs, "samples.vert", "samples.frag"))
    finally:
        target.delete()
    mask = np.zeros(1 + sum(len(batch.corners) for batch in batches), dtype=bool)
    mask[numbers] = True
    return mask[1:]


def _draw_numbers(
    batches: Sequence[Batch],
    primitives: Sequence[Any],
    shown: Collection[str],
    camera: Projection,
    programs: ShaderProgramCache,
) -> None:
    program = _program(programs, "ids.vert", "ids.frag")
    program._bind()
    program.set_uniform("V", camera.view)
    program.set_uniform("P", camera.projection)
    first = 0
    for batch, primitive in zip(batches, primitives, strict=True):
        if batch.group in shown:
            program.set_uniform("first_triangle", first)
            primitive._bind()
            GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3 * len(batch.corners))
        first += len(batch.corners)
    GL.glBindVertexArray(0)
    program._unbind()


class _IdTarget:
    """A multisampled buffer of triangle numbers, and a plain one to read a sample from."""

    def __init__(self, width: int, height: int, samples: int) -> None:
        self._size, self._samples = (width, height), samples
        self._texture = int(GL.glGenTextures(1))
        GL.glBindTexture(GL.GL_TEXTURE_2D_MULTISAMPLE, self._texture)
        GL.glTexImage2DMultisample(
            GL.GL_TEXTURE_2D_MULTISAMPLE, samples, GL.GL_R32UI, width, height, GL.GL_TRUE
        )
        buffers = GL.glGenRenderbuffers(2)
        self._depth, self._plain = int(buffers[0]), int(buffers[1])
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, self._depth)
        GL.glRenderbufferStorageMultisample(
            GL.GL_RENDERBUFFER, samples, GL.GL_DEPTH_COMPONENT24, width, height
        )
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, self._plain)
        GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, GL.GL_R32UI, width, height)
        frames = GL.glGenFramebuffers(2)
        self._frame, self._plain_frame = int(frames[0]), int(frames[1])

    def bind(self) -> None:
        """Clear, and make the numbers go here."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        GL.glFramebufferTexture2D(
            GL.GL_FRAMEBUFFER,
            GL.GL_COLOR_ATTACHMENT0,
            GL.GL_TEXTURE_2D_MULTISAMPLE,
            self._texture,
            0,
        )
        GL.glFramebufferRenderbuffer(
            GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, GL.GL_RENDERBUFFER, self._depth
        )
        GL.glViewport(0, 0, *self._size)
        GL.glDisable(GL.GL_SCISSOR_TEST)
        GL.glDisable(GL.GL_BLEND)
        GL.glEnable(GL.GL_MULTISAMPLE)
        GL.glEnable(GL.GL_CULL_FACE)
        GL.glCullFace(GL.GL_BACK)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glDepthFunc(GL.GL_LESS)
        GL.glClearBufferuiv(GL.GL_COLOR, 0, np.zeros(4, dtype=np.uint32))
        GL.glClear(GL.GL_DEPTH_BUFFER_BIT)

    def read(self, program: ShaderProgram) -> Integer[np.ndarray, " N"]:
        """The different numbers over all samples of all pixels; 0 is the background."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._plain_frame)
        GL.glFramebufferRenderbuffer(
            GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, GL.GL_RENDERBUFFER, self._plain
        )
        GL.glDisable(GL.GL_DEPTH_TEST)
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glActiveTexture(GL.GL_TEXTURE0)
        GL.glBindTexture(GL.GL_TEXTURE_2D_MULTISAMPLE, self._texture)
        program._bind()
        program.set_uniform("triangles", 0)
        found = []
        for sample in range(self._samples):
            program.set_uniform("sample_number", sample)
            GL.glBindVertexArray(program._vao_id)
            GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)
            numbers = np.zeros(self._size[::-1], dtype=np.uint32)
            GL.glReadPixels(0, 0, *self._size, GL.GL_RED_INTEGER, GL.GL_UNSIGNED_INT, numbers)
            found.append(np.unique(numbers))
        GL.glBindVertexArray(0)
        program._unbind()
        return np.unique(np.concatenate(found)).astype(np.int64)

    def delete(self) -> None:
        """Free the buffers."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, 0)
        GL.glDeleteFramebuffers(2, [self._frame, self._plain_frame])
        GL.glDeleteRenderbuffers(2, [self._depth, self._plain])
        GL.glDeleteTextures([self._texture])


def _program(programs: ShaderProgramCache, vertex: str, fragment: str) -> ShaderProgram:
    program = programs.get_program(vertex, fragment)
    if not program._in_context():
        program._add_to_context()
    return program

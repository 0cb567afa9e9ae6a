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
    target = _IdTarget(camera.width, camera.height, samples)
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
    """A buffer of triangle numbers sampled like the picture, and a plain one to read it through."""

    def __init__(self, width: int, height: int, samples: int) -> None:
        self._size, self._samples = (width, height), samples
        self._plain = _renderbuffer(GL.GL_R32UI, 0, width, height)
        self._depth = _renderbuffer(GL.GL_DEPTH_COMPONENT24, samples, width, height)
        self._texture = int(GL.glGenTextures(1))
        frames = GL.glGenFramebuffers(2)
        self._frame, self._plain_frame = int(frames[0]), int(frames[1])
        _attach(self._plain_frame, GL.GL_COLOR_ATTACHMENT0, self._plain)
        if samples:
            kind = GL.GL_TEXTURE_2D_MULTISAMPLE
            GL.glBindTexture(kind, self._texture)
            GL.glTexImage2DMultisample(kind, samples, GL.GL_R32UI, width, height, GL.GL_TRUE)
            GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
            GL.glFramebufferTexture2D(
                GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, kind, self._texture, 0
            )
        else:
            # A multisampled buffer has no sample in the pixel's centre, where this picture has it.
            _attach(self._frame, GL.GL_COLOR_ATTACHMENT0, self._plain)
        _attach(self._frame, GL.GL_DEPTH_ATTACHMENT, self._depth)

    def bind(self) -> None:
        """Clear, and make the numbers go here."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
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
        if not self._samples:
            return self._numbers()
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
            found.append(self._numbers())
        GL.glBindVertexArray(0)
        program._unbind()
        return np.unique(np.concatenate(found))

    def delete(self) -> None:
        """Free the buffers."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, 0)
        GL.glDeleteFramebuffers(2, [self._frame, self._plain_frame])
        GL.glDeleteRenderbuffers(2, [self._depth, self._plain])
        GL.glDeleteTextures([self._texture])

    def _numbers(self) -> Integer[np.ndarray, " N"]:
        numbers = np.zeros(self._size[::-1], dtype=np.uint32)
        GL.glReadPixels(0, 0, *self._size, GL.GL_RED_INTEGER, GL.GL_UNSIGNED_INT, numbers)
        return np.unique(numbers).astype(np.int64)


def _renderbuffer(kind: int, samples: int, width: int, height: int) -> int:
    buffer = int(GL.glGenRenderbuffers(1))
    GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
    GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, kind, width, height)
    return buffer


def _attach(frame: int, point: int, buffer: int) -> None:
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, frame)
    GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, point, GL.GL_RENDERBUFFER, buffer)


def _program(programs: ShaderProgramCache, vertex: str, fragment: str) -> ShaderProgram:
    program = programs.get_program(vertex, fragment)
    if not program._in_context():
        program._add_to_context()
    return program

"""Render targets and compiled shaders of one context, made once and used by every room.

Mesa's software rasteriser does not give back the memory of a render target whose framebuffer is
deleted (about 100 MB a room were lost that way), so none is ever deleted while its context lives.
Import only inside an `offscreen` block.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyrender
from jaxtyping import Integer
from OpenGL import GL
from pyrender.shader_program import ShaderProgram, ShaderProgramCache

from renderer.light import LightBox

CONTACT_SIZE = 512
_SHADERS = Path(__file__).parent / "shaders"

Target = tuple[int, int, int]
"""Framebuffer, colour and depth renderbuffer."""


class Programs(ShaderProgramCache):  # type: ignore[misc]
    """Compiled shaders of one context.

    pyrender's cache keys its programs by the current context. OSMesa names that by a new pointer
    object at every call, so that nothing is ever found and every draw call compiles once more.
    """

    def __init__(self) -> None:
        super().__init__(shader_dir=str(_SHADERS))
        self._compiled: dict[tuple[Any, ...], ShaderProgram] = {}

    def get_program(
        self,
        vertex_shader: str,
        fragment_shader: str,
        geometry_shader: str | None = None,
        defines: dict[str, int] | None = None,
    ) -> ShaderProgram:
        """The program of these files and defines, made once."""
        key = (vertex_shader, fragment_shader, *sorted((defines or {}).items()))
        if key not in self._compiled:
            files = [str(_SHADERS / name) for name in (vertex_shader, fragment_shader)]
            self._compiled[key] = ShaderProgram(*files, None, defines)
        return self._compiled[key]


class Surfaces:
    """What a context keeps between rooms."""

    def __init__(self) -> None:
        self.programs = Programs()
        self.contact = ContactMap(self.programs)
        self.shadow_frame = int(GL.glGenFramebuffers(1))
        self._free_shadow_maps: dict[int, list[pyrender.Texture]] = {}
        self._pictures: dict[tuple[int, int, int], tuple[Target, Target]] = {}
        self._ids: dict[tuple[int, int, int], IdTarget] = {}

    def take_shadow_map(self, size: int) -> pyrender.Texture:
        """A depth texture that the shader samples by comparison."""
        free = self._free_shadow_maps.setdefault(size, [])
        return free.pop() if free else _shadow_map(size)

    def give_back(self, size: int, texture: pyrender.Texture) -> None:
        """Return a shadow map for the next room."""
        self._free_shadow_maps.setdefault(size, []).append(texture)

    def picture(self, width: int, height: int, samples: int) -> tuple[Target, Target]:
        """The (multisampled) target that is drawn to, and the one it is resolved into."""
        key = (width, height, samples)
        if key not in self._pictures:
            self._pictures[key] = (_target(*key), _target(width, height, 0))
        return self._pictures[key]

    def ids(self, width: int, height: int, samples: int) -> IdTarget:
        """The target of triangle numbers for pictures of this kind."""
        key = (width, height, samples)
        if key not in self._ids:
            self._ids[key] = IdTarget(*key)
        return self._ids[key]


def surfaces_of(context_number: int) -> Surfaces:
    """The surfaces of the current context."""
    if context_number not in _SURFACES:
        _SURFACES.clear()
        _SURFACES[context_number] = Surfaces()
    return _SURFACES[context_number]


_SURFACES: dict[int, Surfaces] = {}


def loaded_program(programs: ShaderProgramCache, vertex: str, fragment: str) -> ShaderProgram:
    """A shader program of this project, compiled on first use."""
    program = programs.get_program(vertex, fragment)
    if not program._in_context():
        program._add_to_context()
    return program


class ContactMap:
    """Coverage and height of the body's underside over the floor plan, for contact darkening."""

    def __init__(self, programs: ShaderProgramCache) -> None:
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
        self._programs = programs

    def draw(self, sky: LightBox, primitive: Any | None) -> None:
        """Redraw the map for this body in the room's sky box; None clears it (no body)."""
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
            program = loaded_program(self._programs, "contact.vert", "contact.frag")
            program._bind()
            program.set_uniform("V", sky.view)
            program.set_uniform("P", sky.projection)
            primitive._bind()
            GL.glDrawElements(GL.GL_TRIANGLES, primitive.indices.size, GL.GL_UNSIGNED_INT, None)
            primitive._unbind()
            program._unbind()
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, 0)


class IdTarget:
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

    def _numbers(self) -> Integer[np.ndarray, " N"]:
        numbers = np.zeros(self._size[::-1], dtype=np.uint32)
        GL.glReadPixels(0, 0, *self._size, GL.GL_RED_INTEGER, GL.GL_UNSIGNED_INT, numbers)
        return np.unique(numbers).astype(np.int64)


def _shadow_map(size: int) -> pyrender.Texture:
    texture = pyrender.Texture(
        width=size, height=size, source_channels="D", data_format=GL.GL_FLOAT
    )
    texture._add_to_context()
    texture._bind()
    for name, value in (
        (GL.GL_TEXTURE_COMPARE_MODE, GL.GL_COMPARE_REF_TO_TEXTURE),
        (GL.GL_TEXTURE_COMPARE_FUNC, GL.GL_LEQUAL),
        (GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR),
        (GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR),
        (GL.GL_TEXTURE_WRAP_S, GL.GL_CLAMP_TO_EDGE),
        (GL.GL_TEXTURE_WRAP_T, GL.GL_CLAMP_TO_EDGE),
    ):
        GL.glTexParameteri(GL.GL_TEXTURE_2D, name, value)
    texture._unbind()
    return texture


def _target(width: int, height: int, samples: int) -> Target:
    colour = _renderbuffer(GL.GL_RGBA, samples, width, height)
    depth = _renderbuffer(GL.GL_DEPTH_COMPONENT24, samples, width, height)
    frame = int(GL.glGenFramebuffers(1))
    _attach(frame, GL.GL_COLOR_ATTACHMENT0, colour)
    _attach(frame, GL.GL_DEPTH_ATTACHMENT, depth)
    return frame, colour, depth


def _renderbuffer(kind: int, samples: int, width: int, height: int) -> int:
    buffer = int(GL.glGenRenderbuffers(1))
    GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
    GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, kind, width, height)
    return buffer


def _attach(frame: int, point: int, buffer: int) -> None:
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, frame)
    GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, point, GL.GL_RENDERBUFFER, buffer)

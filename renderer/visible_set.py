"""Which triangles of the static room a fixed camera can see at all.

The room and the camera stand still, and a body only covers things. So a triangle that wins no
sample of the empty room's picture wins none in any frame, and leaving it out changes no pixel. Of
a furnished room a view keeps a small part. Import only inside an `offscreen` block.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool
from OpenGL import GL
from pyrender.shader_program import ShaderProgramCache

from renderer.batches import Batch
from renderer.dirty import Projection
from renderer.surfaces import Surfaces, loaded_program


def visible_triangles(
    batches: Sequence[Batch],
    primitives: Sequence[Any],
    shown: Collection[str],
    camera: Projection,
    samples: int,
    surfaces: Surfaces,
) -> Bool[np.ndarray, " F"]:
    """Mask over all triangles of all batches: True where one sample of the picture shows it.

    Every triangle is drawn with its number as colour into a buffer with the picture's own sample
    positions, and every sample is read back.
    """
    target = surfaces.ids(camera.width, camera.height, samples)
    target.bind()
    _draw_numbers(batches, primitives, shown, camera, surfaces.programs)
    numbers = target.read(loaded_program(surfaces.programs, "samples.vert", "samples.frag"))
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
    program = loaded_program(programs, "ids.vert", "ids.frag")
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

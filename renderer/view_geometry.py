"""The visible triangles of one view in buffers of their own, drawable rectangle by rectangle.

Import only inside an `offscreen` block.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float, Integer
from OpenGL import GL

from renderer.batches import Batch
from renderer.dirty import Projection, Rect, meets

_ATTRIBUTES = (3, 3, 4, 2, 3)
"""Position, normal, four openness values, texture coordinate, linear colour: the order in which
pyrender numbers vertex attributes, so that the same compiled shaders serve both."""
_FLOAT = 4


class ViewGeometry:
    """One vertex buffer with a view's visible triangles in the order of the full redraw."""

    def __init__(
        self, batches: Sequence[Batch], visible: Bool[np.ndarray, " F"], camera: Projection
    ) -> None:
        chosen = _split(batches, visible)
        corners = np.concatenate([b.corners[k] for b, k in zip(batches, chosen, strict=True)])
        self.rects = camera.rects_of(corners.astype(np.float64))
        owner = np.concatenate([np.full(len(k), i) for i, k in enumerate(chosen)])
        self._runs = _texture_runs(batches, owner)
        data = np.concatenate(
            [_vertex_rows(batch, k) for batch, k in zip(batches, chosen, strict=True)]
        )
        self._vao = int(GL.glGenVertexArrays(1))
        buffers = GL.glGenBuffers(2)
        self._vertices, self._indices = int(buffers[0]), int(buffers[1])
        self._upload(np.ascontiguousarray(data, dtype=np.float32), len(corners))

    @property
    def n_triangles(self) -> int:
        """Number of triangles that this view can see."""
        return len(self.rects)

    def select(self, rect: Rect) -> Iterator[tuple[int, int, int]]:
        """Load the triangles that meet `rect` and bind; gives (texture slot, offset, count) runs.

        Texture slot -1 is no texture; offset in bytes and count in indices, for `draw_run`.
        """
        chosen = np.flatnonzero(meets(self.rects, rect))
        indices = (3 * chosen[:, None] + np.arange(3)).astype(np.uint32)
        GL.glBindVertexArray(self._vao)
        GL.glBufferSubData(GL.GL_ELEMENT_ARRAY_BUFFER, 0, indices.nbytes, indices)
        for slot, first, last in self._runs:
            start, stop = np.searchsorted(chosen, (first, last))
            if stop > start:
                yield slot, int(3 * start * _FLOAT), int(3 * (stop - start))

    def bind(self) -> None:
        """Make this the geometry that is drawn."""
        GL.glBindVertexArray(self._vao)

    def delete(self) -> None:
        """Free the buffers."""
        GL.glDeleteVertexArrays(1, [self._vao])
        GL.glDeleteBuffers(2, [self._vertices, self._indices])

    def _upload(self, data: Float[np.ndarray, "N 15"], n_triangles: int) -> None:
        GL.glBindVertexArray(self._vao)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._vertices)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, data.nbytes, data, GL.GL_STATIC_DRAW)
        stride, offset = _FLOAT * sum(_ATTRIBUTES), 0
        for place, size in enumerate(_ATTRIBUTES):
            GL.glEnableVertexAttribArray(place)
            GL.glVertexAttribPointer(
                place, size, GL.GL_FLOAT, GL.GL_FALSE, stride, ctypes.c_void_p(offset)
            )
            offset += _FLOAT * size
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, self._indices)
        size = max(1, 3 * n_triangles) * 4
        GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, size, None, GL.GL_DYNAMIC_DRAW)
        GL.glBindVertexArray(0)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, 0)


def _split(
    batches: Sequence[Batch], visible: Bool[np.ndarray, " F"]
) -> list[Integer[np.ndarray, " K"]]:
    """Visible triangle numbers within each batch."""
    ends = np.cumsum([len(batch.corners) for batch in batches])[:-1]
    return [np.flatnonzero(mask) for mask in np.split(visible, ends)]


def _texture_runs(
    batches: Sequence[Batch], owner: Integer[np.ndarray, " K"]
) -> list[tuple[int, int, int]]:
    """(texture slot, first, last) of the stretches of triangles that share a texture."""
    slots = np.array([batch.texture_slot for batch in batches])[owner]
    if not len(slots):
        return []
    starts = np.flatnonzero(np.append(True, slots[1:] != slots[:-1]))
    ends = np.append(starts[1:], len(slots))
    return [(int(slots[a]), int(a), int(b)) for a, b in zip(starts, ends, strict=True)]


def _vertex_rows(batch: Batch, chosen: Integer[np.ndarray, " K"]) -> Float[np.ndarray, "N 15"]:
    uv = np.zeros((len(batch.corners), 3, 2), np.float32) if batch.uv is None else batch.uv
    columns = (batch.corners, batch.normals, batch.occlusion, uv, batch.colours)
    rows: np.ndarray = np.concatenate([c[chosen] for c in columns], axis=-1)
    return rows.reshape(-1, sum(_ATTRIBUTES))

"""From placed objects to a labelled mesh with baked volumes, kept in the cache by content."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from experiments.cache import cache_path
from experiments.scene.furniture_distance import Solid
from experiments.scene.objects import PlacedObject
from experiments.scene.scene import MPCAT40, Instance, Scene, Volumes
from experiments.scene.shell import shell_walls
from experiments.scene.volumes import FLOOR, WALL, bake_volumes
from renderer.files import atomic_path

CELL = 0.025
THICKNESS = 0.01
_ALGORITHM = "volumes-6"
"""Named in the cache key: change it whenever the same input gives other volumes."""


def assemble(
    scene_id: str,
    room_size: tuple[float, float, float],
    objects: Sequence[PlacedObject],
    cell: float = CELL,
    thickness: float = THICKNESS,
    on_step: Callable[[float], None] = lambda share: None,
) -> Scene:
    """Join shell and objects to one labelled mesh and bake its volumes, or take them from the cache.

    Rugs (objects of class floor) belong to the mesh but are no solids: feet stand on the floor.
    """
    pieces = _shell_pieces(room_size) + [_object_piece(placed) for placed in objects]
    corners = np.concatenate([corners for _, corners in pieces])
    owner = np.repeat(np.arange(len(pieces)), [len(corners) for _, corners in pieces])
    instances = tuple(instance for instance, _ in pieces)
    label = np.array([instance.label for instance in instances], dtype=np.uint8)
    vertices, faces, vertex_instance = _weld(corners, owner)
    content = content_hash(room_size, vertices, faces, label[vertex_instance], vertex_instance)
    solids = [
        Solid(placed.triangles(), placed.label) for placed in objects if placed.label != FLOOR
    ]
    volumes = cached_volumes(content, room_size, solids, cell, thickness, on_step)
    return Scene(
        scene_id=scene_id,
        vertices=vertices,
        faces=faces,
        vertex_label=label[vertex_instance],
        vertex_instance=vertex_instance,
        instances=instances,
        room_size=room_size,
        floor_z=0.0,
        volumes=volumes,
        content_hash=content,
    )


def cached_volumes(
    content: str,
    room_size: tuple[float, float, float],
    solids: Sequence[Solid],
    cell: float,
    thickness: float,
    on_step: Callable[[float], None] = lambda share: None,
) -> Volumes:
    """The volumes of this content at this resolution, baked only if the cache has none."""
    key = hashlib.sha256(f"{_ALGORITHM} {content} {cell} {thickness}".encode()).hexdigest()[:32]
    path = cache_path("volumes", key, ".npz")
    if not path.exists():
        volumes = bake_volumes(room_size, solids, cell, thickness, on_step)
        with atomic_path(path) as partial:
            np.savez(
                partial,
                sdf=volumes.sdf,
                thickened=volumes.thickened,
                label=volumes.label,
                origin=np.array(volumes.origin),
            )
    with np.load(path, allow_pickle=False) as stored:
        x, y, z = (float(value) for value in stored["origin"])
        return Volumes(
            sdf=stored["sdf"],
            thickened=stored["thickened"],
            label=stored["label"],
            origin=(x, y, z),
            cell=cell,
            thickness=thickness,
        )


def scene_content_hash(scene: Scene) -> str:
    """What `scene.content_hash` must be for its mesh and room box."""
    return content_hash(
        scene.room_size,
        scene.vertices,
        scene.faces,
        scene.vertex_label,
        scene.vertex_instance,
    )


def content_hash(room_size: tuple[float, float, float], *arrays: np.ndarray) -> str:
    """SHA-256 over the room box and the mesh arrays, 64 hexadecimal digits."""
    digest = hashlib.sha256(repr(tuple(float(side) for side in room_size)).encode())
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _shell_pieces(
    room_size: tuple[float, float, float],
) -> list[tuple[Instance, Float[np.ndarray, "F 3 3"]]]:
    """Floor and walls as plain instances."""
    pieces = []
    for name, corners in shell_walls(room_size).items():
        label = FLOOR if name == "floor" else WALL
        pieces.append((_instance(name, "shell", label, (0.0, 0.0, 0.0, 0.0), corners), corners))
    return pieces


def _object_piece(placed: PlacedObject) -> tuple[Instance, Float[np.ndarray, "F 3 3"]]:
    corners = placed.triangles()
    pose = (placed.x, placed.y, placed.z, placed.yaw_deg)
    return _instance(placed.id, placed.asset, placed.label, pose, corners), corners


def _instance(
    name: str,
    asset: str,
    label: int,
    pose: tuple[float, float, float, float],
    corners: Float[np.ndarray, "F 3 3"],
) -> Instance:
    low, high = corners.min(axis=(0, 1)).tolist(), corners.max(axis=(0, 1)).tolist()
    named = dict(zip(("x", "y", "z", "yaw_deg"), (float(value) for value in pose), strict=True))
    assert 0 <= label < len(MPCAT40)
    return Instance(name, asset, label, named, (tuple(low), tuple(high)))


def _weld(
    corners: Float[np.ndarray, "F 3 3"], owner: np.ndarray
) -> tuple[Float[np.ndarray, "V 3"], np.ndarray, np.ndarray]:
    """Shared vertices, faces and the instance of each vertex; instances never share a vertex."""
    flat = corners.reshape(-1, 3).astype(np.float32)
    whose = np.repeat(owner, 3).astype(np.int32)
    key = np.concatenate([flat.view(np.int32), whose[:, None]], axis=1)
    _, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return flat[first], index.reshape(-1, 3).astype(np.int32), whose[first]

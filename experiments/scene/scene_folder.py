"""The scene folder: a room as files that other programs can read, checked when read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from experiments.scene.assembly import scene_content_hash
from experiments.scene.glb import read_glb, write_glb
from experiments.scene.ply import LabelledMesh, read_ply, write_ply
from experiments.scene.scene import MPCAT40, N_CLASSES, Instance, Scene, Volumes
from renderer.files import InputError, atomic_path, file_sha256, read_json, write_json
from renderer.stage import StagePart

SCHEMA_VERSION = 1
CONVENTION = "negative inside, node-centred, corner-aligned, index order x y z"
_MESH, _VOLUMES, _DRAWN, _ABOUT = "collision.ply", "volumes.npz", "render.glb", "scene.json"
_FLOOR = MPCAT40.index("floor")
_LONGEST_SIDE = 100.0
"""Metres; a larger room is one measured in centimetres or millimetres."""


def write_scene(
    folder: Path,
    scene: Scene,
    parts: Sequence[StagePart],
    licence: str = "unknown",
    credits: Sequence[str] = (),
) -> None:
    """Write scene.json (last), render.glb, collision.ply and volumes.npz into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    mesh = LabelledMesh(
        vertices=scene.vertices.astype(np.float32),
        faces=scene.faces.astype(np.int32),
        label=scene.vertex_label,
        instance=scene.vertex_instance.astype(np.int32),
    )
    write_ply(folder / _MESH, mesh)
    write_glb(folder / _DRAWN, parts)
    _write_volumes(folder / _VOLUMES, scene.volumes)
    about = {
        "schema_version": SCHEMA_VERSION,
        "scene_id": scene.scene_id,
        "units": "m",
        "up": "z",
        "floor_z": scene.floor_z,
        "room_size": list(scene.room_size),
        "content_hash": scene.content_hash,
        "instances": [_instance_record(instance) for instance in scene.instances],
        "licence": licence,
        "credits": list(credits),
        "meta": scene.meta,
        "files": {name: file_sha256(folder / name) for name in (_MESH, _DRAWN, _VOLUMES)},
    }
    write_json(folder / _ABOUT, about)


def read_scene(folder: Path) -> Scene:
    """Read and check a scene folder.

    InputError, one line, if a file is missing or altered, units are not metres, the room is not
    z-up, or floor, faces or labels are missing.
    """
    about = read_about(folder)
    mesh = read_ply(folder / _MESH)
    instances = tuple(_instance(folder, record) for record in about["instances"])
    _check_mesh(folder / _MESH, mesh, len(instances), float(about["floor_z"]))
    width, depth, height = (float(side) for side in about["room_size"])
    scene = Scene(
        scene_id=about["scene_id"],
        vertices=mesh.vertices,
        faces=mesh.faces,
        vertex_label=mesh.label,
        vertex_instance=mesh.instance,
        instances=instances,
        room_size=(width, depth, height),
        floor_z=float(about["floor_z"]),
        volumes=_read_volumes(folder / _VOLUMES),
        content_hash=about["content_hash"],
        meta=dict(about.get("meta", {})),
    )
    if (found := scene_content_hash(scene)) != scene.content_hash:
        raise InputError(folder / _ABOUT, "content_hash", scene.content_hash, found)
    return scene


def read_parts(folder: Path) -> tuple[StagePart, ...]:
    """The drawn parts of a scene folder."""
    read_about(folder)
    return read_glb(folder / _DRAWN)


def is_scene_folder(name_or_dir: str | Path) -> bool:
    """Whether a name means a scene folder: an existing directory."""
    return Path(name_or_dir).is_dir()


def read_about(folder: Path) -> dict[str, Any]:
    """scene.json, checked as far as it goes by itself, and the hashes of the files it names."""
    source = folder / _ABOUT
    about = read_json(source)
    if not isinstance(about, dict):
        raise InputError(source, "content", type(about).__name__, "a JSON object")
    if (version := about.get("schema_version")) != SCHEMA_VERSION:
        raise InputError(source, "schema_version", version, str(SCHEMA_VERSION))
    if (units := about.get("units")) != "m":
        raise InputError(source, "units", units, "'m' (metres)")
    if (up := about.get("up")) != "z":
        raise InputError(source, "up", up, "'z'")
    _check_sizes(source, about)
    for name in (_MESH, _DRAWN, _VOLUMES):
        _check_file(folder / name, about["files"].get(name))
    return about


def _check_sizes(source: Path, about: Mapping[str, Any]) -> None:
    kinds = {"scene_id": str, "content_hash": str, "instances": list, "files": dict}
    for field, kind in kinds.items():
        if not isinstance(about.get(field), kind):
            raise InputError(source, field, about.get(field), f"a JSON {kind.__name__}")
    size = about.get("room_size")
    if not isinstance(size, list) or len(size) != 3 or not all(_is_number(side) for side in size):
        raise InputError(source, "room_size", size, "three numbers")
    if min(size) <= 0 or max(size) > _LONGEST_SIDE:
        raise InputError(source, "room_size", size, f"metres, at most {_LONGEST_SIDE:g}")
    if not _is_number(about.get("floor_z")):
        raise InputError(source, "floor_z", about.get("floor_z"), "a number")


def _check_file(path: Path, wanted: object) -> None:
    if not path.is_file():
        raise InputError(path, "file", "missing", "a file of the scene folder")
    if (found := file_sha256(path)) != wanted:
        raise InputError(
            path, "sha256", found, f"{wanted} as scene.json says: the file was altered"
        )


def _check_mesh(source: Path, mesh: LabelledMesh, n_instances: int, floor_z: float) -> None:
    """Labels and instances exist, and the floor is there, horizontal, at its height."""
    if mesh.label.max(initial=0) >= N_CLASSES:
        raise InputError(
            source, "label", int(mesh.label.max()), f"mpcat40 classes below {N_CLASSES}"
        )
    if not mesh.label.any():
        raise InputError(source, "label", 0, "at least one vertex of a class other than void")
    if mesh.instance.min() < 0 or mesh.instance.max() >= n_instances:
        raise InputError(source, "instance", int(mesh.instance.max()), f"0 to {n_instances - 1}")
    floor = mesh.faces[(mesh.label[mesh.faces] == _FLOOR).all(axis=1)]
    if not len(floor):
        raise InputError(source, "label", "no floor", "triangles of class floor")
    a, b, c = mesh.vertices[floor].transpose(1, 0, 2).astype(np.float64)
    area = np.abs(np.cross(b - a, c - a)).sum(axis=0)
    if area[2] < 0.7 * area.sum():
        raise InputError(source, "up", "xyz"[int(area.argmax())], "z up: a horizontal floor")
    lowest = float(min(a[:, 2].min(), b[:, 2].min(), c[:, 2].min()))
    if abs(lowest - floor_z) > 0.05:
        raise InputError(source, "floor_z", floor_z, f"the height of the floor, {lowest:.3f}")


def _write_volumes(target: Path, volumes: Volumes) -> None:
    with atomic_path(target) as partial:
        np.savez_compressed(
            partial,
            schema_version=np.int64(SCHEMA_VERSION),
            sdf=volumes.sdf,
            thickened=volumes.thickened,
            label=volumes.label,
            origin=np.array(volumes.origin),
            cell=np.float64(volumes.cell),
            thickness=np.float64(volumes.thickness),
            convention=np.array(CONVENTION),
        )


def _read_volumes(source: Path) -> Volumes:
    try:
        with np.load(source, allow_pickle=False) as stored:
            entries = {name: stored[name] for name in stored.files}
        if int(entries["schema_version"]) != SCHEMA_VERSION:
            raise InputError(source, "schema_version", int(entries["schema_version"]), "1")
        if str(entries["convention"]) != CONVENTION:
            raise InputError(source, "convention", str(entries["convention"]), CONVENTION)
        x, y, z = (float(value) for value in entries["origin"])
        volumes = Volumes(
            sdf=entries["sdf"],
            thickened=entries["thickened"],
            label=entries["label"],
            origin=(x, y, z),
            cell=float(entries["cell"]),
            thickness=float(entries["thickness"]),
        )
    except KeyError as error:
        raise InputError(source, str(error.args[0]), "missing", "an entry of the archive") from None
    except (OSError, ValueError, TypeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(source, "content", str(error), "a volumes archive") from None
    for name, grid in (("sdf", volumes.sdf), ("thickened", volumes.thickened)):
        if grid.ndim != 3 or grid.shape != volumes.label.shape:
            raise InputError(source, name, grid.shape, "three axes, the same for all volumes")
        if not np.isfinite(grid).all():
            raise InputError(source, name, "not a number", "finite distances")
    return volumes


def _instance_record(instance: Instance) -> dict[str, Any]:
    return {**asdict(instance), "class": MPCAT40[instance.label]}


def _instance(folder: Path, record: Mapping[str, Any]) -> Instance:
    try:
        low, high = (tuple(float(v) for v in corner) for corner in record["aabb"])
        (x0, y0, z0), (x1, y1, z1) = low, high
        pose = {str(axis): float(value) for axis, value in record["pose"].items()}
        label = MPCAT40.index(record["class"])
        aabb = ((x0, y0, z0), (x1, y1, z1))
        return Instance(str(record["id"]), str(record["asset"]), label, pose, aabb)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            folder / _ABOUT, "instances", str(error), "id, asset, class, pose and aabb each"
        ) from None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from experiments.scene.ply import LabelledMesh, read_ply, write_ply
from experiments.scene.scene import Scene
from experiments.scene.scene_folder import read_parts, read_scene, write_scene
from experiments.scene.synthetic import synthetic_room
from renderer.files import InputError, file_sha256
from renderer.stage import StagePart


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PACE_CACHE", str(tmp_path_factory.mktemp("cache")))
        return synthetic_room(cell=0.2)


@pytest.fixture(scope="module")
def parts() -> tuple[StagePart, ...]:
    rng = np.random.default_rng(0)
    unit = np.broadcast_to(np.float32([0, 0, 1]), (4, 3, 3))
    floats = [rng.random((4, 3, 3), dtype=np.float32) for _ in range(4)]
    plain = StagePart(
        *(floats[0], unit, floats[1], floats[1][..., 0], "chair", "object:chair"),
        released={"object:wardrobe": floats[2][..., 0], "object:plant": floats[2][..., 1]},
    )
    textured = StagePart(
        *(floats[2], unit, np.ones_like(unit), floats[3][..., 0], "wall_n", "wall:n"),
        uv=floats[3][..., :2],
        texture=rng.integers(0, 256, (8, 16, 3), dtype=np.uint8),
        wall="n",
    )
    return (plain, textured)


@pytest.fixture
def folder(room: Scene, parts: tuple[StagePart, ...], tmp_path: Path) -> Path:
    write_scene(tmp_path / "room", room, parts, licence="CC0-1.0", credits=["A. Maker: chair"])
    return tmp_path / "room"


def change(folder: Path, **fields: object) -> None:
    about = json.loads((folder / "scene.json").read_text())
    (folder / "scene.json").write_text(json.dumps({**about, **fields}))


def reseal(folder: Path, name: str) -> None:
    about = json.loads((folder / "scene.json").read_text())
    change(folder, files={**about["files"], name: file_sha256(folder / name)})


def change_mesh(folder: Path, edit: Callable[[LabelledMesh], LabelledMesh]) -> None:
    write_ply(folder / "collision.ply", edit(read_ply(folder / "collision.ply")))
    reseal(folder, "collision.ply")


def test_a_scene_comes_back_as_it_was_written(room: Scene, folder: Path) -> None:
    back = read_scene(folder)
    for name in ("vertices", "faces", "vertex_label", "vertex_instance"):
        np.testing.assert_array_equal(getattr(back, name), getattr(room, name))
    for name in ("sdf", "thickened", "label"):
        np.testing.assert_array_equal(getattr(back.volumes, name), getattr(room.volumes, name))
    assert (back.instances, back.room_size, back.floor_z) == (
        *(room.instances, room.room_size, room.floor_z),
    )
    assert back.volumes.origin == room.volumes.origin and back.content_hash == room.content_hash


def test_the_drawn_parts_come_back(parts: tuple[StagePart, ...], folder: Path) -> None:
    for part, back in zip(parts, read_parts(folder), strict=True):
        assert (back.instance, back.group, back.wall) == (part.instance, part.group, part.wall)
        for name in ("corners", "normals", "occlusion"):
            np.testing.assert_array_equal(getattr(back, name), getattr(part, name))
        np.testing.assert_allclose(back.colours, part.colours, atol=1e-5)
        assert back.released.keys() == part.released.keys()
        for group in part.released:
            np.testing.assert_array_equal(back.released[group], part.released[group])
    textured = read_parts(folder)[1]
    assert textured.uv is not None and parts[1].uv is not None
    np.testing.assert_allclose(textured.uv, parts[1].uv, atol=1e-6)
    np.testing.assert_array_equal(textured.texture, parts[1].texture)


def test_other_programs_read_the_files(room: Scene, folder: Path) -> None:
    drawn = trimesh.load_scene(folder / "render.glb")
    assert len(drawn.geometry) == 2
    mesh = trimesh.load_mesh(folder / "collision.ply", process=False)
    np.testing.assert_allclose(mesh.vertices, room.vertices)
    np.testing.assert_array_equal(mesh.faces, room.faces)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("units", "cm"),
        ("up", "y"),
        ("schema_version", 9),
        ("room_size", [300.0, 300.0, 240.0]),
        ("room_size", [3.0, "wide", 2.4]),
        ("floor_z", 0.5),
        ("instances", [{"id": "floor"}]),
        ("content_hash", "0" * 64),
    ],
)
def test_a_wrong_entry_of_scene_json_is_named(folder: Path, field: str, value: object) -> None:
    change(folder, **{field: value})
    with pytest.raises(InputError) as caught:
        read_scene(folder)
    assert field in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["collision.ply", "render.glb", "volumes.npz"])
def test_an_altered_or_missing_file_is_named(folder: Path, name: str) -> None:
    content = bytearray((folder / name).read_bytes())
    content[-7] ^= 1
    (folder / name).write_bytes(content)
    with pytest.raises(InputError, match=f"{name}: sha256"):
        read_scene(folder)
    (folder / name).unlink()
    with pytest.raises(InputError, match=f"{name}: file.*missing"):
        read_scene(folder)


def no_floor(mesh: LabelledMesh) -> LabelledMesh:
    return LabelledMesh(
        mesh.vertices,
        mesh.faces,
        np.where(mesh.label == 2, 1, mesh.label).astype(np.uint8),
        mesh.instance,
    )


def y_up(mesh: LabelledMesh) -> LabelledMesh:
    return LabelledMesh(
        np.ascontiguousarray(mesh.vertices[:, [0, 2, 1]]), mesh.faces, mesh.label, mesh.instance
    )


def unlabelled(mesh: LabelledMesh) -> LabelledMesh:
    return LabelledMesh(mesh.vertices, mesh.faces, np.zeros_like(mesh.label), mesh.instance)


def not_a_number(mesh: LabelledMesh) -> LabelledMesh:
    return LabelledMesh(mesh.vertices * np.float32(np.nan), mesh.faces, mesh.label, mesh.instance)


def faceless(mesh: LabelledMesh) -> LabelledMesh:
    return LabelledMesh(mesh.vertices, mesh.faces[:0], mesh.label, mesh.instance)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (no_floor, "no floor"),
        (y_up, "z up: a horizontal floor"),
        (unlabelled, "class other than void"),
        (not_a_number, "finite coordinates"),
        (faceless, "faces: got 0"),
    ],
)
def test_a_mesh_without_what_a_scene_needs_is_refused(
    folder: Path, edit: Callable[[LabelledMesh], LabelledMesh], said: str
) -> None:
    change_mesh(folder, edit)
    with pytest.raises(InputError, match=said):
        read_scene(folder)


def test_a_ply_without_labels_or_cut_short_is_refused(tmp_path: Path) -> None:
    sound = LabelledMesh(
        np.eye(3, dtype=np.float32), np.int32([[0, 1, 2]]), np.uint8([2, 2, 2]), np.int32([0, 0, 0])
    )
    write_ply(tmp_path / "a.ply", sound)
    content = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "a.ply").write_bytes(content[:-3])
    with pytest.raises(InputError, match="size: got"):
        read_ply(tmp_path / "a.ply")
    (tmp_path / "a.ply").write_bytes(content.replace(b"uchar label", b"uchar lable"))
    with pytest.raises(InputError, match="label: got 'missing'"):
        read_ply(tmp_path / "a.ply")

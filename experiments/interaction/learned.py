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
STRIDE = 4
"""The samples are compared on every so many frames."""
MAX_TOUCHING = 2
"""Samples that touch and are offered."""
MAX_CLASSES = 4
"""Maps that are offered for one of them, differing in the class that is touched most."""
LEAST_TOUCH = 3
"""As many vertices off the feet, for `LEAST_TIME` of the clip, make a touch."""
LEAST_TIME = 0.1
LEAST_SHARE = 0.05
"""Where the scene's classes are together less likely than this, what is to be touched is not there."""
LEAST_RIVAL = 0.01
"""A class less likely than this is no alternative even where the scene has no other."""
RIVAL_SHARE = 0.15
"""A class with this much of the probability of the scene's likeliest is an alternative."""
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
        "4a59341bba45ad29da0faff91894ba31d319e1aed159aa30fe3a67b47daa1d79",
    ),
    "learned_5cm": (
        "posa_5cm.safetensors",
        "33cce1194f1d62352d4415f537637fc210ba85078423b3e13a99a3a4793f252f",
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


@dataclass(frozen=True)
class PriorSamples:
    """Maps of one clip for several z. Axes: K samples, S strided frames, V vertices."""

    codes: Float[Tensor, "K Z"]
    contact: Bool[np.ndarray, "K S V"]
    class_share: Float[np.ndarray, "S V 42"]
    """p(class | body, contact), mean over the samples."""


def learned_features(
    motion: Motion, body: BodyModel, scene_classes: Sequence[str], model: str = "learned"
) -> tuple[InteractionFeatures, ...]:
    """Feature maps of a motion by a shipped network (`SHIPPED`), in the order to try them in.

    Every map has one z for the whole clip. If prior samples let the clip touch more than the floor,
    those come first that touch most like the others do, each with other classes as alternatives, and
    z = 0, which is cautious, comes last; else z = 0 is all. Classes are those that the scene has.
    Raises `InputError` for weights or a body that do not fit.
    """
    network, note = shipped_network(model)
    frames = body_frames(motion, body)
    if vertex_hash(frames.vertex_ids) != note.vertex_sha256:
        wanted = "an embedded body (the network knows their vertices only)"
        raise InputError(f"interaction model {model}", "body", body.name, wanted)
    step = float(np.median(np.diff(motion.times)))
    sigma, gap = SMOOTHING_S / step, round(LONGEST_GAP_S / step)
    samples = prior_samples(network, frames)
    codes = [*touching_codes(network, samples), torch.zeros(network.shape.latent)]
    maps: list[InteractionFeatures] = []
    for z in codes:
        logits = decode_clip(network, frames, z, sigma)
        contact = expit(logits.contact).astype(np.float32)
        scores = class_scores(network, logits, scene_classes)
        scores = one_class_a_touch(network, contact > 0.5, scores, gap)
        share = samples.class_share
        for semantics in class_alternatives(contact > 0.5, scores, share, scene_classes):
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


def prior_samples(network: ContactNetwork, frames: BodyFrames) -> PriorSamples:
    """`SAMPLES` maps of a clip with one z each, on every `STRIDE`-th frame."""
    drawn = np.random.default_rng(SEED).standard_normal((SAMPLES, network.shape.latent))
    codes = torch.as_tensor(drawn, dtype=torch.float32)
    few = frames.every(STRIDE)
    share = np.zeros((*few.height.shape, N_CLASSES), dtype=np.float32)
    contacts = []
    for z in codes:
        logits = decode_clip(network, few, z, 0.0)
        contacts.append(logits.contact > 0)
        share[..., list(network.shape.classes[1:])] += (
            softmax(logits.classes[..., 1:], axis=-1) / SAMPLES
        )
    return PriorSamples(codes, np.stack(contacts), share)


def touching_codes(network: ContactNetwork, samples: PriorSamples) -> list[Float[Tensor, " Z"]]:
    """Up to `MAX_TOUCHING` samples that touch with more than the feet, the most central ones, all unlike.

    Central is the highest mean overlap (intersection over union) with the other samples that touch:
    of all simple choices it was the best on held-out clips, where the sample that touches most
    exaggerates. Empty where fewer than a tenth of the samples touch.
    """
    off_feet = ~np.isin(network.get_buffer("parts").numpy(), FEET)
    touched = samples.contact & off_feet
    touches = (touched.sum(-1) >= LEAST_TOUCH).mean(-1) >= LEAST_TIME
    if touches.mean() < 0.1:
        return []
    those = np.flatnonzero(touches)
    alike = np.array([[overlap(touched[one], touched[other]) for other in those] for one in those])
    chosen: list[int] = []
    for place in np.argsort(-alike.mean(1), kind="stable").tolist():
        if all(alike[place, other] < ALIKE for other in chosen):
            chosen.append(place)
    return [samples.codes[those[place]] for place in chosen[:MAX_TOUCHING]]


def overlap(one: Bool[np.ndarray, "T V"], other: Bool[np.ndarray, "T V"]) -> float:
    """Intersection over union."""
    return float((one & other).sum() / max(1, (one | other).sum()))


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
        spans, count = label_spans(_bridged(np.any(touch, axis=1), gap))
        for span in range(1, count + 1):
            there = touch & (spans == span)[:, None]
            share = softmax(scores[there].astype(np.float64), axis=-1).mean(0)
            scores[there] = _raised(scores[there], indices[int(share[indices].argmax())])
    return scores


def class_alternatives(
    contact: Bool[np.ndarray, "T V"],
    scores: Float[np.ndarray, "T V 42"],
    class_share: Float[np.ndarray, "S V 42"],
    scene_classes: Sequence[str],
) -> list[Float[np.ndarray, "T V 42"]]:
    """The scores, and the same with the leading class of touch (`_leading`) traded for its rivals.

    A rival is a class of the scene, not floor, about as likely at those vertices (`RIVAL_SHARE`) by
    `class_share`, p(class | body) over prior samples on every `STRIDE`-th frame; all vertices change
    together, so that one does not sit on two things.
    """
    label = np.where(contact, scores.argmax(-1), 0)
    leading = _leading(np.bincount(label.ravel(), minlength=N_CLASSES))
    if leading is None:
        return [scores]
    there = label == leading
    touched = there[::STRIDE]
    share = class_share[touched].mean(0) if touched.any() else np.zeros(N_CLASSES)
    present = np.array([name in scene_classes for name in MPCAT40])
    present[[0, leading, FLOOR]] = False
    best = max(
        share[present].max(initial=0.0), share[leading] * (MPCAT40[leading] in scene_classes)
    )
    likely = present & (share >= max(RIVAL_SHARE * best, LEAST_RIVAL))
    maps = [scores]
    for rival in np.argsort(-share, kind="stable").tolist():
        if likely[rival] and len(maps) < MAX_CLASSES:
            traded = scores.copy()
            traded[there] = _raised(traded[there], rival)
            maps.append(traded)
    return maps


def _leading(counts: Integer[np.ndarray, "42"]) -> int | None:
    """The class touched most among seats and beds, then what hands are on, then all but the floor."""
    every = tuple(name for name in MPCAT40 if name not in ("void", "floor"))
    for classes in (*(classes for classes, _ in SUPPORTS), every):
        indices = [MPCAT40.index(name) for name in classes]
        if counts[indices].any():
            return indices[int(counts[indices].argmax())]
    return None


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

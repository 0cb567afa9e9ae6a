"""Simple predictors that a learned model of contact has to beat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8

from experiments.body.embedded import load_body
from experiments.interaction.contact_dataset import ContactDataset
from experiments.interaction.contact_scores import f1_score
from experiments.interaction.geometric import geometric_features
from experiments.motion.motion import Motion
from experiments.scene.scene import MPCAT40

FLOOR = MPCAT40.index("floor")
_EVERY = 4
"""The nearest body is sought on every fourth vertex: it is the same one."""
_BATCH = 512


@dataclass(frozen=True)
class Prediction:
    """Contact and classes predicted for the bodies of a data set."""

    name: str
    probability: Float[np.ndarray, "N V"]
    """Of contact; the prediction is contact from one half on."""
    classes: UInt8[np.ndarray, "N V"]
    """The best mpcat40 class that is not void."""

    @property
    def contact(self) -> Bool[np.ndarray, "N V"]:
        """Predicted contact."""
        return self.probability >= 0.5


def baselines(train: ContactDataset, test: ContactDataset, thickness_m: float) -> list[Prediction]:
    """All baselines that need nothing but the data."""
    return [
        constant_map(train, test, thickness_m),
        vertex_frequency(train, test, thickness_m),
        height_rule(test, thickness_m),
        nearest_body(train, test, thickness_m),
    ]


def constant_map(train: ContactDataset, test: ContactDataset, thickness_m: float) -> Prediction:
    """What touches in more than half of the training bodies always touches, and it is the floor."""
    contact, _ = train.labels(thickness_m)
    shape = test.height.shape
    chosen = np.where(contact.mean(0) > 0.5, np.float32(1), np.float32(0))
    return Prediction(
        "constant map", np.broadcast_to(chosen, shape), np.full(shape, FLOOR, dtype=np.uint8)
    )


def vertex_frequency(train: ContactDataset, test: ContactDataset, thickness_m: float) -> Prediction:
    """How often each vertex touches in training, cut where training F1 is best; its commonest class."""
    contact, classes = train.labels(thickness_m)
    share = contact.mean(0)
    cuts = np.linspace(0.02, 0.6, 30)
    scores = [f1_score(np.broadcast_to(share > cut, contact.shape), contact) for cut in cuts]
    best = float(cuts[int(np.argmax(scores))])
    # The cut becomes one half, so that the order of the vertices is kept.
    moved = np.where(share > best, 0.5 + (share - best) / 2 / (1 - best), share / best * 0.499)
    common = np.array([_commonest(column) for column in classes.T], dtype=np.uint8)
    shape = test.height.shape
    return Prediction(
        "per-vertex frequency",
        np.broadcast_to(moved.astype(np.float32), shape),
        np.broadcast_to(common, shape),
    )


def height_rule(test: ContactDataset, thickness_m: float) -> Prediction:
    """Whatever is lower than the thickness above the clip's floor stands on the floor."""
    height = np.maximum(test.height.astype(np.float32), 0)
    shape = test.height.shape
    probability = np.exp2(-height / np.float32(thickness_m))
    return Prediction("height rule", probability, np.full(shape, FLOOR, dtype=np.uint8))


def nearest_body(train: ContactDataset, test: ContactDataset, thickness_m: float) -> Prediction:
    """The labels of the training body with the nearest vertices."""
    contact, classes = train.labels(thickness_m)
    known = train.vertices[:, ::_EVERY].reshape(len(contact), -1).astype(np.float32)
    asked = test.vertices[:, ::_EVERY].reshape(len(test.clip), -1).astype(np.float32)
    squares = (known**2).sum(1)
    found = [
        (squares - 2 * asked[start : start + _BATCH] @ known.T).argmin(1)
        for start in range(0, len(asked), _BATCH)
    ]
    rows = np.concatenate(found)
    filled = np.where(contact[rows], classes[rows], np.uint8(FLOOR))
    return Prediction("nearest body", contact[rows].astype(np.float32), filled)


def geometric_rule(test: ContactDataset, motions: dict[str, Motion]) -> Prediction:
    """The rule `geometric`, its most likely map, on the whole motion of every test clip.

    `motions` are the clips' motions by name. It has one thickness of its own, whatever the labels'.
    """
    probability = np.zeros(test.height.shape, dtype=np.float32)
    classes = np.full(test.height.shape, FLOOR, dtype=np.uint8)
    for number, record in enumerate(test.clips):
        rows = np.flatnonzero(test.clip == number)
        if not len(rows):
            continue
        motion = motions[record.name]
        features = geometric_features(motion, load_body(motion.body), MPCAT40)[0]
        frames = test.frame[rows]
        probability[rows] = features.contact[frames]
        named = features.semantics[frames].argmax(-1).astype(np.uint8)
        classes[rows] = np.where(named > 0, named, np.uint8(FLOOR))
    return Prediction("geometric rule", probability, classes)


def two_scenes(test: ContactDataset, second: ContactDataset, thickness_m: float) -> tuple[
    Prediction, Bool[np.ndarray, " N"]
]:  # fmt: skip
    """The labels of another scene drawn for the same bodies, and for which bodies there is one.

    No model can agree with the truth much better than two scenes for one pose agree.
    """
    contact, classes = second.labels(thickness_m)
    place = {_key(second, row): row for row in range(len(second.clip))}
    rows = np.array([place.get(_key(test, row), -1) for row in range(len(test.clip))])
    filled = np.where(contact[rows], classes[rows], second.nearest[rows])
    return Prediction(
        "another scene (ceiling)", contact[rows].astype(np.float32), filled
    ), rows >= 0


def _key(data: ContactDataset, row: int) -> tuple[str, int]:
    return data.clips[int(data.clip[row])].name, int(data.frame[row])


def _commonest(classes: UInt8[np.ndarray, " N"]) -> int:
    """The commonest class of a vertex's contacts; floor where it never touches."""
    counts = np.bincount(classes, minlength=len(MPCAT40))
    counts[0] = 0
    return int(counts.argmax()) if counts.any() else FLOOR

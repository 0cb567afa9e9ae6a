"""The report on a model of contact: its scores beside the baselines, captured and authored apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, Integer

from experiments.body.embedded import load_body
from experiments.body.model import JOINT_NAMES
from experiments.interaction.contact_baselines import (
    Prediction,
    baselines,
    geometric_rule,
    two_scenes,
)
from experiments.interaction.contact_dataset import ContactDataset
from experiments.interaction.contact_scores import (
    active_units,
    average_precision,
    calibration_error,
    class_accuracy,
    diversity,
    f1_score,
    flicker,
    intersection_over_union,
)
from experiments.motion.motion import Motion

SAMPLES = 20
STRIDE = 3
"""Scores count every third frame of the test clips; flicker counts all."""


@runtime_checkable
class ContactModel(Protocol):
    """A conditional generative model, as the report asks it."""

    name: str

    def at_zero(self, data: ContactDataset) -> Prediction:
        """Its map for z = 0."""
        ...

    def sample(self, data: ContactDataset, seed: int) -> Prediction:
        """One map of the prior: one z a clip."""
        ...

    def posterior(
        self, data: ContactDataset, thickness_m: float
    ) -> tuple[Prediction, Float[np.ndarray, "N L"]]:
        """The map decoded from the posterior mean of the true labels, and those means."""
        ...


@dataclass(frozen=True)
class ReportRow:
    """Scores of one method on one part of the test data. Not a number: does not apply."""

    thickness_cm: float
    test_set: str
    """`fitted` (supports built to the clips) or `free` (clips placed in furnished rooms)."""
    kind: str
    """`captured`, `authored` or `all`."""
    method: str
    bodies: int
    f1: float
    f1_feet: float
    f1_rest: float
    """Vertices that are not on the feet."""
    iou: float
    ap: float
    ap_rest: float
    class_top1: float
    class_top1_rest: float
    calibration_error: float
    flicker: float
    frames_with_contact: float
    """Share of the bodies with any predicted contact."""
    f1_samples: float = float("nan")
    """Mean over prior samples."""
    f1_best_sample: float = float("nan")
    """With the best of the samples for every clip."""
    f1_posterior: float = float("nan")
    gap: float = float("nan")
    """`f1_posterior` less `f1_samples`: large where the prior is not where the data lie."""
    diversity: float = float("nan")
    active_units: float = float("nan")


@dataclass(frozen=True)
class TestSets:
    """What a report is made on."""

    __test__ = False

    train: ContactDataset
    fitted: ContactDataset
    """Held-out clips, supports built to them."""
    second: ContactDataset
    """The same clips in other scenes."""
    free: ContactDataset
    """Held-out clips placed in furnished rooms."""
    motions: dict[str, Motion]
    """The motion of every held-out clip."""


def report(
    models: Sequence[ContactModel], sets: TestSets, thickness_m: float, seed: int = 0
) -> list[ReportRow]:
    """Rows for every model, baseline, test set and kind of clip, at one label thickness."""
    rows: list[ReportRow] = []
    for name, data in (("fitted", sets.fitted), ("free", sets.free)):
        simple = [*baselines(sets.train, data, thickness_m), geometric_rule(data, sets.motions)]
        everything = np.ones(len(data.clip), dtype=bool)
        predictions = [(prediction, everything) for prediction in simple]
        if name == "fitted":
            predictions.append(two_scenes(data, sets.second, thickness_m))
        for kind, chosen in _kinds(data):
            part = _blank(thickness_m, name, kind)
            for prediction, known in predictions:
                rows.append(score(prediction, data, thickness_m, chosen & known, part))
            for model in models:
                rows.append(model_row(model, data, thickness_m, chosen, part, seed))
    return rows


def model_row(
    model: ContactModel,
    data: ContactDataset,
    thickness_m: float,
    chosen: Bool[np.ndarray, " N"],
    part: ReportRow,
    seed: int,
) -> ReportRow:
    """Scores of a learned model at z = 0 and what its latent code does besides."""
    kept = data.select(chosen)
    zero = model.at_zero(kept)
    row = score(zero, kept, thickness_m, np.ones(len(kept.clip), dtype=bool), part)
    thin = kept.select(kept.frame % STRIDE == 0)
    true, _ = thin.labels(thickness_m)
    samples = np.stack([model.sample(thin, seed + index).contact for index in range(SAMPLES)])
    posterior, means = model.posterior(thin, thickness_m)
    prior = float(np.mean([f1_score(sample, true) for sample in samples]))
    fitted = f1_score(posterior.contact, true)
    return replace(
        row,
        f1_samples=prior,
        f1_best_sample=best_of_samples(samples, true, thin.clip),
        f1_posterior=fitted,
        gap=fitted - prior,
        diversity=diversity(samples),
        active_units=float(active_units(means)),
    )


def score(
    prediction: Prediction,
    data: ContactDataset,
    thickness_m: float,
    chosen: Bool[np.ndarray, " N"],
    part: ReportRow,
) -> ReportRow:
    """Scores of one prediction on the bodies chosen."""
    thin = chosen & (data.frame % STRIDE == 0)
    true, classes = data.labels(thickness_m)
    found, true_thin = prediction.contact[thin], true[thin]
    probability = prediction.probability[thin].astype(np.float64)
    feet = foot_columns(data.vertex_ids)
    named, true_named = prediction.classes[thin], classes[thin]
    rest = ~feet
    return replace(
        part,
        method=prediction.name,
        bodies=int(thin.sum()),
        f1=f1_score(found, true_thin),
        f1_feet=f1_score(found[:, feet], true_thin[:, feet]),
        f1_rest=f1_score(found[:, rest], true_thin[:, rest]),
        iou=intersection_over_union(found, true_thin),
        ap=average_precision(probability, true_thin),
        ap_rest=average_precision(probability[:, rest], true_thin[:, rest]),
        class_top1=class_accuracy(named, true_named, true_thin),
        class_top1_rest=class_accuracy(named[:, rest], true_named[:, rest], true_thin[:, rest]),
        calibration_error=calibration_error(probability, true_thin),
        flicker=flicker(prediction.contact[chosen], data.clip[chosen], data.frame[chosen]),
        frames_with_contact=float(found.any(1).mean()) if thin.any() else float("nan"),
    )


def best_of_samples(
    samples: Bool[np.ndarray, "S N V"],
    true: Bool[np.ndarray, "N V"],
    clip: Integer[np.ndarray, " N"],
) -> float:
    """F1 over all bodies when every clip takes its best sample."""
    best = np.zeros_like(true)
    for number in np.unique(clip):
        rows = clip == number
        scores = [f1_score(sample[rows], true[rows]) for sample in samples]
        best[rows] = samples[int(np.argmax(scores))][rows]
    return f1_score(best, true)


def report_table(rows: Sequence[ReportRow]) -> str:
    """The rows as Markdown, a table for every thickness, test set and kind."""
    blocks = dict.fromkeys((row.thickness_cm, row.test_set, row.kind) for row in rows)
    return "\n\n".join(_block(rows, *block) for block in blocks) + "\n"


def report_records(rows: Sequence[ReportRow]) -> list[dict[str, object]]:
    """The rows as JSON-able records; None where a score does not apply."""
    return [
        {key: None if value != value else value for key, value in asdict(row).items()}
        for row in rows
    ]


def foot_columns(vertex_ids: Integer[np.ndarray, " V"]) -> Bool[np.ndarray, " V"]:
    """Mask of the feature vertices whose nearest joint, in the zero pose, is an ankle or a toe joint."""
    zero = torch.zeros(1, 22, 3)
    rest = load_body().posed(zero, zero[:, 0], vertex_ids)
    gap = (rest.vertices[0][:, None] - rest.joints[0][None]).norm(dim=-1)
    part = np.array(JOINT_NAMES)[gap.argmin(1).numpy()]
    return np.isin(part, ("left_ankle", "right_ankle", "left_foot", "right_foot"))


def _kinds(data: ContactDataset) -> Iterator[tuple[str, Bool[np.ndarray, " N"]]]:
    for kind in ("captured", "authored"):
        chosen = data.bodies_of(kind=kind)
        if chosen.any():
            yield kind, chosen
    yield "all", np.ones(len(data.clip), dtype=bool)


def _blank(thickness_m: float, test_set: str, kind: str) -> ReportRow:
    scores = {entry.name: float("nan") for entry in fields(ReportRow)[5:]}
    return ReportRow(100 * thickness_m, test_set, kind, "", 0, **scores)


def _block(rows: Sequence[ReportRow], thickness_cm: float, test_set: str, kind: str) -> str:
    names = [entry.name for entry in fields(ReportRow)][5:]
    heading = f"**{test_set} test set, {kind} clips, labels of {thickness_cm:g} cm**"
    lines = [heading, "", "| method | " + " | ".join(n.replace("_", " ") for n in names) + " |"]
    lines.append("|---" * (len(names) + 1) + "|")
    for row in rows:
        if (row.thickness_cm, row.test_set, row.kind) == (thickness_cm, test_set, kind):
            values = [_shown(getattr(row, name)) for name in names]
            lines.append(f"| {row.method} | " + " | ".join(values) + " |")
    return "\n".join(lines)


def _shown(value: float) -> str:
    return "" if value != value else f"{value:.3g}" if abs(value) >= 10 else f"{value:.2f}"

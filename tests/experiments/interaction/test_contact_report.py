"""The data set's file, the baselines and the report, on small random bodies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.body.embedded import load_body
from experiments.interaction.contact_baselines import (
    Prediction,
    constant_map,
    geometric_rule,
    height_rule,
    nearest_body,
    two_scenes,
    vertex_frequency,
)
from experiments.interaction.contact_dataset import ClipRecord, ContactDataset
from experiments.interaction.contact_report import (
    ReportRow,
    TestSets,
    best_of_samples,
    foot_columns,
    report,
    report_records,
    report_table,
)
from experiments.interaction.contact_scores import f1_score
from experiments.interaction.geometric import geometric_features
from experiments.interaction.mesh import feature_vertices
from experiments.motion.library import load_motion
from experiments.motion.resample import window
from experiments.scene.scene import MPCAT40
from renderer.files import InputError


class Oracle:
    """A model whose maps are the truth, whatever its code."""

    name = "oracle"

    def __init__(self, thickness_m: float) -> None:
        self.thickness_m = thickness_m

    def at_zero(self, data: ContactDataset) -> Prediction:
        contact, classes = data.labels(self.thickness_m)
        return Prediction(self.name, contact.astype(np.float32), np.maximum(classes, np.uint8(1)))

    def sample(self, data: ContactDataset, seed: int) -> Prediction:
        return self.at_zero(data)

    def posterior(self, data: ContactDataset, thickness_m: float) -> tuple[Prediction, np.ndarray]:
        return self.at_zero(data), np.zeros((len(data.clip), 4))


def test_a_data_set_survives_its_file(tmp_path: Path, train_bodies: ContactDataset) -> None:
    train_bodies.save(tmp_path / "set.npz")
    read = ContactDataset.load(tmp_path / "set.npz")
    assert read.clips == train_bodies.clips
    for name in ("vertex_ids", "vertices", "height", "distance", "nearest", "clip", "frame"):
        assert np.array_equal(getattr(read, name), getattr(train_bodies, name))


def test_a_file_that_is_no_data_set_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "set.npz").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"set\.npz: content"):
        ContactDataset.load(tmp_path / "set.npz")
    np.savez(tmp_path / "old.npz", schema_version=0)
    with pytest.raises(InputError, match="schema_version"):
        ContactDataset.load(tmp_path / "old.npz")


def test_labels_are_what_is_near_and_void_elsewhere(train_bodies: ContactDataset) -> None:
    contact, classes = train_bodies.labels(0.02)
    assert np.array_equal(contact, train_bodies.distance < np.float16(0.02))
    assert np.array_equal(classes[contact], train_bodies.nearest[contact])
    assert not classes[~contact].any()
    assert contact.sum() < train_bodies.labels(0.05)[0].sum()


def test_bodies_are_selected_by_the_fields_of_their_clip(train_bodies: ContactDataset) -> None:
    assert train_bodies.bodies_of(kind="captured").nonzero()[0].tolist() == list(range(8))
    chosen = train_bodies.select(train_bodies.bodies_of(family="stand"))
    assert set(chosen.clip.tolist()) == {1}


def test_the_height_rule_is_contact_below_the_thickness(test_bodies: ContactDataset) -> None:
    rule = height_rule(test_bodies, 0.05)
    assert np.array_equal(rule.contact, test_bodies.height <= np.float16(0.05))
    assert (rule.classes == 2).all()


def test_the_nearest_body_of_the_training_bodies_themselves_is_each_its_own(
    train_bodies: ContactDataset,
) -> None:
    contact, classes = train_bodies.labels(0.05)
    found = nearest_body(train_bodies, train_bodies, 0.05)
    assert np.array_equal(found.contact, contact)
    assert np.array_equal(found.classes[contact], classes[contact])


def test_frequency_is_cut_where_it_explains_its_training_bodies_best(
    train_bodies: ContactDataset,
) -> None:
    always = np.zeros((24, 6), dtype=np.float16)
    always[:, 3:] = 0.5
    data = replace(train_bodies, distance=always)
    found = vertex_frequency(data, data, 0.02)
    assert np.array_equal(found.contact, data.labels(0.02)[0])
    assert np.array_equal(constant_map(data, data, 0.02).contact, found.contact)


def test_the_order_of_frequencies_is_kept_by_the_cut(train_bodies: ContactDataset) -> None:
    share = train_bodies.labels(0.05)[0].mean(0)
    found = vertex_frequency(train_bodies, train_bodies, 0.05).probability[0]
    assert np.array_equal(np.argsort(found, kind="stable"), np.argsort(share, kind="stable"))


def test_another_scene_is_matched_by_clip_and_frame(test_bodies: ContactDataset) -> None:
    order = np.random.default_rng(0).permutation(24)[:20]
    second = replace(test_bodies.select(np.isin(np.arange(24), order)))
    found, known = two_scenes(test_bodies, second, 0.05)
    assert set(np.flatnonzero(known)) == set(order.tolist())
    assert np.array_equal(found.contact[known], test_bodies.labels(0.05)[0][known])


def test_the_geometric_rule_is_that_of_the_whole_motion() -> None:
    motion = window(load_motion("sit_stay_stand"), 30, 130)
    ids = feature_vertices(load_body())
    shape = (2, len(ids))
    data = ContactDataset(
        ids, np.zeros((*shape, 3), np.float16), np.zeros(shape, np.float16),
        np.zeros(shape, np.float16), np.zeros(shape, np.uint8), np.zeros(2, np.int64),
        np.array([5, 95]), (ClipRecord("sit", "authored", "test", "male_slim", 0, "sit"),),
    )  # fmt: skip
    found = geometric_rule(data, {"sit": motion})
    assert set(np.unique(found.classes[0])) == {2}
    whole = geometric_features(motion, load_body(), MPCAT40)[0]
    assert np.array_equal(found.contact, whole.contact[[5, 95]] > 0)
    assert set(np.unique(found.classes[1][found.contact[1]])) > {2}


def test_every_clip_takes_its_best_sample() -> None:
    true = np.array([[True, False], [False, True]])
    samples = np.stack([np.array([[True, False], [True, False]]), np.array([[False, True]] * 2)])
    assert best_of_samples(samples, true, np.array([0, 1])) == pytest.approx(1.0)
    assert f1_score(samples[0], true) == pytest.approx(0.5)


def test_feet_are_soles_and_no_hands() -> None:
    body = load_body()
    ids = feature_vertices(body)
    feet = foot_columns(ids)
    assert feet[np.isin(ids, body.regions["left_sole"])].all()
    assert not feet[np.isin(ids, body.regions["left_hand"])].any()


@pytest.fixture
def report_rows(monkeypatch: pytest.MonkeyPatch, train_bodies: ContactDataset,
                test_bodies: ContactDataset) -> list[ReportRow]:  # fmt: skip
    module = "experiments.interaction.contact_report"
    feet = np.arange(6) < 2
    monkeypatch.setattr(f"{module}.foot_columns", lambda ids: feet)
    monkeypatch.setattr(f"{module}.geometric_rule", lambda data, motions: height_rule(data, 0.05))
    sets = TestSets(train_bodies, test_bodies, test_bodies, test_bodies, {})
    return report([Oracle(0.05)], sets, 0.05)


def test_an_oracle_scores_one_everywhere_and_has_no_gap(report_rows: list[ReportRow]) -> None:
    rows = [row for row in report_rows if row.method == "oracle"]
    assert {(row.test_set, row.kind) for row in rows} == {
        (part, kind) for part in ("fitted", "free") for kind in ("captured", "authored", "all")
    }
    for row in rows:
        perfect = (row.f1, row.f1_feet, row.f1_rest, row.iou, row.ap, row.class_top1)
        assert perfect == (1.0,) * 6
        assert (row.gap, row.diversity, row.active_units) == (0.0, 0.0, 0.0)
        assert (row.calibration_error, row.f1_best_sample) == (0.0, 1.0)


def test_every_baseline_stands_beside_the_model(report_rows: list[ReportRow]) -> None:
    names = {row.method for row in report_rows if row.test_set == "fitted"}
    assert len(names) == 6  # the stand-in of the rule bears the height rule's name
    assert "another scene (ceiling)" in names
    assert "another scene (ceiling)" not in {r.method for r in report_rows if r.test_set == "free"}


def test_the_table_names_thickness_set_and_kind(report_rows: list[ReportRow]) -> None:
    table = report_table(report_rows)
    assert table.count("labels of 5 cm") == 6
    assert "**fitted test set, captured clips, labels of 5 cm**" in table
    assert "| oracle | 1.00 | 1.00 |" in table


def test_what_does_not_apply_is_empty_and_null(report_rows: list[ReportRow]) -> None:
    baseline = next(row for row in report_rows if row.method == "height rule")
    record = report_records([baseline])[0]
    assert record["gap"] is None
    assert "nan" not in report_table([baseline])

from __future__ import annotations

import numpy as np
import pytest
import torch

from experiments.interaction import learned
from experiments.interaction.feature_mesh import PART_NAMES
from experiments.interaction.learned import (
    SHIPPED,
    ContactLogits,
    PriorSamples,
    class_alternatives,
    class_scores,
    learned_features,
    one_class_a_touch,
    shipped_network,
    touching_codes,
)
from experiments.interaction.registry import INTERACTIONS
from experiments.scene.scene import MPCAT40
from renderer.files import InputError

EVERYTHING = MPCAT40[1:]
CHAIR, SOFA, BED, FLOOR, TABLE = (
    MPCAT40.index(name) for name in ("chair", "sofa", "bed", "floor", "table")
)


@pytest.fixture(scope="module")
def network():
    return shipped_network("learned")[0]


def part(network, name: str) -> np.ndarray:
    return np.flatnonzero(network.get_buffer("parts").numpy() == PART_NAMES.index(name))


def logits_of(network, contact: float, **chances: float) -> ContactLogits:
    """The same contact and class logits for 4 frames and all vertices."""
    classes = np.full((4, 703, network.shape.n_classes), -20.0, dtype=np.float32)
    for name, chance in chances.items():
        classes[..., network.shape.classes.index(MPCAT40.index(name))] = np.log(chance)
    return ContactLogits(np.full((4, 703), contact, dtype=np.float32), classes)


def scores_with(label: dict[str, int], network, frames: int = 6) -> np.ndarray:
    scores = np.full((frames, 703, 42), -5.0, dtype=np.float32)
    scores[..., FLOOR] = 0.0
    for name, index in label.items():
        scores[:, part(network, name), index] = 1.0
    return scores


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_shipped_weights_are_those_of_the_code_and_of_the_label_thickness_they_name(name) -> None:
    network, note = shipped_network(name)
    assert note.thickness_m == (0.05 if name.endswith("5cm") else 0.02)
    assert network.shape.architecture == "point" and network.shape.classes[0] == 0
    assert name in INTERACTIONS


def test_a_stander_touches_the_floor_with_the_feet_and_nothing_else(sit, slim, network) -> None:
    maps = learned_features(sit(40, stand=1.0), slim, EVERYTHING)
    touching = maps[0].contact > 0.5
    feet = np.union1d(part(network, "left_foot"), part(network, "right_foot"))
    assert len(maps) == 1
    assert np.isin(np.flatnonzero(touching.any(0)), feet).all()
    assert (touching.sum(1) >= 10).all()
    assert set(maps[0].semantics.argmax(-1)[touching]) == {FLOOR}


def test_a_sitter_touches_a_seat_and_one_map_wants_the_one_seat_that_the_scene_has(
    sit, slim, network
) -> None:
    maps = learned_features(sit(60), slim, ("floor", "wall", "sofa"))
    seat = part(network, "seat")
    wanted = []
    for features in maps:
        on_seat = features.contact[50:, seat] > 0.5
        assert on_seat.sum(1).min() >= 5
        wanted.append(set(features.semantics[50:, seat].argmax(-1)[on_seat]))
    assert {SOFA} in wanted and {FLOOR} not in wanted
    assert not (maps[0].contact[:20, seat] > 0.5).any()


def test_the_same_motion_gets_the_same_maps_wherever_it_stands_and_faces(sit, slim) -> None:
    from experiments.placement.rigid import move_motion

    motion = sit(40)
    moved = move_motion(motion, slim, 2.1, np.array([3.0, -2.0, 0.7]), np.zeros(2))
    here, again, there = (
        learned_features(item, slim, EVERYTHING) for item in (motion, motion, moved)
    )
    assert all(np.array_equal(a.contact, b.contact) for a, b in zip(here, again, strict=True))
    assert np.mean((here[0].contact > 0.5) != (there[0].contact > 0.5)) < 2e-3


def test_void_wins_exactly_where_contact_is_below_one_half(network) -> None:
    logits = logits_of(network, 0.0, floor=0.7, chair=0.3)
    logits.contact[0], logits.contact[1] = -0.1, 0.1
    label = class_scores(network, logits, EVERYTHING).argmax(-1)
    assert (label[0] == 0).all() and (label[1] == FLOOR).all()


def test_a_class_that_the_scene_lacks_gives_way_to_the_next_unless_that_is_unlikely(
    network,
) -> None:
    likely = logits_of(network, 1.0, chair=0.8, sofa=0.15, floor=0.05)
    assert (class_scores(network, likely, ("floor", "sofa")).argmax(-1) == SOFA).all()
    # Only the floor is there, and nobody sits on it: the chair is kept, and no start will be found.
    unlikely = logits_of(network, 1.0, chair=0.97, floor=0.03)
    assert (class_scores(network, unlikely, ("floor",)).argmax(-1) == CHAIR).all()


def test_who_sits_down_on_a_bed_and_lies_on_it_sat_on_a_bed(network) -> None:
    scores = scores_with({"seat": CHAIR, "back": BED, "left_hand": TABLE}, network)
    contact = np.zeros((6, 703), dtype=bool)
    contact[:2, part(network, "seat")] = True
    contact[3:, part(network, "back")] = True
    contact[:, part(network, "left_hand")] = True
    contact[:, part(network, "left_foot")] = True
    label = one_class_a_touch(network, contact, scores, gap=1).argmax(-1)
    assert (label[:2, part(network, "seat")] == BED).all()
    assert (label[3:, part(network, "back")] == BED).all()
    assert (label[:, part(network, "left_hand")] == TABLE).all()
    assert (label[:, part(network, "left_foot")] == FLOOR).all()
    apart = one_class_a_touch(network, contact, scores, gap=0).argmax(-1)
    assert (apart[:2, part(network, "seat")] == CHAIR).all()


def test_rivals_of_the_leading_class_are_those_of_the_scene_that_are_about_as_likely(
    network,
) -> None:
    scores = scores_with({"seat": CHAIR}, network)
    contact = np.zeros((6, 703), dtype=bool)
    contact[:, part(network, "seat")] = True
    share = np.zeros((2, 703, 42), dtype=np.float32)
    share[..., [CHAIR, SOFA, BED, TABLE]] = 0.6, 0.25, 0.12, 0.03
    maps = class_alternatives(contact, scores, share, ("floor", "chair", "bed", "table"))
    seat = part(network, "seat")
    assert [set(item[:, seat].argmax(-1).ravel()) for item in maps] == [{CHAIR}, {BED}]
    assert all(np.array_equal(np.sort(item), np.sort(scores)) for item in maps)


def test_the_most_central_touching_samples_come_first_and_feet_alone_are_no_touch(network) -> None:
    contact = np.zeros((20, 5, 703), dtype=bool)
    contact[:, :, part(network, "left_foot")] = True
    codes, share = torch.arange(20.0)[:, None], np.zeros((5, 703, 42), dtype=np.float32)
    assert touching_codes(network, PriorSamples(codes, contact, share)) == []
    seat = part(network, "seat")
    for index, count in ((3, 20), (4, 22), (5, 24), (6, 80)):
        contact[index, :, seat[:count]] = True
    found = touching_codes(network, PriorSamples(codes, contact, share))
    # 20, 22 and 24 vertices overlap; 22 the most with both. The one with 80 exaggerates.
    assert [float(z[0]) for z in found] == [4.0, 6.0]


def test_a_body_that_the_network_was_not_trained_on_is_refused(sit, slim, monkeypatch) -> None:
    monkeypatch.setattr(learned, "vertex_hash", lambda ids: "another")
    with pytest.raises(InputError, match="interaction model learned: body: got 'male_slim'"):
        learned_features(sit(20), slim, EVERYTHING)

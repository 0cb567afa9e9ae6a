from __future__ import annotations

import numpy as np
import pytest
import torch

from experiments.body.measures import body_measures
from experiments.scene.lookup import SceneLookup
from experiments.scene.synthetic import synthetic_room
from experiments.synthesis.spots import BODY_RADIUS_M, free_floor, heading, room_spots, upright


def test_free_floor_keeps_its_distance_from_everything(seat_room) -> None:
    free = free_floor(seat_room)
    low = np.array([0.0, 0.0]) + BODY_RADIUS_M
    assert (free > low).all() and (free < 3.0 - BODY_RADIUS_M).all()
    # Distance to the seat's footprint has a closed form.
    outside = np.maximum(np.maximum([1.2, 1.5] - free, free - [1.8, 2.0]), 0.0)
    assert np.linalg.norm(outside, axis=1).min() > BODY_RADIUS_M - 0.03
    assert 0.75 * (2.5**2 - 1.1 * 1.0) < 0.01 * len(free) < 2.5**2 - 0.3


def test_a_full_room_has_no_free_floor() -> None:
    full = {"block": ((0.0, 0.0, 0.0), (3.0, 3.0, 1.2), "cabinet")}
    assert len(free_floor(synthetic_room(full, scene_id="full"))) == 0


def test_a_chair_is_sat_on_from_above_with_room_for_the_legs(seat_room, slim) -> None:
    spots = room_spots(seat_room, slim).furniture[("seat", "sit")]
    pelvis = np.stack([spot.pelvis for spot in spots])
    measures = body_measures(slim)
    hips = slim.rest_joints[1:3, 1].mean() - slim.rest_joints[0, 1]
    assert pelvis[:, 2] == pytest.approx(0.45 + measures.seat_offset - hips, abs=1e-3)
    assert (pelvis[:, :2] > [1.2, 1.5]).all() and (pelvis[:, :2] < [1.8, 2.0]).all()
    feet = np.stack([spot.pelvis + 0.5 * spot.orientation[:, 2] for spot in spots])
    feet[:, 2] = 0.12
    assert float(SceneLookup(seat_room).distance(torch.tensor(feet).float()).min()) > 0.0


def test_who_sits_turns_his_back_to_the_back_rest(slim) -> None:
    boxes = {
        "seat": ((1.2, 1.2, 0.0), (1.8, 1.75, 0.45), "chair"),
        "rest": ((1.2, 1.75, 0.0), (1.8, 1.85, 1.0), "wall"),
    }
    spots = room_spots(synthetic_room(boxes, scene_id="rest"), slim).furniture[("seat", "sit")]
    front = np.stack([spot.orientation[:, 2] for spot in spots])
    assert len(spots) and (front[:, 1] < 0.3).all() and front[:, 1].mean() < -0.6


def test_who_lies_on_a_bed_lies_along_it_on_his_back(bed_room, slim) -> None:
    spots = room_spots(bed_room, slim).furniture[("bed", "lie")]
    for spot in spots:
        left, head, front = spot.orientation.T
        assert np.linalg.det(spot.orientation) == pytest.approx(1.0)
        assert front == pytest.approx([0, 0, 1])
        assert abs(head[1]) > 0.7 and head[2] == pytest.approx(0.0)
        assert np.cross(head, front) == pytest.approx(left)
        assert 0.55 < spot.pelvis[2] < 0.7


def test_who_touches_a_cupboard_stands_before_it_and_looks_at_it(cupboard_room, slim) -> None:
    spots = room_spots(cupboard_room, slim)
    found = spots.furniture[("cupboard", "touch")]
    for spot in found:
        assert 2.0 < spot.pelvis[1] < 2.3 and spot.pelvis[2] == spots.standing_z
        inside = 0.7 < spot.pelvis[0] < 2.3
        assert spot.orientation[1, 2] > (0.95 if inside else 0.2)
    assert any(0.7 < spot.pelvis[0] < 2.3 for spot in found)


def test_a_room_without_furniture_affords_nothing(empty_room, slim) -> None:
    assert room_spots(empty_room, slim).furniture == {}


def test_an_upright_body_stands_on_the_floor_and_looks_where_it_heads(slim, empty_room) -> None:
    spots = room_spots(empty_room, slim)
    for yaw in np.linspace(-3, 3, 7):
        turn = upright(yaw)
        assert turn[:, 2] == pytest.approx(heading(yaw)) and turn[:, 1] == pytest.approx([0, 0, 1])
    zero = torch.zeros((1, 22, 3), dtype=torch.float64)
    rest = slim.posed(zero, zero[:, 0]).vertices[0].numpy()
    lowest = (upright(0.7) @ rest.T).T[:, 2].min() + spots.standing_z
    assert lowest == pytest.approx(0.0, abs=1e-6)

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from experiments.alteration import alteration_cost, foot_skate, joint_jerk, rigid_between
from experiments.metrics import plausibility, skin_distances
from experiments.placement.features import choose_features
from experiments.placement.pointwise import nearest_label
from experiments.placement.rigid import move_motion
from experiments.placement.settings import PRESETS
from experiments.scene.lookup import trilinear_reference

FAST = PRESETS["fast"]
RULE = dataclasses.replace(FAST, interaction="geometric")
MIDDLE = np.array([0.9, 0.9, 0.0])


@pytest.fixture(scope="module")
def stander(sit, slim):
    """Stands in a free corner of the room for six frames."""
    motion = sit(6, stand=1.0)
    return motion, move_motion(motion, slim, 0.5, MIDDLE, np.zeros(2))


def lifted(motion, metres: float):
    return dataclasses.replace(motion, transl=motion.transl + np.array([0.0, 0.0, metres]))


def test_a_lifted_body_collides_with_nothing_and_touches_nothing(stander, slim, empty_room) -> None:
    original, placed = stander
    scores = plausibility(lifted(placed, 0.3), original, empty_room, slim, FAST)
    assert (scores.non_collision == 1.0).all()
    assert not scores.contact.any() and not scores.contact_beyond_floor.any()
    assert all(not value.any() for value in scores.tolerant.values())
    assert scores.depth_max.max() == 0.0 and scores.predicted_near == 0.0


def test_a_sunk_body_scores_the_share_of_vertices_above_the_floor(
    stander, slim, empty_room
) -> None:
    original, placed = stander
    sunk = lifted(placed, -0.1)
    scores = plausibility(sunk, original, empty_room, slim, FAST)
    heights = skin_heights(sunk, slim)
    assert (scores.contact == 1.0).all()
    assert scores.non_collision == pytest.approx((heights > 0).mean(1), abs=2e-4)
    assert scores.depth_sum == pytest.approx(np.maximum(-heights, 0).sum(1), rel=1e-3)
    assert scores.depth_max == pytest.approx(-heights.min(1), abs=1e-4)


@pytest.mark.parametrize("sink", [0.0, 0.012, 0.05])
def test_vertices_deeper_than_a_centimetre_are_counted_by_their_height(
    stander, slim, empty_room, sink: float
) -> None:
    original, placed = stander
    sunk = lifted(placed, -sink)
    scores = plausibility(sunk, original, empty_room, slim, FAST)
    expected = (skin_heights(sunk, slim) < -0.01).mean(1)
    assert scores.deep == pytest.approx(expected, abs=2e-4)
    assert (scores.deep <= 1.0 - scores.non_collision).all()
    assert scores.as_dict()["deeper_1cm"] == pytest.approx(float(expected.mean()), abs=2e-4)


def skin_heights(motion, body) -> np.ndarray:
    mesh = body.posed(
        torch.as_tensor(motion.pose), torch.as_tensor(motion.transl), body.body_component
    )
    return mesh.vertices[..., 2].numpy()


@pytest.mark.parametrize(("gap", "touching"), [(0.004, 3), (0.008, 2), (0.015, 1), (0.025, 0)])
def test_tolerances_count_near_misses(stander, slim, empty_room, gap: float, touching: int) -> None:
    original, placed = stander
    raised = lifted(placed, gap - skin_heights(placed, slim).min())
    scores = plausibility(raised, original, empty_room, slim, FAST)
    assert not scores.contact.any()
    assert sum(value.all() for value in scores.tolerant.values()) == touching


@pytest.mark.parametrize("gap", [0.0, 0.012, 0.018])
def test_fulfilled_predictions_are_counted_by_their_height(
    stander, slim, empty_room, gap: float
) -> None:
    original, placed = stander
    raised = lifted(placed, gap)
    features = choose_features(original, empty_room, slim, RULE)
    pose, transl = torch.as_tensor(raised.pose), torch.as_tensor(raised.transl)
    heights = slim.posed(pose, transl, features.vertex_ids).vertices[..., 2].numpy()
    predicted = features.contact > 0.5
    scores = plausibility(raised, original, empty_room, slim, RULE)
    assert scores.predicted_near == pytest.approx(
        float((np.abs(heights) < 0.02)[predicted].mean()), abs=0.02
    )
    assert scores.semantic_match == 1.0
    assert scores.frames_with_prediction == predicted.any(1).mean()


def test_the_skin_is_read_as_the_textbook_reads_it(stander, slim, seat_room) -> None:
    _, placed = stander
    distance, label = skin_distances(placed, seat_room, slim)
    points = slim.posed(
        torch.as_tensor(placed.pose), torch.as_tensor(placed.transl), slim.body_component
    ).vertices.numpy()
    assert distance.shape == (6, len(slim.body_component))
    for vertex in range(0, distance.shape[1], 997):
        point = points[2, vertex]
        volumes = seat_room.volumes
        assert distance[2, vertex] == pytest.approx(
            trilinear_reference(volumes, False, point), abs=1e-5
        )
        assert label[2, vertex] == nearest_label(volumes, point)


def test_the_catalogue_gets_plain_finite_numbers(stander, slim, empty_room) -> None:
    original, placed = stander
    record = plausibility(placed, original, empty_room, slim, FAST).as_dict()
    assert all(type(value) is float and np.isfinite(value) for value in record.values())
    assert {"non_collision", "contact", "contact_1cm", "cv2", "jerk_change_mm"} <= record.keys()


def test_a_rigid_move_costs_the_motion_nothing(sit, slim) -> None:
    motion = sit(40)
    moved = move_motion(motion, slim, 2.3, np.array([4.0, -1.0, 0.2]), np.array([0.3, 0.1]))
    cost = dataclasses.asdict(alteration_cost(moved, motion, slim))
    skate = cost.pop("foot_skate_cm_s"), cost.pop("foot_skate_before_cm_s")
    assert skate[0] == pytest.approx(skate[1], abs=1e-6)
    assert cost.pop("jerk_ratio") == pytest.approx(1.0) and cost.pop("jerk_before_mm") > 0.0
    assert max(abs(value) for value in cost.values()) < 1e-5


def test_twice_the_movement_has_twice_the_jerk_and_a_still_clip_has_no_ratio(sit, slim) -> None:
    still = sit(30, stand=1.0)
    path = 0.05 * np.sin(np.arange(30))[:, None] * np.array([1.0, 0.0, 0.0])
    once, twice = (
        dataclasses.replace(still, transl=still.transl + times * path) for times in (1, 2)
    )
    assert alteration_cost(twice, once, slim).jerk_ratio == pytest.approx(2.0)
    assert np.isnan(alteration_cost(once, still, slim).jerk_ratio)


def test_the_rigid_part_between_two_motions_is_recovered(sit, slim) -> None:
    motion = sit(20, stand=1.0)
    moved = move_motion(motion, slim, -1.2, np.array([1.0, 2.0, 0.3]), np.zeros(2))
    turn, shift = rigid_between(motion, moved, slim)
    assert turn.as_rotvec() == pytest.approx([0.0, 0.0, -1.2], abs=1e-9)
    assert shift == pytest.approx([1.0, 2.0, 0.3], abs=1e-9)


def test_one_bent_joint_is_measured_in_degrees(sit, slim) -> None:
    motion = sit(30)
    pose = motion.pose.copy()
    bend = Rotation.from_rotvec(pose[7, 18]) * Rotation.from_euler("y", 12.0, degrees=True)
    pose[7, 18] = bend.as_rotvec()
    cost = alteration_cost(dataclasses.replace(motion, pose=pose), motion, slim)
    assert cost.angle_max_deg == pytest.approx(12.0)
    assert cost.angle_mean_deg == pytest.approx(12.0 / (30 * 22))


def test_a_jump_of_one_frame_shows_as_step_and_as_jerk(sit, slim) -> None:
    motion = sit(40, stand=1.0)
    transl = motion.transl.copy()
    transl[20, 0] += 0.02
    jumped = dataclasses.replace(motion, transl=transl)
    cost = alteration_cost(jumped, motion, slim)
    assert cost.step_change_max_mm == pytest.approx(20.0)
    # Third differences of a one-frame jump d: d, 3d, 3d, d over 37 of them, at every joint.
    assert cost.jerk_change_mm == pytest.approx(8 * 20.0 / 37, rel=1e-6)
    assert joint_jerk(motion, slim) == pytest.approx(0.0, abs=1e-9)


def test_gliding_feet_skate_at_the_speed_of_the_glide(sit, slim) -> None:
    motion = sit(31, stand=1.0)
    transl = motion.transl.copy()
    transl[:, 1] -= np.linspace(0.0, 0.3, 31)
    assert foot_skate(motion, slim) == pytest.approx(0.0, abs=1e-9)
    # 0.3 m in one second.
    assert foot_skate(dataclasses.replace(motion, transl=transl), slim) == pytest.approx(30.0)

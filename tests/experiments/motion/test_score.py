"""Scores, their curves and their performance."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.motion.capture import INDEX
from experiments.motion.checks import check_motion
from experiments.motion.figure import Figure, surface
from experiments.motion.life import breathing, smooth_noise
from experiments.motion.perform import perform
from experiments.motion.phrases_step import step
from experiments.motion.rotations import about, joint_positions, world_rotations
from experiments.motion.score import Score, curve


def test_a_channel_holds_until_its_phrase_begins(figure: Figure) -> None:
    score = Score(figure)
    score.wait(2.0)
    score.put("yaw", (1.0, 30.0))
    yaw = score.sample(np.arange(121) / 30)["yaw"][:, 0]
    np.testing.assert_allclose(yaw[:50], 0.0, atol=1e-6)
    assert yaw[-1] == pytest.approx(30.0)


def test_a_curve_does_not_overshoot_its_keys() -> None:
    track = [(0.0, (0.0,)), (0.5, (1.0,)), (0.6, (1.0,)), (2.0, (0.2,))]
    values = curve(track, np.arange(90) / 30, smooth_s=0.07)
    assert values.min() >= 0.0 and values.max() <= 1.0


@pytest.mark.parametrize(
    ("channel", "moves", "error"),
    [("hip", ((1.0, 3.0),), ValueError), ("tail", ((1.0, 3.0),), KeyError),
     ("yaw", ((1.0, 3.0), (0.5, 2.0)), ValueError)],
)  # fmt: skip
def test_a_wrong_key_is_refused(
    figure: Figure, channel: str, moves: tuple[tuple[float, float], ...], error: type[Exception]
) -> None:
    with pytest.raises(error):
        Score(figure).put(channel, *moves)


def test_the_same_seed_gives_the_same_motion_and_another_seed_another(figure: Figure) -> None:
    score = Score(figure)
    score.wait(1.0)
    first, again, other = (perform(score, "idle", seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.pose, again.pose)
    assert np.abs(first.pose - other.pose).max() > 1e-3


def test_standing_feet_do_not_move_while_the_body_lives(figure: Figure) -> None:
    score = Score(figure)
    score.wait(3.0)
    motion = perform(score, "idle", seed=1)
    points = surface(figure, motion, np.concatenate(figure.soles))
    assert np.ptp(points, axis=0).max() < 2e-4
    assert abs(points[..., 2].min()) < 1e-4
    assert np.ptp(motion.transl[:, 0]) > 1e-3


def test_the_head_looks_where_the_gaze_says_while_the_trunk_bends(figure: Figure) -> None:
    score = Score(figure)
    score.start("gaze", 10.0, 0.0)
    score.put("pitch", (1.0, 25.0))
    score.wait(2.0)
    motion = perform(score, "bow", seed=0, life=0.0)
    forward = world_rotations(motion.pose)[:, INDEX["head"], :, 2]
    down = np.degrees(np.arcsin(-forward[:, 2]))
    assert np.abs(down - 10.0).max() < 6.0


def test_the_hand_comes_to_its_target_with_the_elbow_outside(figure: Figure) -> None:
    score = Score(figure)
    target = (0.2, -0.35, 1.15)
    score.start("left_hand", *target)
    score.put("left_reach", (0.8, 1.0))
    score.wait(2.0)
    motion = perform(score, "reach", seed=0, life=0.0)
    joints = joint_positions(world_rotations(motion.pose), motion.transl, figure.rest_joints)[-1]
    np.testing.assert_allclose(joints[INDEX["left_wrist"]], target, atol=5e-3)
    shoulder, elbow = joints[INDEX["left_shoulder"]], joints[INDEX["left_elbow"]]
    assert elbow[0] > (shoulder[0] + target[0]) / 2


def test_a_lifted_heel_leaves_the_toes_where_they_are(figure: Figure) -> None:
    score = Score(figure)
    score.put("left_heel", (1.0, 20.0))
    score.wait(1.5)
    motion = perform(score, "tiptoe", seed=0, life=0.0)
    world = world_rotations(motion.pose)
    toes = joint_positions(world, motion.transl, figure.rest_joints)[:, INDEX["left_foot"]]
    assert np.ptp(toes, axis=0).max() < 1e-9
    heading = about("z", 8.0) @ np.array([0.0, -1.0, 0.0])
    np.testing.assert_allclose(world[-1, INDEX["left_foot"], :, 2], heading, atol=1e-6)


def test_a_step_ends_on_its_mark_without_scraping(figure: Figure) -> None:
    score = Score(figure)
    score.wait(0.2)
    step(score, "left", (0.40, 0.05), 12.0)
    score.wait(0.4)
    motion = perform(score, "step", seed=0, life=0.0)
    joints = joint_positions(world_rotations(motion.pose), motion.transl, figure.rest_joints)
    np.testing.assert_allclose(joints[-1, INDEX["left_ankle"], :2], [0.40, 0.05], atol=2e-3)
    assert check_motion(motion, figure).foot_skate_cm_s < 1.0


def test_noise_has_unit_deviation_and_breathing_stays_in_bounds() -> None:
    rng = np.random.default_rng(0)
    noise = smooth_noise(rng, 200_000, 1, 20.0)
    assert noise.std() == pytest.approx(1.0, rel=0.05)
    assert np.abs(np.diff(noise, axis=0)).max() < 0.3
    assert np.abs(breathing(np.arange(900) / 30, rng)).max() <= 1.0

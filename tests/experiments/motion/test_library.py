"""Every default motion within its limits; cuts, cache and names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.body.embedded import BODY_NAMES
from experiments.motion.capture import INDEX
from experiments.motion.checks import check_motion
from experiments.motion.figure import figure_of, surface
from experiments.motion.library import default_motions, extra_motions, load_motion, trim
from experiments.motion.motion import Motion
from experiments.motion.rotations import joint_positions, world_rotations
from experiments.scene.scene import MPCAT40
from renderer.files import InputError

SPECS = default_motions()
AUTHORED = [spec for spec in SPECS if "DeepMimic clip of" not in spec.source]
SEATED = [spec for spec in SPECS if spec.seat_height is not None and "bed" not in spec.contact]


@pytest.fixture(autouse=True, scope="module")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PACE_CACHE", str(tmp_path_factory.mktemp("cache")))


def assert_within_limits(motion: Motion) -> None:
    checks = check_motion(motion, figure_of(motion.body))
    assert checks.foot_skate_cm_s < 3.0
    assert checks.sole_penetration_mm < 2.0
    assert checks.lowest_other_cm > -1.0
    assert checks.joint_step_deg < 16.0
    assert checks.root_acceleration < 15.0
    assert checks.floor_error_cm < 1.0


def joints_of(motion: Motion) -> np.ndarray:
    figure = figure_of(motion.body)
    return joint_positions(world_rotations(motion.pose), motion.transl, figure.rest_joints)


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.motion_id)
def test_a_default_motion_keeps_its_limits(spec: object) -> None:
    motion = load_motion(spec.motion_id)  # type: ignore[attr-defined]
    assert_within_limits(motion)
    assert 4.0 <= motion.duration_s <= 15.0
    np.testing.assert_allclose(np.diff(motion.times), 1 / 30)


@pytest.mark.parametrize("spec", AUTHORED, ids=lambda spec: spec.motion_id)
def test_authored_hands_keep_clear_of_the_shoulders(spec: object) -> None:
    joints = joints_of(load_motion(spec.motion_id))  # type: ignore[attr-defined]
    for side in ("left", "right"):
        gap = joints[:, INDEX[f"{side}_wrist"]] - joints[:, INDEX[f"{side}_shoulder"]]
        assert np.linalg.norm(gap, axis=1).min() > 0.3


@pytest.mark.slow
@pytest.mark.parametrize("body", [name for name in BODY_NAMES if name != "male_slim"])
@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.motion_id)
def test_a_default_motion_keeps_its_limits_on_every_body(spec: object, body: str) -> None:
    assert_within_limits(load_motion(spec.motion_id, body))  # type: ignore[attr-defined]


@pytest.mark.parametrize("body", BODY_NAMES)
@pytest.mark.parametrize("spec", SEATED, ids=lambda spec: spec.motion_id)
def test_the_buttocks_are_on_the_seat(spec: object, body: str) -> None:
    motion = load_motion(spec.motion_id, body)  # type: ignore[attr-defined]
    model = figure_of(body).body
    seat = surface(figure_of(body), motion, model.regions["buttocks"])[..., 2].min(axis=1)
    # Seated frames: the hips are low and at rest.
    height = joints_of(motion)[:, 1:3, 2].mean(axis=1)
    seated = (height < height.min() + 0.01) & (np.abs(np.gradient(height)) < 0.002)
    assert seated.sum() >= 60
    assert np.abs(seat[seated] - spec.seat_height).max() < 0.02  # type: ignore[attr-defined]


@pytest.mark.parametrize("motion_id", ["sit_stay_stand", "sit_work", "lean_table"])
def test_elbows_point_outwards(motion_id: str) -> None:
    motion = load_motion(motion_id)
    joints = joints_of(motion)
    left = world_rotations(motion.pose)[:, INDEX["spine3"], :, 0]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder, elbow, wrist = (
            joints[:, INDEX[f"{side}_{part}"]] for part in ("shoulder", "elbow", "wrist")
        )
        aside = sign * np.sum((elbow - (shoulder + wrist) / 2) * left, axis=1)
        assert aside.min() > -0.01


def test_the_set_is_complete_and_tells_its_sources() -> None:
    names = [spec.motion_id for spec in SPECS]
    assert len(names) >= 12 and len(set(names)) == len(names)
    for spec in SPECS:
        assert "pybullet" in spec.source or "authored" in spec.source
        assert set(spec.contact) <= set(MPCAT40) and spec.contact
        assert spec.recording is None


def test_a_motion_from_the_cache_is_the_one_that_was_built() -> None:
    first, second = load_motion("reach_forward"), load_motion("reach_forward")
    np.testing.assert_array_equal(first.pose, second.pose)
    np.testing.assert_array_equal(first.transl, second.transl)
    assert first.motion_id == second.motion_id == "reach_forward"


def test_a_cut_is_centred_on_the_interaction_and_can_be_cut_again() -> None:
    motion = load_motion("sit_stay_stand")
    spec = next(spec for spec in SPECS if spec.motion_id == "sit_stay_stand")
    cut = trim(motion, 4.0)
    assert cut.n_frames == 120
    assert cut.times.mean() == pytest.approx(spec.highlight_s, abs=0.02)
    assert trim(cut, 1.0).times.mean() == pytest.approx(spec.highlight_s, abs=0.02)
    assert trim(motion, 60.0) is motion


def test_unknown_names_and_lengths_are_refused() -> None:
    with pytest.raises(InputError, match="got 'moonwalk', wanted one of walk_straight"):
        load_motion("moonwalk")
    with pytest.raises(InputError, match="got 'giant'"):
        load_motion("walk_straight", "giant")
    with pytest.raises(InputError, match="wanted two frames or more"):
        trim(load_motion("reach_forward"), 0.01)


@pytest.mark.shared
def test_the_extra_set_comes_from_cmu(shared_data: Path) -> None:
    specs = extra_motions()
    assert len(specs) == 4
    for spec in specs:
        checks = check_motion(load_motion(spec.motion_id), figure_of("male_slim"))
        assert checks.sole_penetration_mm < 2.0
        assert checks.foot_skate_cm_s < 5.0
        assert "mocap.cs.cmu.edu" in spec.source


def test_without_shared_data_there_is_no_extra_set(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PACE_SHARED", str(tmp_path))
    assert extra_motions() == ()

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.interaction.geometric import geometric_features, seats_for
from experiments.interaction.mesh import feature_vertices, moving_body
from experiments.interaction.registry import first_fitting_map
from experiments.scene.scene import MPCAT40

EVERYTHING = MPCAT40[1:]


def classes_of(features, frames=slice(None)) -> set[str]:
    label = features.semantics.argmax(-1)[frames][features.contact[frames] > 0.5]
    return {MPCAT40[index] for index in np.unique(label)}


def test_a_standing_body_touches_the_floor_with_both_soles_and_nothing_else(sit, slim) -> None:
    features = geometric_features(sit(40, stand=1.0), slim, EVERYTHING)[0]
    touching = features.vertex_ids[(features.contact > 0.5).any(0)]
    soles = np.union1d(slim.regions["left_sole"], slim.regions["right_sole"])
    assert classes_of(features) == {"floor"}
    assert np.isin(touching, soles).all()
    assert all(np.isin(touching, slim.regions[f"{side}_sole"]).any() for side in ("left", "right"))


def test_a_seated_body_touches_the_seat_with_its_underside_and_the_floor(sit, slim) -> None:
    features = geometric_features(sit(60), slim, EVERYTHING)[0]
    assert classes_of(features, slice(0, 20)) == {"floor"}
    assert classes_of(features, slice(50, 60)) == {"floor", "chair"}
    on_seat = features.vertex_ids[(features.semantics.argmax(-1) == 3).any(0)]
    underside = np.union1d(slim.regions["buttocks"], slim.regions["thigh_backs"])
    assert len(on_seat) >= 8 and np.isin(on_seat, underside).all()


def test_a_seated_body_takes_the_seats_that_the_scene_has(sit, slim) -> None:
    maps = geometric_features(sit(60), slim, ("floor", "sofa", "bed", "table"))
    assert [classes_of(item, slice(50, 60)) - {"floor"} for item in maps] == [{"sofa"}, {"bed"}]
    none = geometric_features(sit(60), slim, ("floor", "table"))
    assert [classes_of(item, slice(50, 60)) - {"floor"} for item in none] == [{"chair"}]


def test_seats_are_ordered_by_how_near_their_usual_height_is() -> None:
    assert seats_for(0.45)[0] == "chair"
    assert seats_for(0.53)[0] == "bed"
    assert seats_for(0.74)[0] == "stool"
    assert seats_for(0.05) == ("floor",)


def test_a_fast_foot_is_swinging(walk, slim) -> None:
    motion = walk(8.0, 60)
    features = geometric_features(motion, slim, EVERYTHING)[0]
    # At 4 m/s the swing of the legs never brings a sole to rest.
    assert not (features.contact > 0.5).any()


def test_a_lying_body_rests_its_back_on_a_bed_or_on_the_floor(sit, slim) -> None:
    motion = sit(40, stand=1.0)
    pose = motion.pose.copy()
    pose[:, 0] = 0.0
    flat = dataclasses.replace(motion, pose=pose)
    lowest = moving_body(flat, slim).vertices[..., 2].min()
    transl = flat.transl - [0.0, 0.0, lowest]
    on_floor = geometric_features(dataclasses.replace(flat, transl=transl), slim, EVERYTHING)[0]
    assert classes_of(on_floor) == {"floor"}
    back = features_in(on_floor, slim.regions["back"])
    assert back > 3


def features_in(features, region) -> int:
    touching = features.vertex_ids[(features.contact > 0.5).any(0)]
    return int(np.isin(touching, region).sum())


@pytest.mark.parametrize(("down_deg", "touched"), [(0.0, "shelving"), (34.0, "table")])
def test_a_still_hand_ahead_touches_a_shelf_at_shoulder_height_and_a_table_below(
    sit, slim, down_deg: float, touched: str
) -> None:
    motion = sit(40, stand=1.0)
    pose = motion.pose.copy()
    # From the T-pose: arm turned ahead with the palm down, then lowered.
    lowered = Rotation.from_euler("x", down_deg, degrees=True)
    pose[:, 17] = (lowered * Rotation.from_euler("y", 90, degrees=True)).as_rotvec()
    reaching = dataclasses.replace(motion, pose=pose)
    assert classes_of(geometric_features(reaching, slim, EVERYTHING)[0]) == {"floor", touched}
    assert classes_of(geometric_features(motion, slim, EVERYTHING)[0]) == {"floor"}


def test_the_rule_does_not_care_where_the_clip_stands_or_faces(sit, slim) -> None:
    motion = sit(40)
    from experiments.placement.rigid import move_motion

    moved = move_motion(motion, slim, 2.1, np.array([3.0, -2.0, 0.7]), np.zeros(2))
    here, there = (geometric_features(item, slim, EVERYTHING)[0] for item in (motion, moved))
    assert np.mean(here.contact != there.contact) < 1e-3


def test_feature_vertices_hold_the_small_mesh_and_thicker_soles(slim) -> None:
    ids = feature_vertices(slim)
    assert np.isin(slim.subset, ids).all()
    assert np.isin(slim.regions["left_sole"], ids).sum() >= 16
    assert (np.diff(ids) > 0).all()


def test_normals_face_outwards_and_the_soles_down(sit, slim) -> None:
    moving = moving_body(sit(3, stand=1.0), slim)
    columns = np.concatenate([moving.columns["left_sole"], moving.columns["right_sole"]])
    assert moving.normals[0, columns, 2].max() < -0.5
    assert np.linalg.norm(moving.normals, axis=-1) == pytest.approx(1.0)


def test_posa_takes_the_first_map_whose_commonest_class_exists(sit, slim, empty_room) -> None:
    maps = geometric_features(sit(60, stand=0.0), slim, ("floor", "sofa", "bed"))
    sofa_only = [item for item in maps if "sofa" in classes_of(item)]
    assert first_fitting_map(maps, empty_room, count_floor=False) == 0
    reordered = [*(item for item in maps if "bed" in classes_of(item)), *sofa_only]
    from experiments.scene.synthetic import synthetic_room

    room = synthetic_room({"s": ((0.5, 0.5, 0.0), (1.5, 1.0, 0.43), "sofa")}, scene_id="sofa")
    assert first_fitting_map(reordered, room, count_floor=False) == 1

from __future__ import annotations

import numpy as np
import pytest

from experiments.body.model import JOINT_NAMES
from experiments.body.regions import farthest_points
from experiments.body.skinned_body import SkinnedBody

NAMES = {
    "left_sole", "right_sole", "buttocks", "thigh_backs", "back", "left_palm", "right_palm",
    "left_hand", "right_hand", "forearms", "calves",
}  # fmt: skip


def test_every_promised_region_is_there_and_lies_on_the_skin(male: SkinnedBody) -> None:
    assert set(male.regions) == NAMES
    for ids in male.regions.values():
        assert len(np.unique(ids)) == len(ids) >= 100
        assert np.isin(ids, male.body_component).all()


@pytest.mark.parametrize(("name", "side"), [("left", 1.0), ("right", -1.0)])
def test_sided_regions_lie_on_their_side_of_the_body(
    male: SkinnedBody, name: str, side: float
) -> None:
    for part in ("sole", "palm", "hand"):
        assert (side * male.rest_vertices[male.regions[f"{name}_{part}"], 0] > 0).all()
    assert set(male.regions[f"{name}_palm"]) < set(male.regions[f"{name}_hand"])


def test_soles_are_low_and_what_one_sits_on_is_behind(male: SkinnedBody) -> None:
    vertices, joints = male.rest_vertices, dict(zip(JOINT_NAMES, male.rest_joints, strict=True))
    floor = vertices[male.body_component, 1].min()
    assert vertices[male.regions["left_sole"], 1].max() < floor + 0.025
    assert vertices[male.regions["buttocks"], 2].max() < joints["left_hip"][2] + 0.01
    knee, hip = joints["left_knee"][1], joints["left_hip"][1]
    thighs = vertices[male.regions["thigh_backs"], 1]
    assert knee - 0.05 < thighs.min() and thighs.max() < hip
    assert vertices[male.regions["back"], 1].min() > hip


def test_regions_of_one_body_part_do_not_overlap(male: SkinnedBody) -> None:
    parts = ["buttocks", "thigh_backs", "back", "calves", "forearms", "left_hand", "left_sole"]
    together = np.concatenate([male.regions[part] for part in parts])
    assert len(np.unique(together)) == len(together)


def test_contact_rows_thicken_the_contact_areas_only(male: SkinnedBody) -> None:
    areas = ["left_sole", "right_sole", "buttocks", "thigh_backs", "back"]
    allowed = np.concatenate([male.regions[area] for area in areas])
    assert 60 <= len(male.contact_rows) <= 100
    assert np.isin(male.contact_rows, allowed).all()
    assert not np.isin(male.contact_rows, male.subset).any()


def test_farthest_points_of_a_line_halve_it_again_and_again() -> None:
    line = np.linspace([0.0, 0, 0], [8.0, 0, 0], 9)
    assert farthest_points(line, 4, line[:1]).tolist()[:2] == [8, 4]
    assert sorted(farthest_points(line, 4, line[:1]).tolist()) == [2, 4, 6, 8]
    assert len(farthest_points(line, 20, line[:0])) == 9

from __future__ import annotations

import numpy as np
import pytest
import torch

from experiments.body.embedded import BODY_NAMES, load_body
from experiments.body.measures import SEAT_PRESS_M, body_measures
from experiments.body.model import JOINT_NAMES


@pytest.mark.parametrize("name", BODY_NAMES)
def test_measures_add_up(name: str) -> None:
    measures = body_measures(load_body(name))
    assert measures.leg == pytest.approx(measures.thigh + measures.shank)
    assert measures.hip_height == pytest.approx(measures.leg + measures.ankle_height, abs=1e-5)
    assert 0.5 * measures.stature < measures.hip_height < 0.56 * measures.stature


def test_leg_ratios_are_those_of_the_phenotypes() -> None:
    legs = {name: body_measures(load_body(name)).leg for name in BODY_NAMES}
    ratios = [legs[name] / legs["male_slim"] for name in BODY_NAMES]
    np.testing.assert_allclose(ratios, [0.913, 1.0, 0.858, 1.058], atol=2e-3)


@pytest.mark.parametrize("name", BODY_NAMES)
def test_a_seated_body_at_the_seat_offset_presses_into_the_seat(name: str) -> None:
    body = load_body(name)
    pose = torch.zeros(1, 22, 3)
    pose[0, 0, 0] = -np.deg2rad(10)
    for side in ("left", "right"):
        pose[0, JOINT_NAMES.index(f"{side}_hip"), 0] = np.deg2rad(-80)
        pose[0, JOINT_NAMES.index(f"{side}_knee"), 0] = np.pi / 2
    mesh = body.posed(pose, torch.zeros(1, 3))
    hips = mesh.joints[0, 1:3, 1].mean()
    seated = body.regions["buttocks"].tolist() + body.regions["thigh_backs"].tolist()
    lowest = mesh.vertices[0, seated, 1].min() - (hips - body_measures(body).seat_offset)
    assert lowest == pytest.approx(-SEAT_PRESS_M, abs=1e-5)
    assert mesh.vertices[0, :, 1].min() < hips - 0.4

from __future__ import annotations

import numpy as np
import pytest

from experiments.motion.library import load_motion
from experiments.motion_class import hands_up_s, motion_class


def test_closed_form_motions_have_the_class_they_were_made_for(sit, walk, slim) -> None:
    assert motion_class(sit(60, stand=0.2), slim) == "sit"
    assert motion_class(sit(30, stand=1.0), slim) == "stand"
    assert motion_class(walk(1.5), slim) == "walk"
    assert motion_class(walk(0.4), slim) == "stand"


@pytest.mark.parametrize(
    ("name", "expected"),
    [("walk_turn_sit", "sit"), ("lie_rest_get_up", "lie"), ("reach_high", "reach"),
     ("lean_table", "reach"), ("walk_turn_left", "walk"), ("stand_idle_look", "stand")],
)  # fmt: skip
def test_motions_of_the_library_are_named_by_what_they_do(name: str, expected: str, slim) -> None:
    assert motion_class(load_motion(name), slim) == expected


def test_hands_up_lasts_as_long_as_a_wrist_is_above_the_head() -> None:
    from experiments.body.model import JOINT_NAMES
    from experiments.interaction.mesh import MovingBody

    joints = np.zeros((30, 22, 3))
    joints[:, JOINT_NAMES.index("head"), 2] = 1.6
    joints[12:21, JOINT_NAMES.index("left_wrist"), 2] = 1.7
    empty = np.zeros((30, 0, 3))
    moving = MovingBody(np.arange(0), empty, empty, joints, np.arange(30) / 30.0, {})
    assert hands_up_s(moving) == pytest.approx(0.3)

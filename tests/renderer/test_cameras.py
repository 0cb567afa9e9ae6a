"""Cameras: what is visible, what is cut away, and that the choice is fair and repeatable."""

from __future__ import annotations

import json

import numpy as np
import pytest

from renderer.cameras import CameraRig, choose_cameras
from renderer.cutaway import Cutaway
from renderer.files import InputError
from renderer.framing import fit_camera, swept_box
from renderer.leftovers import leftover_parts, shown_groups
from renderer.visibility import Blockers, sample_bodies


def looking_from(synthetic, azimuth: float, bodies=None):
    """Eye, framed box, samples and cutaway of the synthetic room, seen from this azimuth."""
    stage = synthetic.make_stage()
    bodies = [stage.vertices] if bodies is None else bodies
    box = swept_box(bodies, synthetic.room_size, 0.0)
    samples = sample_bodies(bodies, stage.faces, stage.regions, synthetic.room_size, 0.0)
    cutaway = Cutaway.of_room(stage.parts, synthetic.room_size, 0.0)
    return fit_camera(box, azimuth, 32.0, 0.56, 16 / 9)[:3, 3], box, samples, cutaway


def test_four_views_stand_ninety_degrees_apart_and_look_down_gently(rig):
    azimuths = [view.azimuth_deg for view in rig.views]
    assert np.allclose(np.diff([*azimuths, azimuths[0] + 360]) % 360, 90)
    assert all(25 <= view.elevation_deg <= 40 for view in rig.views)


def test_the_choice_repeats_and_survives_json(synthetic, stage, rig):
    assert synthetic.make_rig(stage) == rig
    assert CameraRig.from_dict(json.loads(json.dumps(rig.to_dict()))) == rig


def test_the_order_of_methods_moves_no_camera(synthetic, stage):
    other = synthetic.walk(4, (1.0, 0.6), (2.5, 2.0))
    rigs = [
        choose_cameras(
            stage.parts, stage.room_size, 0.0, bodies, stage.regions, stage.faces, synthetic.small
        )
        for bodies in ([stage.vertices, other], [other, stage.vertices])
    ]
    assert rigs[0] == rigs[1]


def test_walls_go_when_the_camera_stands_behind_them(synthetic):
    eye, box, samples, cutaway = looking_from(synthetic, 45.0)
    hidden = cutaway.hidden_from(eye, box, samples)
    assert {"wall:n", "wall:e"} <= hidden and not {"wall:s", "wall:w", "floor"} & hidden


def test_tall_furniture_goes_on_the_camera_side_only(synthetic):
    near, far = (looking_from(synthetic, azimuth) for azimuth in (135.0, 315.0))
    assert "object:wardrobe" in near[3].hidden_from(*near[:3])
    assert "object:wardrobe" not in far[3].hidden_from(*far[:3])


def test_an_open_view_shows_all_of_the_body_and_a_screen_hides_its_share(synthetic):
    eye, _, samples, cutaway = looking_from(synthetic, 255.0)
    everything = {group.name for group in cutaway.groups}
    assert (cutaway.visible_fraction(eye, samples, everything) == 1.0).all()
    behind_walls = cutaway.visible_fraction(np.array([1.7, 40.0, 1.0]), samples, set())
    # From outside, looking at the wall's back: walls block rays from both sides.
    assert (behind_walls == 0.0).all()


def test_a_ray_ends_at_the_first_group_that_is_not_hidden():
    screens = np.array([
        [[x, -9.0, -9.0], [x, 9.0, -9.0], [x, 0.0, 9.0]] for x in (1.0, 2.0, 3.0)
    ])  # fmt: skip
    blockers = Blockers(screens, np.array([0, 1, 2]))
    eye, start = np.array([2.5, 0.0, 0.0]), np.zeros((1, 3))
    found = [
        int(blockers.first_group(start, eye, np.array(hidden))[0])
        for hidden in ([False] * 3, [True, False, False], [True, True, False])
    ]
    assert found == [0, 1, -1]


def test_feet_weigh_more_than_the_rest_of_the_body(synthetic):
    stage = synthetic.make_stage()
    samples = sample_bodies([stage.vertices], stage.faces, stage.regions, stage.room_size, 0.0)
    feet = samples.points[0, 0, :, 2] < 0.1
    assert samples.weights.sum() == pytest.approx(1.0)
    assert samples.weights[feet].sum() > 0.3


def test_a_hidden_wall_leaves_a_stub_and_hidden_furniture_a_frame(synthetic):
    parts = (*synthetic.parts, *leftover_parts(synthetic.parts, synthetic.room_size, 0.0))
    shown = shown_groups(parts, ("wall:n", "object:wardrobe"))
    assert {"stub:n", "frame:object:wardrobe"} <= shown
    assert not {"wall:n", "object:wardrobe", "stub:s"} & shown
    frame = next(p for p in parts if p.group == "frame:object:wardrobe").corners.reshape(-1, 3)
    assert np.allclose(frame.min(axis=0)[:2], (0.1, 2.3), atol=1e-5)
    assert np.allclose(frame.max(axis=0), (0.9, 2.9, 0.012), atol=1e-5)


def test_a_body_that_is_not_finite_is_named_with_its_frame(synthetic, stage):
    broken = stage.vertices.copy()
    broken[3, 5, 1] = np.nan
    with pytest.raises(InputError, match=r"bodies\[1\]: got 'not finite in frame 3'"):
        choose_cameras(
            stage.parts, stage.room_size, 0.0, [stage.vertices, broken], stage.regions,
            stage.faces, synthetic.small,
        )  # fmt: skip


def test_an_empty_motion_or_no_body_is_refused(synthetic, stage):
    for bodies in ([], [stage.vertices[:0]]):
        with pytest.raises(InputError, match="cameras: bodies"):
            choose_cameras(
                stage.parts, stage.room_size, 0.0, bodies, stage.regions, stage.faces,
                synthetic.small,
            )  # fmt: skip


def test_asking_for_an_unknown_view_names_the_known_ones(rig):
    with pytest.raises(InputError, match="view-1, view-2, view-3, view-4"):
        rig.view("front")

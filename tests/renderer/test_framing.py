"""Framing: the swept box and the closest camera that shows it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.framing import FRAME_MARGIN, fit_camera, look_from, swept_box

ROOM = (4.0, 3.0, 2.5)


def test_a_still_body_gets_a_box_of_two_metres_twenty():
    body = np.array([[[1.9, 1.4, 0.0], [2.1, 1.6, 1.8]]])
    low, high = swept_box([body], ROOM, 0.0)
    assert np.allclose(high - low, (2.2, 2.2, 1.85))
    assert np.allclose((low + high)[:2] / 2, (2.0, 1.5))


def test_a_walk_keeps_sixty_centimetres_on_each_side():
    body = np.array([[[0.5, 1.0, 0.0]], [[3.5, 1.2, 1.7]]])
    low, high = swept_box([body], ROOM, 0.0)
    assert low[0] == pytest.approx(-0.1) and high[0] == pytest.approx(4.1)


def test_a_body_that_flies_away_moves_no_camera_beyond_half_a_metre_outside():
    sound = np.array([[[2.0, 1.5, 0.0]], [[2.2, 1.5, 1.7]]])
    lost = sound + np.array([100.0, 0.0, 0.0])
    _, high = swept_box([sound, lost], ROOM, 0.0)
    assert high[0] == pytest.approx(4.0 + 0.5 + 0.6)


def test_the_order_of_methods_does_not_matter():
    rng = np.random.default_rng(0)
    bodies = [rng.uniform(0.5, 2.5, (4, 5, 3)) for _ in range(3)]
    assert (swept_box(bodies, ROOM, 0.0) == swept_box(bodies[::-1], ROOM, 0.0)).all()


@given(azimuth=st.floats(0, 360), elevation=st.floats(5, 80), aspect=st.floats(0.5, 2.5))
def test_every_corner_is_inside_and_one_touches_the_margin(azimuth, elevation, aspect):
    box = np.array([[0.2, 0.1, 0.0], [3.0, 2.4, 1.8]])
    yfov = math.radians(32)
    pose = fit_camera(box, azimuth, elevation, yfov, aspect)
    corners = np.array(np.meshgrid(*box.T)).reshape(3, -1).T
    seen = (corners - pose[:3, 3]) @ pose[:3, :3]
    tangent = math.tan(yfov / 2)
    share = np.abs(seen[:, :2]) / -seen[:, 2:] / (tangent * aspect, tangent)
    assert share.max() == pytest.approx(1 - 2 * FRAME_MARGIN, abs=1e-9)


def test_a_camera_is_a_right_handed_frame_that_looks_back_at_the_origin():
    pose = look_from(30.0, 40.0)[:3, :3]
    assert np.allclose(pose.T @ pose, np.eye(3)) and np.linalg.det(pose) == pytest.approx(1.0)
    assert pose[2, 1] > 0 and pose[2, 2] == pytest.approx(math.sin(math.radians(40)))

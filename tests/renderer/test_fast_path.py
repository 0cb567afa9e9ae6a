"""The fast path against pyrender's own full redraw: zero differing pixels."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from renderer.cameras import CameraRig, single_camera
from renderer.framing import look_from
from renderer.render import open_session

Pose = tuple[float, float, float, float, float]


def posed(synthetic, pose: Pose) -> np.ndarray:
    """The body bent a little, tilted about x, turned about z and moved to (x, y, z)."""
    x, y, z, tilt, turn = pose
    body = synthetic.capsule_body()[0].astype(np.float64)
    body[:, 0] += 0.15 * np.sin(3 * body[:, 2])
    for axes, angle in (((1, 2), tilt), ((0, 1), turn)):
        c, s = np.cos(angle), np.sin(angle)
        a, b = body[:, axes[0]].copy(), body[:, axes[1]].copy()
        body[:, axes[0]], body[:, axes[1]] = c * a - s * b, s * a + c * b
    return (body + np.array([x, y, z])).astype(np.float32)


def differing(synthetic, rig: CameraRig, poses: list[Pose], **changes) -> list[int]:
    """Per pose and view: number of pixels in which the fast path and the full redraw differ."""
    vertices = np.stack([posed(synthetic, pose) for pose in poses])
    stage = synthetic.make_stage(vertices, parts=synthetic.parts)
    counts = []
    with open_session(stage, rig.views, dataclasses.replace(synthetic.small, **changes)) as session:
        for vertices in stage.vertices:
            fast = session.frame(vertices)
            for index, picture in enumerate(fast):
                full = session.full(vertices, index)
                counts.append(int((picture != full).any(axis=-1).sum()))
    return counts


inside = st.floats(-0.6, 4.0)
angle = st.floats(-3.2, 3.2)
poses = st.tuples(inside, inside, st.floats(-0.4, 1.2), angle, angle)


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(some=st.lists(poses, min_size=2, max_size=4))
def test_the_rig_of_a_room_redraws_exactly_whatever_the_pose(synthetic, rig, some):
    assert set(differing(synthetic, rig, some)) == {0}


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    some=st.lists(poses, min_size=1, max_size=3),
    azimuth=st.floats(0, 360),
    elevation=st.floats(-10, 75),
    place=st.tuples(inside, inside, st.floats(0.3, 2.4)),
    yfov=st.floats(0.3, 1.6),
)
def test_any_camera_redraws_exactly_also_near_bodies_and_with_bodies_behind_it(
    synthetic, some, azimuth, elevation, place, yfov
):
    camera = look_from(azimuth, elevation)
    camera[:3, 3] = place
    rig = single_camera(camera, yfov, hidden=("wall:s", "object:wardrobe"))
    assert set(differing(synthetic, rig, some)) == {0}


def test_a_picture_without_anti_aliasing_redraws_exactly(synthetic, rig):
    some = [(x, 1.0, 0.0, 0.2, x) for x in (0.5, 1.6, 2.9)]
    assert set(differing(synthetic, rig, some, msaa=0)) == {0}


def test_a_body_out_of_sight_leaves_the_background_untouched(synthetic):
    camera = look_from(90.0, 0.0)
    camera[:3, 3] = (1.7, 1.5, 2.0)
    rig = single_camera(camera, 0.8)
    bodies = np.stack([posed(synthetic, (x, x, 0.0, 0.0, 0.0)) for x in (2.4, 60.0)])
    stage = synthetic.make_stage(bodies, parts=synthetic.parts)
    with open_session(stage, rig.views, synthetic.small) as session:
        behind, far_away = (session.frame(vertices)[0] for vertices in stage.vertices)
    assert (behind == far_away).all()


def test_the_order_of_frames_leaves_no_trace(synthetic, stage, rig):
    first, second = stage.vertices[0], stage.vertices[-1]
    with open_session(stage, rig.views, synthetic.small) as session:
        before = session.frame(first)
        session.frame(second)
        after = session.frame(first)
    assert all((a == b).all() for a, b in zip(before, after, strict=True))


def test_only_a_part_of_the_picture_is_redrawn(synthetic, stage, rig):
    with open_session(stage, rig.views, synthetic.small) as session:
        session.frame(stage.vertices[0])
        shares = [session.dirty_share(index) for index in range(4)]
    assert 0.0 < max(shares) < 0.3

"""The placed windows: no collisions, disjoint splits, files, what is counted as capture."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch

from experiments.body.embedded import BODY_NAMES
from experiments.motion.figure import figure_of
from experiments.synthesis.body_vector import to_pose
from experiments.synthesis.placed_windows import (
    SUPPORTS,
    DataSettings,
    PlacedWindows,
    build_windows,
    read_windows,
    write_windows,
)
from experiments.synthesis.room_search import CONTACT_M, DEPTH_M, SEAT_DEPTH_M, spun
from experiments.synthesis.training_clips import COMPOSED_CAPTURE_S
from experiments.synthesis.training_set import TrainingSet
from experiments.synthesis.windows import MIN_WAY_M, markers


def test_no_placed_body_is_in_anything_by_the_distance_of_its_room(windows: PlacedWindows) -> None:
    for split in ("train", "held_out"):
        data = TrainingSet(windows, split)  # type: ignore[arg-type]
        for placement in windows.placed(split):  # type: ignore[arg-type]
            one = np.array([placement])
            pose, transl = to_pose(data.vectors(one, np.array([0]))[0])
            body = figure_of(BODY_NAMES[data.body_of(one)[0]]).body
            points = body.posed(pose, transl, markers(body).ids).vertices
            seat = SUPPORTS[windows.support[windows.window[placement]]] == "seat"
            depth = -float(data.rooms[int(windows.room[placement])].lookup.distance(points).min())
            # stored in half precision: another centimetre
            assert depth <= (SEAT_DEPTH_M if seat else DEPTH_M) + 0.01


def test_seats_and_hands_touch_furniture(windows: PlacedWindows) -> None:
    data = TrainingSet(windows, "train")
    carried = [p for p in windows.placed("train") if windows.frame[windows.window[p]] >= 0]
    assert carried
    for placement in carried:
        one = np.array([placement])
        frame = int(windows.frame[windows.window[placement]])
        pose, transl = to_pose(data.vectors(one, np.array([0]))[0, frame : frame + 1])
        body = figure_of(BODY_NAMES[data.body_of(one)[0]]).body
        names = ("buttocks", "thigh_backs", "back", "left_palm", "right_palm")
        ids = np.concatenate([body.regions[name] for name in names])
        points = body.posed(pose, transl, ids).vertices
        distance = data.rooms[int(windows.room[placement])].lookup.distance(points)
        assert float(distance.abs().min()) < CONTACT_M


def test_splits_share_no_clip_and_no_room(windows: PlacedWindows) -> None:
    clips, rooms = [], []
    for split in ("train", "held_out"):
        placed = windows.placed(split)  # type: ignore[arg-type]
        clips.append({windows.clips[k].name for k in windows.clip[windows.window[placed]]})
        rooms.append({windows.rooms[k].name for k in windows.room[placed]})
    assert clips[0] and clips[1] and not clips[0] & clips[1]
    assert rooms[0] and rooms[1] and not rooms[0] & rooms[1]


def test_route_windows_have_half_a_metre_of_way(windows: PlacedWindows) -> None:
    moving = windows.moving(windows.placed("train"))
    transl = windows.transl[windows.window[moving]]
    way = np.linalg.norm(transl[:, -1] - transl[:, 0], axis=1)
    assert len(moving) and way.min() >= MIN_WAY_M
    assert len(moving) < len(windows.placed("train"))


def test_capture_is_counted_before_augmentation_and_authored_clips_not_at_all(
    windows: PlacedWindows,
) -> None:
    captured = [n for n in windows.clips if n.kind == "captured" and n.split == "train"]
    seconds = 60 * windows.capture_minutes() - COMPOSED_CAPTURE_S
    assert seconds == pytest.approx(sum(note.seconds for note in captured))
    # a walk of some seconds on four bodies is still a walk of some seconds
    assert 2.0 < seconds < 8.0
    assert sum(windows.shares().values()) == pytest.approx(1.0)


def test_a_file_that_is_no_motion_is_named_and_left_out(windows: PlacedWindows) -> None:
    assert len(windows.unread) == 1
    assert windows.unread[0].startswith("shape:")
    assert [note.windows for note in windows.clips if note.name == "shape"] == [0]


def test_the_same_seed_gives_the_same_data(settings: DataSettings) -> None:
    small = dataclasses.replace(settings, walks=1, seats=1, touches=0, idles=0)
    one, two = (build_windows(small, (), lambda share: None) for _ in range(2))
    for name in ("pose", "transl", "window", "room", "yaw", "shift"):
        assert np.array_equal(getattr(one, name), getattr(two, name))


def test_a_file_of_windows_reads_back_whole(windows: PlacedWindows, tmp_path: Path) -> None:
    write_windows(windows, tmp_path / "windows.npz")
    found = read_windows(tmp_path / "windows.npz")
    for field in dataclasses.fields(PlacedWindows):
        one, two = getattr(windows, field.name), getattr(found, field.name)
        assert np.array_equal(one, two) if isinstance(one, np.ndarray) else one == two


def test_spun_points_turn_counter_clockwise_then_shift() -> None:
    points = np.array([[[1.0, 0.0, 0.5]], [[0.0, 2.0, 0.7]]])
    found = spun(points, np.array([np.pi / 2, np.pi]), np.array([[1.0, 1.0], [0.0, 0.0]]))
    assert np.allclose(found, [[[1.0, 2.0, 0.5]], [[0.0, -2.0, 0.7]]])


def test_a_room_turned_by_quarters_keeps_bodies_where_they_are_in_it(
    windows: PlacedWindows,
) -> None:
    data = TrainingSet(windows, "train")
    placement = windows.placed("train")[:1]
    room = int(windows.room[placement[0]])
    gaps = []
    for quarter in range(4):
        vector = data.vectors(placement, np.array([quarter]))[0, :1]
        pose, transl = to_pose(vector)
        body = figure_of(BODY_NAMES[data.body_of(placement)[0]]).body
        points = body.posed(pose, transl, body.subset).vertices[0]
        walls = data.room_points(room, quarter)
        assert walls.min() > -0.3
        gaps.append(torch.cdist(points[::10], walls))
    for gap in gaps[1:]:
        assert torch.allclose(gap, gaps[0], atol=1e-3)

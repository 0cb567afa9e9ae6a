"""Clips of the pool, the scenes built for them, and the labels that follow."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from experiments.body.embedded import load_body
from experiments.interaction import pose_recipes
from experiments.interaction.contact_holds import PosedClip, find_holds, posed_clip
from experiments.interaction.contact_labels import (
    DEEPEST_M,
    FURTHEST_M,
    LabelledFrames,
    in_scene,
    label_clip,
)
from experiments.interaction.contact_scene import Box, ContactScene
from experiments.interaction.contact_supports import FLOOR, LABEL, draw_scene
from experiments.interaction.pose_pool import (
    noised,
    pool_size,
    pool_sources,
    recordings,
)
from experiments.motion.figure import figure_of
from experiments.scene.scene import MPCAT40


@lru_cache(maxsize=8)
def clip_of(family: str, seed: int = 1) -> PosedClip:
    recipe, _ = pose_recipes.FAMILIES[family]
    motion = recipe(figure_of("male_slim"), np.random.default_rng(seed))
    return posed_clip(motion, load_body())


@lru_cache(maxsize=16)
def labelled(family: str, seed: int = 1) -> LabelledFrames:
    return label_clip(clip_of(family), 6, np.random.default_rng(seed))


def touched(found: LabelledFrames, columns: np.ndarray, metres: float = 0.02) -> set[str]:
    near = found.distance[:, columns] < metres
    return {MPCAT40[index] for index in np.unique(found.nearest[:, columns][near])}


def kinds(clip: PosedClip) -> set[str]:
    return {hold.kind for hold in find_holds(clip) if hold.stop - hold.start > 20}


@pytest.mark.parametrize(
    ("family", "expected"),
    [
        ("sit_thighs", "seated"), ("sit_perched", "seated"), ("lie_rolled", "lying"),
        ("lie_on_back", "lying"), ("palm_on_wall", "right_hand"), ("lean_top", "left_hand"),
        ("stand", "standing"),
    ],
)  # fmt: skip
def test_a_posture_is_found_as_what_it_is(family: str, expected: str) -> None:
    clip = clip_of(family, 0)
    either = {expected, expected.replace("right", "left")}
    assert either & kinds(clip)
    assert ("seated" in kinds(clip)) == (family.startswith("sit") or family == "lie_on_back")


@pytest.mark.parametrize("family", ["sit_thighs", "sit_table", "lean_top", "lie_rolled", "stand"])
def test_no_frame_kept_is_deep_inside_or_in_the_air(family: str) -> None:
    clip, found = clip_of(family), labelled(family)
    depth = found.scene.nearest(clip.vertices[found.frames])[2]
    assert len(found.frames) >= 0.8 * len(range(0, len(clip.times), 6))
    assert depth.max() <= DEEPEST_M
    assert (found.distance.min(1) <= FURTHEST_M).all()


def test_who_sits_touches_a_seat_with_the_seat() -> None:
    clip, found = clip_of("sit_thighs"), labelled("sit_thighs")
    seats = {"chair", "sofa", "bed", "stool", "seating", "toilet"}
    assert touched(found, clip.columns["buttocks"]) & seats
    assert touched(found, clip.columns["left_sole"]) == {"floor"}


def test_hands_that_work_at_a_table_touch_it() -> None:
    clip, found = clip_of("sit_table"), labelled("sit_table")
    assert touched(found, clip.columns["left_hand"]) <= {"table", "counter"}
    assert touched(found, clip.columns["left_hand"])


def test_palms_that_face_ahead_touch_something_upright() -> None:
    clip, found = clip_of("palm_on_wall"), labelled("palm_on_wall")
    hands = np.concatenate([clip.columns["left_hand"], clip.columns["right_hand"]])
    assert touched(found, hands) & {"wall", "door", "cabinet", "shelving"}


def test_who_lies_on_a_bed_lies_on_it_with_the_trunk() -> None:
    clip, found = clip_of("lie_on_back"), labelled("lie_on_back")
    assert touched(found, clip.columns["back"]) & {"bed", "sofa", "seating"}


def test_the_scene_is_one_for_the_whole_clip_and_follows_from_the_seed() -> None:
    again = label_clip(clip_of("sit_table"), 6, np.random.default_rng(1))
    first = labelled("sit_table")
    assert np.array_equal(again.distance, first.distance)
    other = label_clip(clip_of("sit_table"), 6, np.random.default_rng(2))
    assert not np.array_equal(other.distance, first.distance)
    rows = first.frames
    assert np.array_equal(
        first.scene.nearest(clip_of("sit_table").vertices[rows])[0], first.distance
    )


def test_a_sparing_scene_has_only_what_carries() -> None:
    clip = clip_of("sit_thighs")
    scenes = [draw_scene(clip, find_holds(clip), np.random.default_rng(s), True) for s in range(12)]
    assert {len(scene.solids) for scene in scenes} == {2}
    full = [draw_scene(clip, find_holds(clip), np.random.default_rng(s)) for s in range(12)]
    assert max(len(scene.solids) for scene in full) > 2


def test_a_hanging_body_is_dropped_not_labelled_untouched() -> None:
    clip, frame = clip_of("palm_on_wall"), 80
    up = np.array([0.0, 0.0, 0.3])
    raised = replace(clip, vertices=clip.vertices + up)
    hands = np.concatenate([clip.columns["left_hand"], clip.columns["right_hand"]])
    foremost = raised.vertices[frame, hands[raised.vertices[frame, hands, 1].argmin()]]
    bar = Box(foremost, np.full(3, 0.02), np.eye(3), LABEL["shelving"])
    frames = np.array([frame])
    assert bar.signed(raised.vertices[frame, hands]).min() < 0.02
    assert len(in_scene(raised, ContactScene((FLOOR, bar)), frames).frames) == 0
    assert len(in_scene(clip, ContactScene((FLOOR,)), frames).frames) == 1


def test_constant_noise_turns_every_joint_alike_in_all_frames() -> None:
    recipe, _ = pose_recipes.FAMILIES["stand"]
    motion = recipe(figure_of("male_slim"), np.random.default_rng(0))
    frozen = replace(motion, pose=np.repeat(motion.pose[:1], motion.n_frames, axis=0))
    noisy = noised(frozen, np.random.default_rng(1))
    assert np.ptp(noisy.pose, axis=0).max() == pytest.approx(0.0, abs=1e-12)
    assert np.abs(noisy.pose - frozen.pose).max() > 0.02


def test_no_clip_is_in_both_halves_and_every_family_is_held_out_once() -> None:
    halves = {
        half: {s.name for s in pool_sources() if s.split == half} for half in ("train", "test")
    }
    assert not halves["train"] & halves["test"]
    assert pool_size() == pool_size("train") + pool_size("test")
    assert set(pose_recipes.FAMILIES) <= {name.rsplit("_", 1)[0] for name in halves["test"]}
    assert {recording.name for recording in recordings() if recording.test} <= halves["test"]


def test_versions_of_a_clip_share_its_parameters_and_differ_in_body() -> None:
    sources = [source for source in pool_sources() if source.name == "stand_00"]
    clips = [source.build(np.random.default_rng(5)) for source in sources]
    assert [clip.name for clip in clips] == ["stand_00/0", "stand_00/1", "stand_00/2"]
    assert len({clip.body for clip in clips}) == 3
    assert len({clip.motion.n_frames for clip in clips}) == 1

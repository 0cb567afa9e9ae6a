"""Fairness lint: what may differ between two compared clips, and what may not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from renderer.catalogue import Catalogue, Clip
from renderer.files import file_sha256
from renderer.lint import fairness_faults, fairness_warnings
from renderer.video import write_video


def write_clip(folder, clip_id: str, method: str, shade: int, n_frames: int = 12, size=(64, 48)):
    """Encode a clip and describe it as a catalogue does."""
    rng = np.random.default_rng(shade)
    frames = [rng.integers(0, 255, (size[1] // 8, size[0] // 8, 3), dtype=np.uint8)
              for _ in range(n_frames)]  # fmt: skip
    frames = [np.kron(f, np.ones((8, 8, 1), np.uint8)) for f in frames]
    target = folder / f"{clip_id}.mp4"
    made = write_video(frames, target, size, 30.0)
    return Clip(
        clip_id=clip_id, file=target.name, sha256=file_sha256(target),
        frames_sha256=made.frames_sha256, poster="p.jpg", role="main", method=method,
        scene="bedroom", motion="walk", views=("view-1",), tiling="grid", fps=30.0,
        n_frames=n_frames, duration_s=n_frames / 30, width=size[0], height=size[1],
        codec="h264", scores={}, placement="",
    )  # fmt: skip


def catalogue(*clips: Clip, rigs: int = 1) -> Catalogue:
    rig = {"role": "main", "scene": "bedroom", "motion": "walk", "views": []}
    return Catalogue("set", "2026", {}, (), (), ({"name": "pace"}, {"name": "posa_t"}),
                     (rig,) * rigs, clips)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("set")


@pytest.fixture(scope="module")
def pair(folder):
    return write_clip(folder, "aa11", "pace", 1), write_clip(folder, "bb22", "posa_t", 2)


def test_a_fair_pair_has_no_faults(pair, folder):
    assert fairness_faults(catalogue(*pair), folder) == []


@pytest.mark.parametrize(
    ("field", "value"),
    [("fps", 25.0), ("n_frames", 13), ("width", 66), ("codec", "vp9"), ("tiling", "strip"),
     ("views", ("view-2",)), ("duration_s", 0.5)],
)  # fmt: skip
def test_any_difference_but_the_motion_is_a_fault(pair, folder, field, value):
    other = dataclasses.replace(pair[1], **{field: value})
    faults = fairness_faults(catalogue(pair[0], other), folder)
    assert any(f"main clips of bedroom | walk: {field}: clip aa11" in line for line in faults)


def test_a_file_that_is_not_what_the_catalogue_says_is_a_fault(folder, pair):
    longer = write_clip(folder, "cc33", "posa_t", 3, n_frames=14)
    lying = dataclasses.replace(longer, n_frames=12, duration_s=0.4)
    faults = fairness_faults(catalogue(pair[0], lying), folder)
    assert any("n_frames: file has 14, catalogue 12" in line for line in faults)


def test_two_methods_that_show_the_same_frames_are_a_fault(folder, pair):
    twin = write_clip(folder, "dd44", "posa_t", 1)
    faults = fairness_faults(catalogue(pair[0], twin), folder)
    assert faults == ["main clips of bedroom | walk: clips aa11 and dd44 show the same frames"]


def test_a_pair_needs_one_rig(pair, folder):
    for rigs in (0, 2):
        (fault,) = fairness_faults(catalogue(*pair, rigs=rigs), folder)
        assert f"cameras: {rigs} rigs, wanted one" in fault


def test_a_file_name_that_tells_the_method_is_a_fault(folder, pair):
    telling = write_clip(folder, "clip_posa_t", "posa_t", 5)
    faults = fairness_faults(catalogue(pair[0], telling), folder)
    assert len(faults) == 1 and "tells the method 'posa_t'" in faults[0]


def test_a_missing_or_broken_file_is_one_fault(folder, pair):
    gone = dataclasses.replace(pair[1], file="gone.mp4")
    (fault,) = fairness_faults(catalogue(pair[0], gone), folder)
    assert "clip bb22" in fault and "missing" in fault


def test_a_file_much_larger_than_its_partner_only_warns(folder, pair):
    still = write_clip(folder, "ee55", "posa_t", 7)
    plain = [np.full((48, 64, 3), 90, np.uint8)] * 12
    made = write_video(plain, folder / "ee55.mp4", (64, 48), 30.0)
    still = dataclasses.replace(still, frames_sha256=made.frames_sha256)
    chosen = catalogue(pair[0], still)
    assert fairness_faults(chosen, folder) == []
    assert len(fairness_warnings(chosen, folder)) == 1
    assert fairness_warnings(catalogue(*pair), folder) == []

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.weighting.thinning import kept_frames, kept_weights
from experiments.weighting.weights import FrameWeights


def clip(seed: int, n_frames: int, fps: float) -> tuple[np.ndarray, np.ndarray]:
    weights = np.random.default_rng(seed).gamma(0.3, size=n_frames) + 1e-6
    return np.arange(n_frames) / fps, weights


@given(
    st.integers(0, 10_000), st.integers(40, 700), st.sampled_from([31.0, 59.94, 60, 100, 120, 240])
)
@settings(max_examples=60, deadline=None)
def test_thinning_keeps_ends_and_leaves_no_gap_and_thirty_frames_a_second(
    seed: int, n_frames: int, fps: float
) -> None:
    times, weights = clip(seed, n_frames, fps)
    kept = kept_frames(times, weights)
    assert kept[0] == 0 and kept[-1] == n_frames - 1
    assert (np.diff(kept) > 0).all()
    assert np.diff(times[kept]).max() <= 0.1 + 1e-5
    assert len(kept) / (n_frames / fps) >= 30.0 - 1e-6


@given(st.integers(0, 10_000), st.integers(40, 500))
@settings(max_examples=30, deadline=None)
def test_a_dropped_frame_never_outweighs_one_kept_for_its_weight(seed: int, n_frames: int) -> None:
    times, weights = clip(seed, n_frames, 120.0)
    kept = kept_frames(times, weights)
    wanted = int(np.ceil(n_frames / 4)) - 2
    inner = np.setdiff1d(kept, [0, n_frames - 1])
    dropped = np.setdiff1d(np.arange(n_frames), kept)
    strongest = np.sort(weights[inner])[::-1][:wanted]
    assert weights[dropped].max() <= strongest.min()


def test_a_gap_is_filled_by_the_strongest_frame_of_its_middle_third() -> None:
    times, weights = np.arange(31) / 120, np.zeros(31)
    weights[[1, 2, 3, 4, 5, 6]] = 1.0
    weights[[12, 22, 25]] = 0.5
    # The quarter kept is 0 to 6 and 30. The middle third of that gap is 14 to 22, so 22 is added;
    # the gap from 6 to 22 is still too long, the middle third of it is 12 to 16.
    assert kept_frames(times, weights).tolist() == [0, 1, 2, 3, 4, 5, 6, 12, 22, 30]


def test_frames_that_count_alike_are_kept_evenly() -> None:
    kept = kept_frames(np.arange(257) / 120, np.ones(257))
    assert np.diff(kept).max() <= 4 and np.diff(kept).min() >= 2


@pytest.mark.parametrize("fps", [10.0, 24.0, 25.0, 30.0])
def test_clips_of_thirty_frames_a_second_are_left_alone(fps: float) -> None:
    times, weights = clip(1, 90, fps)
    assert np.array_equal(kept_frames(times, weights), np.arange(90))


def test_a_gap_of_the_recording_itself_stays() -> None:
    times = np.concatenate([np.arange(60) / 120, 1.0 + np.arange(60) / 120])
    kept = kept_frames(times, np.ones(120))
    assert np.sort(np.diff(times[kept]))[-1] == pytest.approx(1.0 - 59 / 120)
    assert np.sort(np.diff(times[kept]))[-2] <= 0.1 + 1e-6


def test_kept_weights_have_mean_one_and_keep_their_ratios() -> None:
    weights = FrameWeights(np.array([0.5, 2.0, 1.0, 0.5]), "test")
    kept = kept_weights(weights, np.array([0, 1, 3]))
    assert kept.values == pytest.approx([0.5, 2.0, 0.5])
    assert kept.values.mean() == pytest.approx(1.0) and kept.rule == "test"

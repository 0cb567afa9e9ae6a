"""Training on made-up clips whose weights follow from what the network sees."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from scipy.stats import spearmanr

from experiments.weighting.geometric import FrameCues
from experiments.weighting.report import agreement, held_out_report, report_markdown
from experiments.weighting.training import (
    TrainingSettings,
    begin_run,
    crop,
    train_network,
    weight_bins,
)
from experiments.weighting.training_clips import (
    TrainingClip,
    read_clip,
    warp_times,
    write_clip,
)
from experiments.weighting.weights_file import load_network, network_metadata
from renderer.files import InputError

SETTINGS = TrainingSettings("geometric", seed=1, epochs=6, learning_rate=3e-3)


@pytest.fixture(scope="module")
def made_up(some_inputs) -> list[TrainingClip]:
    """Six clips of 200 frames, two of them held out; speed is written into the velocities."""
    clips = []
    for index in range(6):
        speed = np.random.default_rng(index).uniform(0.0, 2.0, 200)
        inputs = dataclasses.replace(
            some_inputs(200, index), velocity=torch.as_tensor(speed).float()[:, None].repeat(1, 66)
        )
        cues = FrameCues(speed, np.tile(np.eye(42)[2], (200, 1)), np.zeros(200))
        clips.append(TrainingClip(str(index), False, index < 2, inputs, cues))
    return clips


def test_training_learns_what_can_be_seen_and_leaves_the_clips_held_out(made_up, tmp_path) -> None:
    run = train_network(made_up, dataclasses.replace(SETTINGS, epochs=15), tmp_path)
    assert run.curve[-1]["loss"] < 0.9 * run.curve[0]["loss"]
    rows = {row["predictor"]: row for row in held_out_report(run.network, made_up)}
    assert rows["network g"]["spearman_all"] > 0.9
    assert rows["network g"]["mae_all"] < 0.6 * rows["constant"]["mae_all"]
    assert rows["own speed rank"]["spearman_all"] == pytest.approx(1.0)
    assert "| network g | " in report_markdown(list(rows.values()))


def test_a_run_that_was_stopped_ends_as_if_it_had_not_been(made_up, tmp_path) -> None:
    whole = train_network(made_up, SETTINGS, tmp_path / "whole")

    def stop(done: int, total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_network(made_up, SETTINGS, tmp_path / "parts", stop)
    parts = train_network(made_up, SETTINGS, tmp_path / "parts")
    assert parts.curve == whole.curve
    for name, value in whole.network.state_dict().items():
        assert torch.equal(parts.network.state_dict()[name], value)


def test_a_folder_of_other_settings_is_refused(made_up, tmp_path) -> None:
    train_network(made_up, dataclasses.replace(SETTINGS, epochs=1), tmp_path)
    with pytest.raises(InputError, match="settings"):
        train_network(made_up, dataclasses.replace(SETTINGS, epochs=1, seed=9), tmp_path)


def test_the_file_says_what_it_was_trained_on(made_up, tmp_path) -> None:
    train_network(made_up, dataclasses.replace(SETTINGS, epochs=1), tmp_path)
    about = network_metadata(tmp_path / "paak.safetensors")
    assert about["seed"] == "1" and about["interaction"] == "geometric"
    assert about["training_clips"] == "4"
    assert load_network(tmp_path / "paak.safetensors").centres.shape == (8,)


def test_seeded_weights_leave_the_global_generator_alone() -> None:
    before = torch.random.get_rng_state()
    first, second = (begin_run(np.ones(8), SETTINGS).network for _ in range(2))
    assert torch.equal(first.head.weight, second.head.weight)
    assert torch.equal(torch.random.get_rng_state(), before)


def test_bins_hold_equal_numbers_and_their_centres_are_means() -> None:
    edges, centres = weight_bins([np.arange(16.0)])
    assert np.searchsorted(edges, np.arange(16.0), side="right").tolist() == sorted([*range(8)] * 2)
    assert centres.tolist() == [0.5, 2.5, 4.5, 6.5, 8.5, 10.5, 12.5, 14.5]


def test_crops_last_two_to_six_seconds_and_stay_inside(made_up) -> None:
    parts = [crop(made_up[0], generator) for generator in np.random.default_rng(0).spawn(300)]
    lengths = [part.stop - part.start for part in parts]
    assert min(lengths) >= 60 and max(lengths) <= 180
    assert min(part.start for part in parts) == 0 and max(part.stop for part in parts) == 200


def test_a_part_of_a_clip_is_weighed_as_a_clip_of_its_own(made_up) -> None:
    cues = made_up[0].cues
    alone = FrameCues(cues.speed[10:40], cues.histogram[10:40], cues.strength[10:40])
    assert np.array_equal(cues.weights(slice(10, 40)), alone.weights())


def test_a_clip_survives_its_file(made_up, tmp_path) -> None:
    write_clip(made_up[0], tmp_path / "clip.npz")
    back = read_clip(tmp_path / "clip.npz")
    assert (back.name, back.captured, back.held_out) == ("0", False, True)
    assert torch.equal(back.inputs.points, made_up[0].inputs.points)
    assert torch.equal(back.inputs.classes, made_up[0].inputs.classes)
    assert np.array_equal(back.cues.weights(), made_up[0].cues.weights())


def test_warped_time_runs_forward_from_start_to_end_at_the_speeds_allowed() -> None:
    times = np.arange(90) / 30.0
    warped = warp_times(times, np.random.default_rng(4))
    speed = np.diff(warped) * 30.0
    assert warped[0] == 0.0 and times[-1] - warped[-1] < 0.06
    assert speed.min() > 1 / 3 - 1e-6 and speed.max() < 1.5 + 1e-6


def test_agreement_is_mean_error_and_rank_correlation() -> None:
    guess, target = np.array([1.0, 2.0, 4.0, 3.0]), np.array([1.0, 2.0, 3.0, 5.0])
    error, rho = agreement(guess, target)
    assert error == 0.75 and rho == pytest.approx(0.8)
    assert rho == pytest.approx(float(spearmanr(target, guess).statistic))
    assert agreement(np.ones(4), target)[1] == 0.0

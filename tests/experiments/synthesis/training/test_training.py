"""Training: the loss falls, an interrupted run ends like an uninterrupted one, runs do not mix."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from experiments.synthesis import training
from experiments.synthesis.placed_windows import PlacedWindows
from experiments.synthesis.route_net import RouteNet
from experiments.synthesis.subgoal_net import SubgoalNet
from experiments.synthesis.tasks import RouteTask, SubgoalTask
from experiments.synthesis.training import Plan, train_task
from experiments.synthesis.training_set import QUARTERS, TrainingSet, quarter_turns
from experiments.synthesis.weights import KINDS, read_note, weights_file
from renderer.files import InputError

PLAN = Plan(epochs=(16, 2, 1), batch=32)


@pytest.fixture(scope="module")
def finished(windows: PlacedWindows, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of an uninterrupted run."""
    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "CHECKPOINT_STEPS", 5)
        training.train_synthesis(windows, PLAN, folder, False)
    return folder


def test_training_and_held_out_errors_of_the_route_fall(finished: Path) -> None:
    rows = np.loadtxt(finished / "route.csv", delimiter=",", skiprows=1)
    steps, train, held_out = rows[:, 0], rows[:, 2], rows[:, 3]
    assert np.all(np.diff(steps) > 0)
    assert train[-1] < 0.7 * train[0]
    assert held_out[-1] < held_out[0]


def test_an_interrupted_run_ends_with_the_weights_of_an_uninterrupted_one(
    finished: Path, windows: PlacedWindows, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training, "CHECKPOINT_STEPS", 5)
    reports = []

    def interrupt(share: float) -> None:
        reports.append(share)
        if share > 0.1:
            raise KeyboardInterrupt

    for moment in (interrupt, _after(0.5), _after(0.8), lambda share: None):
        resume = bool(reports)
        try:
            training.train_synthesis(windows, PLAN, tmp_path, resume, moment)
        except KeyboardInterrupt:
            continue
    for kind in KINDS:
        one, two = (load_file(weights_file(kind, folder)) for folder in (finished, tmp_path))
        assert all(torch.equal(one[name], two[name]) for name in one)
        assert (finished / f"{kind}.csv").read_text() == (tmp_path / f"{kind}.csv").read_text()


def test_a_folder_of_another_run_is_refused(finished: Path, windows: PlacedWindows) -> None:
    with pytest.raises(InputError, match="--resume"):
        training.train_synthesis(windows, PLAN, finished, False)
    other = dataclasses.replace(PLAN, seed=1)
    with pytest.raises(InputError, match="the plan of the run to resume"):
        training.train_synthesis(windows, other, finished, True)


def test_a_damaged_checkpoint_is_refused_by_name(windows: PlacedWindows, tmp_path: Path) -> None:
    data = TrainingSet(windows, "train")
    (tmp_path / "route.checkpoint.safetensors").write_bytes(b"nothing of the kind")
    task = RouteTask(RouteNet(), data, data, 4)
    with pytest.raises(InputError, match="a checkpoint of this run"):
        train_task(task, PLAN, 0, tmp_path, lambda share: None)


def test_weights_say_how_much_capture_they_have_seen(
    finished: Path, windows: PlacedWindows
) -> None:
    note = read_note(weights_file("pose", finished))
    assert note.capture_minutes == pytest.approx(windows.capture_minutes())
    assert (note.seed, note.recipe) == (0, training.RECIPE)


def test_the_same_step_draws_the_same_batch_and_the_next_another(windows: PlacedWindows) -> None:
    data = TrainingSet(windows, "train")
    task = RouteTask(RouteNet(), data, data, 8)
    task.features.refresh(task.net.scene)
    with torch.no_grad():
        one, again, other = (float(task.loss(seed, 0.0)) for seed in ((0, 3), (0, 3), (0, 4)))
    assert one == again != other


def test_the_sub_goal_loss_reaches_every_weight(windows: PlacedWindows) -> None:
    data = TrainingSet(windows, "train")
    net = SubgoalNet()
    task = SubgoalTask(net, data, data, 8)
    task.features.refresh(net.scene)
    task.loss((0, 0), 1.0).backward()  # type: ignore[no-untyped-call]
    untouched = [n for n, p in net.named_parameters() if p.grad is None or not p.grad.abs().any()]
    # a bias before a normalisation that takes the mean away does nothing
    assert [name for name in untouched if not name.startswith("scene.")] == []


def test_quarter_turns_keep_the_room_s_corner_at_the_origin() -> None:
    size = np.array([[4.0, 6.0]] * QUARTERS)
    spin, shift = quarter_turns(np.arange(QUARTERS), size)
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 6.0], [0.0, 6.0]])
    for quarter in range(QUARTERS):
        c, s = np.cos(spin[quarter]), np.sin(spin[quarter])
        moved = corners @ np.array([[c, s], [-s, c]]) + shift[quarter, :2]
        wide = (4.0, 6.0) if quarter % 2 == 0 else (6.0, 4.0)
        assert np.allclose(moved.min(axis=0), 0.0) and np.allclose(moved.max(axis=0), wide)


def _after(share: float) -> Callable[[float], None]:
    def stop(done: float) -> None:
        if done > share:
            raise KeyboardInterrupt

    return stop

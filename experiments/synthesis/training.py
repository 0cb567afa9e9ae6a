"""Training of the three networks: seeded steps, checkpoints to resume from, learning curves."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from experiments.synthesis.placed_windows import PlacedWindows
from experiments.synthesis.pose_net import PoseNet
from experiments.synthesis.route_net import RouteNet
from experiments.synthesis.subgoal_net import SubgoalNet
from experiments.synthesis.tasks import PoseTask, RouteTask, SubgoalTask, Task
from experiments.synthesis.training_set import TrainingSet
from experiments.synthesis.weights import (
    Kind,
    SynthesisNets,
    TrainingNote,
    load_nets,
    weights_file,
    write_weights,
)
from renderer.files import InputError, atomic_path, read_json, write_json

Net = TypeVar("Net", bound=nn.Module)
RECIPE = "synthesis-1"
"""Version of data and training, kept in the weights files."""
LAST_RATE = 0.05
"""Share of the learning rate at the end of its cosine."""
CHECKPOINT_STEPS = 200
ORDER: tuple[Kind, ...] = ("route", "pose", "subgoal")
"""PoseNet learns from RouteNet's predictions, so RouteNet comes first."""


@dataclass(frozen=True)
class Plan:
    """How long and how fast the networks learn."""

    seed: int = 0
    epochs: tuple[int, int, int] = (30, 25, 20)
    """Of RouteNet, PoseNet and the sub-goal network."""
    rates: tuple[float, float, float] = (1e-3, 1e-3, 5e-4)
    batch: int = 64
    device: str = "cpu"


@dataclass(frozen=True)
class CurveRow:
    """One line of a learning curve."""

    step: int
    epoch: float
    train: float
    """Mean training loss since the row before."""
    held_out: float


def train_synthesis(
    data: PlacedWindows,
    plan: Plan,
    folder: Path,
    resume: bool,
    on_step: Callable[[float], None] = lambda share: None,
) -> tuple[dict[Kind, list[CurveRow]], SynthesisNets]:
    """Train the three networks into `folder` and write their weights; returns curves and networks.

    A network with no epochs keeps its first, random weights.

    Interrupted, it goes on from its last checkpoints when called again with `resume`, and ends with
    the weights of an uninterrupted run. Raises `InputError` if `folder` holds another run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _check_plan(folder, plan, data, resume)
    device = torch.device(plan.device)
    train, held = TrainingSet(data, "train", device), TrainingSet(data, "held_out", device)
    curves: dict[Kind, list[CurveRow]] = {}
    note = TrainingNote(RECIPE, plan.seed, data.capture_minutes())
    route = _seeded(RouteNet, plan.seed).to(device)
    for index, kind in enumerate(ORDER):
        task = _task(kind, route, train, held, plan)

        def on_share(share: float, done: int = index) -> None:
            on_step((done + share) / len(ORDER))

        curves[kind] = train_task(task, plan, index, folder, on_share)
        write_weights(task.net, kind, note, weights_file(kind, folder))
    return curves, load_nets(folder)


def train_task(
    task: Task, plan: Plan, index: int, folder: Path, on_step: Callable[[float], None]
) -> list[CurveRow]:
    """Train one network from its checkpoint, if there is one, to its last step."""
    per_epoch = max(1, math.ceil(task.items / task.batch))
    total = plan.epochs[index] * per_epoch
    optimiser = torch.optim.Adam(task.net.parameters(), lr=plan.rates[index], fused=True)
    keeper = _Checkpoint(task, optimiser, folder)
    step, rows = keeper.load()
    losses: list[float] = []
    while step < total:
        share = LAST_RATE + (1 - LAST_RATE) * 0.5 * (1 + math.cos(math.pi * step / total))
        optimiser.param_groups[0]["lr"] = plan.rates[index] * share
        optimiser.zero_grad()
        loss = task.loss((plan.seed, step), step / per_epoch)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        step += 1
        losses.append(float(loss.detach()))
        if step % CHECKPOINT_STEPS == 0 or step == total:
            mean = sum(losses) / len(losses)
            rows.append(CurveRow(step, step / per_epoch, mean, task.held_out()))
            losses = []
            keeper.save(step, rows)
        on_step(step / total)
    return rows


class _Checkpoint:
    """Network, optimiser and kept room features of one task, with its curve, in two files."""

    def __init__(self, task: Task, optimiser: torch.optim.Adam, folder: Path) -> None:
        self.task, self.optimiser = task, optimiser
        self.names = [name for name, _ in task.net.named_parameters()]
        self.tensors = folder / f"{task.kind}.checkpoint.safetensors"
        self.curve = folder / f"{task.kind}.csv"

    def save(self, step: int, rows: list[CurveRow]) -> None:
        """Curve first: rows behind the step of the tensors are dropped when loading."""
        _write_curve(self.curve, rows)
        state = self.optimiser.state_dict()["state"]
        values = {f"net.{k}": v.detach() for k, v in self.task.net.state_dict().items()}
        for index, name in enumerate(self.names):
            values[f"first.{name}"] = state[index]["exp_avg"]
            values[f"second.{name}"] = state[index]["exp_avg_sq"]
        values["features"] = self.task.features.table
        with atomic_path(self.tensors) as temporary:
            whole = {name: value.cpu().contiguous() for name, value in values.items()}
            save_file(whole, temporary, {"step": str(step)})

    def load(self) -> tuple[int, list[CurveRow]]:
        """Step and curve of the checkpoint; without one, fresh room features and step 0."""
        if not self.tensors.is_file():
            self.task.features.refresh(self.task.net.scene)
            return 0, []
        try:
            with safe_open(self.tensors, framework="pt") as archive:
                step = int(archive.metadata()["step"])
                values = {name: archive.get_tensor(name) for name in archive.keys()}  # noqa: SIM118
            self._fill(values, step)
        except (SafetensorError, KeyError, RuntimeError, ValueError) as error:
            raise InputError(
                self.tensors, "content", str(error), "a checkpoint of this run"
            ) from None
        return step, [row for row in _read_curve(self.curve) if row.step <= step]

    def _fill(self, values: dict[str, Tensor], step: int) -> None:
        net = {k.removeprefix("net."): v for k, v in values.items() if k.startswith("net.")}
        self.task.net.load_state_dict(net)
        self.task.features.table.copy_(values["features"])
        state = {
            index: {
                "step": torch.tensor(float(step)),
                "exp_avg": values[f"first.{name}"],
                "exp_avg_sq": values[f"second.{name}"],
            }
            for index, name in enumerate(self.names)
        }
        groups = self.optimiser.state_dict()["param_groups"]
        self.optimiser.load_state_dict({"state": state, "param_groups": groups})


def _task(kind: Kind, route: RouteNet, train: TrainingSet, held: TrainingSet, plan: Plan) -> Task:
    device = torch.device(plan.device)
    if kind == "route":
        return RouteTask(route, train, held, plan.batch)
    if kind == "pose":
        net = _seeded(PoseNet, plan.seed).to(device)
        return PoseTask(net, route, train, held, plan.batch)
    return SubgoalTask(_seeded(SubgoalNet, plan.seed).to(device), train, held, plan.batch)


def _seeded(make: Callable[[], Net], seed: int) -> Net:
    """A network whose first weights depend on the seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return make()


def _check_plan(folder: Path, plan: Plan, data: PlacedWindows, resume: bool) -> None:
    """A folder holds one run: refuse to mix two, or to overwrite one unasked."""
    path = folder / "plan.json"
    size = {"windows": len(data.pose), "placements": len(data.window)}
    wanted = json.loads(json.dumps({**dataclasses.asdict(plan), "recipe": RECIPE, **size}))
    if not path.is_file():
        write_json(path, wanted)
        return
    if not resume:
        raise InputError(folder, "out", "a training run", "an empty folder, or --resume")
    found = read_json(path)
    if found != wanted:
        raise InputError(path, "plan", found, f"{wanted}, the plan of the run to resume")


def _write_curve(path: Path, rows: list[CurveRow]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f.name for f in dataclasses.fields(CurveRow)])
    writer.writerows(dataclasses.astuple(row) for row in rows)
    with atomic_path(path) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")


def _read_curve(path: Path) -> list[CurveRow]:
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    return [
        CurveRow(int(row["step"]), float(row["epoch"]), float(row["train"]), float(row["held_out"]))
        for row in rows
    ]

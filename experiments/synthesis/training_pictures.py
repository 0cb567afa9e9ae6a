"""Pictures of a training run: learning curves, held-out routes from above, bodies at sub-goals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from experiments.body.embedded import BODY_NAMES, load_body
from experiments.body.model import PARENTS
from experiments.synthesis.body_vector import to_pose
from experiments.synthesis.held_out_scores import predicted_segments, spread
from experiments.synthesis.subgoal_net import LATENT_SIZE
from experiments.synthesis.subgoal_scores import sampled_bodies
from experiments.synthesis.training import CurveRow
from experiments.synthesis.training_rooms import training_scene
from experiments.synthesis.training_set import TrainingSet
from experiments.synthesis.weights import Kind, SynthesisNets
from renderer.files import atomic_path

_LEVELS = np.arange(0.3, 1.7, 0.1)


def draw_curves(curves: dict[Kind, list[CurveRow]], target: Path) -> None:
    """Training loss and held-out error of every network over the steps."""
    figure, axes = _figure(1, 3, (12.0, 3.6))
    for axis, (kind, rows) in zip(axes, curves.items(), strict=True):
        steps = [row.step for row in rows]
        axis.plot(steps, [row.train for row in rows], label="training loss")
        axis.plot(steps, [row.held_out for row in rows], label="held-out reconstruction")
        axis.set(title=kind, xlabel="step", yscale="log")
    axes[0].legend()
    _save(figure, target)


def draw_routes(nets: SynthesisNets, held: TrainingSet, target: Path, count: int = 8) -> None:
    """Held-out routes from above: recorded black, RouteNet's red, on the room's clearance."""
    chosen = spread(held.moving, count)
    segments = predicted_segments(nets, held, chosen)
    figure, axes = _figure(2, (count + 1) // 2, (4.0 * ((count + 1) // 2), 8.0))
    for row, (axis, room) in enumerate(
        zip(axes.ravel(), held.room_of(chosen).tolist(), strict=False)
    ):
        _draw_room(axis, held.rooms[room].name)
        true, route = segments.true[row], segments.route[row]
        axis.plot(true[:, 0], true[:, 1], "k", lw=2)
        axis.plot(true[[0, 61], 0], true[[0, 61], 1], "ko", ms=5)
        axis.plot(route[:, 0], route[:, 1], "r", lw=2)
    _save(figure, target)


def draw_poses(nets: SynthesisNets, held: TrainingSet, target: Path, count: int = 4) -> None:
    """Stick figures of held-out segments: recorded grey, the networks' red; time runs to the right."""
    segments = predicted_segments(nets, held, spread(held.moving, count + 2)[1:-1])
    made = torch.cat([segments.route, segments.pose], dim=-1)
    figure, axes = _figure(count, 1, (11.0, 2.4 * count))
    body = load_body("male_slim")
    for row, axis in enumerate(axes):
        for place, frame in enumerate(range(4, 60, 8)):
            pairs = ((segments.true[row, frame + 1], "0.6"), (made[row, frame], "tab:red"))
            for vector, colour in pairs:
                _, joints = body.joint_transforms(*to_pose(vector[None]))
                points = joints[0].numpy() - joints[0, :1].numpy() * np.array([1.0, 1.0, 0.0])
                for joint, parent in enumerate(PARENTS):
                    if parent >= 0:
                        bone = points[[parent, joint]]
                        across = 0.7 * bone[:, 0] + 0.7 * bone[:, 1]
                        axis.plot(place + across, bone[:, 2], color=colour, lw=1.5)
        axis.set(aspect="equal", xticks=[], ylim=(-0.1, 1.9))
    _save(figure, target)


def draw_bodies(nets: SynthesisNets, held: TrainingSet, target: Path, count: int = 8) -> None:
    """Held-out still bodies from the side: recorded or authored grey, a sample of the network red."""
    rng = np.random.default_rng(1)
    placements, frames = held.subgoals(rng, count)
    vectors = held.vectors(placements, np.zeros(count, dtype=np.int64))
    body = vectors[torch.arange(count), torch.as_tensor(frames)]
    latent = torch.from_numpy(rng.standard_normal((count, LATENT_SIZE))).float()
    sample = sampled_bodies(nets.subgoal, held, placements, body, latent)
    figure, axes = _figure(2, count // 2, (3.0 * (count // 2), 6.4))
    for row, axis in enumerate(axes.ravel()):
        name = BODY_NAMES[int(held.body_of(placements)[row])]
        points = held.rooms[int(held.room_of(placements)[row])].points.numpy()
        here = np.linalg.norm(points[:, :2] - body[row, :2].numpy(), axis=1) < 0.9
        axis.plot(points[here, 0], points[here, 2], ".", color="tab:blue", ms=1)
        for values, colour in ((body, "0.4"), (sample, "tab:red")):
            skin = _skin(name, values[row : row + 1])
            axis.plot(skin[:, 0], skin[:, 2], ".", color=colour, ms=1.5)
        axis.set(aspect="equal", ylim=(-0.1, 2.0))
    _save(figure, target)


def _skin(name: str, vectors: Float[torch.Tensor, "1 135"]) -> Float[np.ndarray, "V 3"]:
    body = load_body(name)
    pose, transl = to_pose(vectors)
    with torch.no_grad():
        return np.asarray(body.posed(pose, transl, body.subset).vertices[0].double().numpy())


def _draw_room(axis: Any, name: str) -> None:
    """Smallest signed distance over the height of a person, as a map."""
    volumes = training_scene(name).volumes
    levels = np.round((_LEVELS - volumes.origin[2]) / volumes.cell).astype(int)
    low = np.array(volumes.origin[:2])
    high = low + volumes.cell * (np.array(volumes.sdf.shape[:2]) - 1)
    extent = (low[0], high[0], low[1], high[1])
    clearance = volumes.sdf[:, :, levels].min(axis=2).T
    axis.imshow(clearance, origin="lower", extent=extent, cmap="Blues_r", vmin=-0.2, vmax=0.6)
    axis.set(title=name, xticks=[], yticks=[])


def _figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Any, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns)


def _save(figure: Any, target: Path) -> None:
    with atomic_path(target) as temporary:
        figure.savefig(temporary, dpi=90, format="png")

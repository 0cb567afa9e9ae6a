"""From fits of several starts to the Placement that a method answers with."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from experiments.placement.errors import NoAdmissibleStart, OptimisationFailed
from experiments.placement.placement import Placement
from experiments.placement.problem import Problem
from experiments.placement.rigid import move_motion
from experiments.placement.solver import Fit, altered_bodies


def best_fit(problem: Problem, fits: Sequence[Fit]) -> Fit:
    """The fit of lowest energy that does not leave the body deep inside something.

    Raises `NoAdmissibleStart` if all do, `OptimisationFailed` if no energy is finite.
    """
    motion, scene = problem.motion.motion_id, problem.scene.scene_id
    finite = [fit for fit in fits if math.isfinite(fit.energy)]
    if not finite:
        raise OptimisationFailed(motion, scene, "no start reached a finite energy")
    limit = problem.settings.max_depth
    depths = [deepest_vertex(problem, fit) for fit in finite]
    clear = [
        fit for fit, depth in zip(finite, depths, strict=True) if limit is None or depth <= limit
    ]
    if not clear:
        reason = f"every start leaves the body {min(depths):.2f} m or more inside something"
        raise NoAdmissibleStart(motion, scene, reason)
    return min(clear, key=lambda fit: fit.energy)


def deepest_vertex(problem: Problem, fit: Fit) -> float:
    """How deep the deepest vertex without contact is inside anything, over all frames, metres."""
    placed = torch.tensor([fit.yaw, *fit.translation], dtype=problem.k.dtype)
    with torch.no_grad():
        bodies = altered_bodies(problem, placed, fit.delta, fit.shift)
        depth = -problem.field.distance(bodies, problem.contact)
    return float(depth[~problem.contact].max().clamp(min=0.0))


def to_placement(
    problem: Problem, fits: Sequence[Fit], method: str, seed: int, info: dict[str, Any]
) -> Placement:
    """The best fit as a record: the placed motion, its terms, and what it cost to find."""
    fit = best_fit(problem, fits)
    delta, shift = fit.delta.double().numpy(), fit.shift.double().numpy()
    motion = dataclasses.replace(
        problem.motion, pose=problem.motion.pose + delta, transl=problem.motion.transl + shift
    )
    centre = problem.centre.double().numpy()
    contact = problem.contact.numpy()
    return Placement(
        scene=problem.scene.scene_id,
        motion_id=problem.motion.motion_id,
        method=method,
        translation=fit.translation,
        yaw=fit.yaw,
        motion=move_motion(motion, problem.body, fit.yaw, fit.translation, centre),
        altered=bool(np.any(delta) or np.any(shift)),
        weights=problem.weights.values,
        terms={**fit.terms, "total": fit.energy},
        seed=seed,
        config_hash=problem.settings.config_hash(),
        info={
            "preset": problem.settings.preset,
            "interaction": problem.features.model,
            "weighting": problem.weights.rule,
            "expects": problem.expected_classes(),
            "frames_with_contact": float(contact.any(1).mean()),
            "starts": len(fits),
            "chosen_start": next(index for index, item in enumerate(fits) if item is fit),
            "energies": [item.energy for item in fits],
            "evaluations": sum(item.evaluations for item in fits),
            "iterations": sum(item.iterations for item in fits),
            "stopped": fit.reason,
            "trace": list(fit.trace),
            "centre": centre.tolist(),
            **info,
        },
    )

"""From fits of several starts to the Placement that a method answers with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from experiments.motion.motion import Motion
from experiments.placement.bones import bone_points
from experiments.placement.candidates import Starts, class_match
from experiments.placement.errors import NoAdmissibleStart, OptimisationFailed
from experiments.placement.optimiser import FAILED
from experiments.placement.placement import Placement
from experiments.placement.problem import Problem
from experiments.placement.rigid import move, move_motion
from experiments.placement.solver import Fit, altered_bodies
from experiments.placement.spread import spread_alteration


def best_fit(problem: Problem, fits: Sequence[Fit]) -> Fit:
    """The fit of lowest energy that touches what it expects and is not deep inside something.

    Raises `NoAdmissibleStart` if there is none, `OptimisationFailed` if every optimisation broke.
    """
    motion, scene = problem.motion.motion_id, problem.scene.scene_id
    finite = [fit for fit in fits if math.isfinite(fit.energy)]
    if not finite:
        raise OptimisationFailed(motion, scene, "no start reached a finite energy")
    faults = [fault(problem, fit) for fit in finite]
    sound = [fit for fit, found in zip(finite, faults, strict=True) if not found]
    if not sound and all(fit.reason in FAILED for fit in finite):
        raise OptimisationFailed(motion, scene, f"no start was optimised: {finite[0].reason}")
    if not sound:
        raise NoAdmissibleStart(motion, scene, f"at its best start the body {faults[0]}")
    return min(sound, key=lambda fit: fit.energy)


def fault(problem: Problem, fit: Fit) -> str:
    """What is wrong with a fit by the settings' own limits, in words; empty if nothing."""
    settings = problem.settings
    if fit.reason in FAILED:
        return f"cannot be followed: its optimisation ended as {fit.reason}"
    if settings.max_depth is not None:
        depth = deepest_vertex(problem, fit)
        if depth > settings.max_depth:
            return f"is {depth:.2f} m deep inside something"
    if settings.max_gap is not None:
        gap = contact_gap(problem, fit)
        if gap > settings.max_gap:
            expected = ", ".join(problem.expected_classes())
            return f"stays {100 * gap:.0f} cm away from what it expects to touch ({expected})"
    if settings.bone_clearance is not None:
        clearance = least_clearance(problem, fit)
        if clearance < settings.bone_clearance / 2:
            return "has a bone inside something"
    if settings.start_filter is not None:
        rigid = Starts(np.array([fit.yaw]), fit.translation[None], np.zeros(1))
        match = float(class_match(problem, rigid)[0])
        if match < settings.start_filter:
            expected = ", ".join(problem.expected_classes(floor=True))
            return f"touches what it expects ({expected}) with {match:.0%} of its contacts only"
    return ""


def deepest_vertex(problem: Problem, fit: Fit) -> float:
    """How deep the deepest vertex without contact is inside anything, over all frames, metres."""
    return float((-_distance(problem, fit))[~problem.contact].max().clamp(min=0.0))


def contact_gap(problem: Problem, fit: Fit) -> float:
    """Mean distance of the contacts beyond the floor from the scene, metres; 0 without any."""
    beyond = problem.beyond_floor()
    return float(_distance(problem, fit)[beyond].abs().mean()) if beyond.any() else 0.0


def least_clearance(problem: Problem, fit: Fit) -> float:
    """Least distance of a bone from any surface, metres; negative inside."""
    with torch.no_grad():
        pose, transl = problem.pose + fit.delta, problem.transl + fit.shift
        bones = bone_points(problem.body.joint_transforms(pose, transl)[1])
        yaw, translation = torch.tensor(fit.yaw), torch.as_tensor(fit.translation)
        placed = move(bones, yaw.to(bones), translation.to(bones), problem.centre)
        return float(problem.field.clearance(placed).min())


def _distance(problem: Problem, fit: Fit) -> Float[Tensor, "T V"]:
    placed = problem.k.new_tensor([fit.yaw, *fit.translation])
    with torch.no_grad():
        bodies = altered_bodies(problem, placed, fit.delta, fit.shift)
        return problem.field.distance(bodies, problem.contact)


def _weights_of(problem: Problem, whole: Motion) -> Float[np.ndarray, " T"]:
    """k by frame of the whole clip, 0 for frames that were not optimised."""
    weights: Float[np.ndarray, " T"] = np.zeros(whole.n_frames)
    weights[np.searchsorted(whole.times, problem.motion.times)] = problem.weights.values
    return weights


def to_placement(
    problem: Problem, fits: Sequence[Fit], method: str, seed: int, info: dict[str, Any]
) -> Placement:
    """The best fit as a record: the placed motion, its terms, and what it cost to find."""
    fit = best_fit(problem, fits)
    delta, shift = fit.delta.double().cpu().numpy(), fit.shift.double().cpu().numpy()
    whole = problem.whole or problem.motion
    motion = spread_alteration(whole, problem.motion, delta, shift)
    centre = problem.centre.double().cpu().numpy()
    contact = problem.contact.cpu().numpy()
    return Placement(
        scene=problem.scene.scene_id,
        motion_id=problem.motion.motion_id,
        method=method,
        translation=fit.translation,
        yaw=fit.yaw,
        motion=move_motion(motion, problem.body, fit.yaw, fit.translation, centre),
        altered=bool(np.any(delta) or np.any(shift)),
        weights=_weights_of(problem, whole),
        terms={**fit.terms, "total": fit.energy},
        seed=seed,
        config_hash=problem.settings.config_hash(),
        info={
            "preset": problem.settings.preset,
            "interaction": problem.features.model,
            "weighting": problem.weights.rule,
            "expects": problem.expected_classes(),
            "frames_with_contact": float(contact.any(1).mean()),
            "frames_optimised": problem.motion.n_frames,
            "starts": len(fits),
            "chosen_start": next(index for index, item in enumerate(fits) if item is fit),
            "energies": [item.energy for item in fits],
            "evaluations": sum(item.evaluations for item in fits),
            "iterations": sum(item.iterations for item in fits),
            "stopped": fit.reason,
            "trace": list(fit.trace),
            "history": list(fit.history),
            "broken_starts": [
                {"start": index, "reason": item.reason}
                for index, item in enumerate(fits)
                if item.reason in FAILED
            ],
            "semantics_off": problem.field.semantics_off,
            "centre": centre.tolist(),
            **info,
        },
    )

"""E_p and E_alt one frame and one vertex at a time: the oracle both engines are tested against.

Written from the formulas alone and sharing no arithmetic with the engines but the skinning, which
has tests of its own.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from jaxtyping import Float

from experiments.placement.problem import Problem
from experiments.scene.lookup import trilinear_reference
from experiments.scene.scene import Volumes


def pointwise_terms(
    problem: Problem,
    yaw: float,
    translation: Float[np.ndarray, "3"],
    delta: Float[np.ndarray, "T 22 3"],
    shift: Float[np.ndarray, "T 3"],
) -> dict[str, float]:
    """All terms of E_p and E_alt with the printed penalty. Seconds per call: for tests only."""
    names = ("contact", "penetration", "semantics", "pose", "motion", "translation")
    terms = dict.fromkeys(names, 0.0)
    for frame in range(problem.motion.n_frames):
        k = float(problem.weights.values[frame])
        body = frame_vertices(problem, frame, yaw, translation, delta[frame], shift[frame])
        for name, value in _scene_frame(problem, frame, body).items():
            terms[name] += k * value
        stiffness = k if problem.settings.weighted_alteration else 1.0
        for name, value in _alteration_frame(problem, frame, delta, shift).items():
            terms[name] += stiffness * value
    return terms


def frame_vertices(
    problem: Problem,
    frame: int,
    yaw: float,
    translation: Float[np.ndarray, "3"],
    delta: Float[np.ndarray, "22 3"],
    shift: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "V 3"]:
    """One altered body in the scene's frame, skinned in double precision."""
    pose = torch.as_tensor(problem.motion.pose[frame] + delta)[None]
    transl = torch.as_tensor(problem.motion.transl[frame] + shift)[None]
    points = problem.body.posed(pose, transl, problem.vertex_ids).vertices[0].numpy()
    centre = problem.centre.double().numpy()
    placed = np.zeros_like(points)
    for row, (x, y, z) in enumerate(points):
        across, along = x - centre[0], y - centre[1]
        placed[row, 0] = math.cos(yaw) * across - math.sin(yaw) * along + centre[0] + translation[0]
        placed[row, 1] = math.sin(yaw) * across + math.cos(yaw) * along + centre[1] + translation[1]
        placed[row, 2] = z + translation[2]
    return placed


def _scene_frame(problem: Problem, frame: int, body: Float[np.ndarray, "V 3"]) -> dict[str, float]:
    """Contact, penetration and semantics of one frame."""
    settings, volumes = problem.settings, problem.scene.volumes
    found = {"contact": 0.0, "penetration": 0.0, "semantics": 0.0}
    for row, point in enumerate(body):
        if problem.features.contact[frame, row] > settings.contact_threshold:
            distance = trilinear_reference(volumes, False, point)
            found["contact"] += settings.contact_weight * distance**2
            wanted = int(np.argmax(problem.features.semantics[frame, row]))
            if nearest_label(volumes, point) != wanted:
                found["semantics"] += settings.semantic_weight
            tolerance = settings.contact_tolerance
            if tolerance is not None and distance < -tolerance:
                found["penetration"] += settings.penetration_weight * (-distance - tolerance)
        else:
            distance = trilinear_reference(volumes, True, point)
            if distance < 0:
                found["penetration"] += settings.penetration_weight * -distance
    return found


def _alteration_frame(
    problem: Problem,
    frame: int,
    delta: Float[np.ndarray, "T 22 3"],
    shift: Float[np.ndarray, "T 3"],
) -> dict[str, float]:
    """Pose, motion and translation costs of one frame; the first has no step behind it."""
    settings = problem.settings
    found = {
        "pose": settings.lambda_pose * _squares(delta[frame]),
        "motion": 0.0,
        "translation": 0.0,
    }
    if frame == 0:
        return found
    gap = problem.motion.times[frame] - problem.motion.times[frame - 1]
    scale = (1.0 / 30.0) / gap if settings.time_aware else 1.0
    turn = scale * (delta[frame] - delta[frame - 1])
    step = scale * (shift[frame] - shift[frame - 1])
    found["motion"] = settings.lambda_mot * _squares(turn)
    found["translation"] = settings.lambda_mot * settings.lambda_tau * _squares(step)
    return found


def nearest_label(volumes: Volumes, point: Float[np.ndarray, "3"]) -> int:
    """Class at the nearest node of the label volume."""
    node = []
    for axis in range(3):
        position = (point[axis] - volumes.origin[axis]) / volumes.cell
        node.append(min(max(round(float(position)), 0), volumes.label.shape[axis] - 1))
    return int(volumes.label[node[0], node[1], node[2]])


def pointwise_scores(
    problem: Problem,
    yaws: Float[np.ndarray, " N"],
    translations: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, " N"]:
    """E_p of the unaltered motion at every start, one after the other."""
    zero = np.zeros_like(problem.motion.pose), np.zeros_like(problem.motion.transl)
    pairs = zip(yaws, translations, strict=True)
    found = [pointwise_terms(problem, float(yaw), shift, *zero) for yaw, shift in pairs]
    return np.array([sum(terms.values()) for terms in found])


def _squares(values: Float[np.ndarray, "*S"]) -> float:
    return math.fsum(float(value) ** 2 for value in values.ravel())

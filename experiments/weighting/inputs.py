"""What the network g sees of a motion: (V_b, F_c, F_s) of PACE's equation 3, at a few points."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int64, Integer
from torch import Tensor

from experiments.body.model import BodyModel
from experiments.interaction.canonical import body_yaw, canonical_frames
from experiments.interaction.features import InteractionFeatures
from experiments.interaction.mesh import MovingBody
from experiments.weighting.geometric import CONTACT_THRESHOLD

N_ANCHORS = 164
"""Points of the body that the network sees: as many as POSA's third mesh level has vertices."""
REFERENCE_FPS = 30.0


@dataclass(frozen=True)
class MotionInputs:
    """One motion as the network reads it. Axes: T frames, A anchors."""

    points: Float[Tensor, "T A 4"]
    """Anchor position (m; pelvis at the origin, yaw removed, facing -y) and contact around it."""
    classes: Int64[Tensor, "T A"]
    """Class touched around the anchor, 0 (void) where there is no contact."""
    velocity: Float[Tensor, "T 66"]
    """Velocities of the 22 joints, m/s, yaw removed; the pelvis's own included."""
    stride: int
    """Frames between neighbours 1/30 s apart: what the temporal convolutions step by."""

    def part(self, frames: slice) -> MotionInputs:
        """Some consecutive frames."""
        return dataclasses.replace(
            self,
            points=self.points[frames],
            classes=self.classes[frames],
            velocity=self.velocity[frames],
        )


def motion_inputs(
    moving: MovingBody, body: BodyModel, features: InteractionFeatures
) -> MotionInputs:
    """Pool contact and class over the neighbourhood of each anchor; `features` index into `moving`."""
    columns = np.searchsorted(moving.vertex_ids, features.vertex_ids)
    rest = rest_points(body, features.vertex_ids)
    anchors = farthest_points(rest, min(N_ANCHORS, len(rest)))
    cell = nearest(rest, rest[anchors])
    contact, classes = pooled(features, cell, len(anchors))
    points = canonical_frames(moving.vertices[:, columns[anchors]], moving.joints)
    step = float(np.median(np.diff(moving.times)))
    return MotionInputs(
        points=torch.as_tensor(np.concatenate([points, contact[..., None]], -1)).float(),
        classes=torch.as_tensor(classes),
        velocity=torch.as_tensor(joint_velocities(moving)).float().flatten(1),
        stride=max(1, round(1.0 / (step * REFERENCE_FPS))),
    )


def rest_points(body: BodyModel, vertex_ids: Integer[np.ndarray, " V"]) -> Float[np.ndarray, "V 3"]:
    """Vertices of the zero pose, metres."""
    zero = torch.zeros((1, 22, 3), dtype=torch.float64)
    return np.asarray(body.posed(zero, zero[:, 0], vertex_ids).vertices[0].double().numpy())


def farthest_points(points: Float[np.ndarray, "V 3"], count: int) -> Int64[np.ndarray, " A"]:
    """Indices of points spread evenly: each next one is the farthest from all chosen before.

    Begins with the point farthest from the middle (Gonzalez 1985).
    """
    chosen = [int(np.linalg.norm(points - points.mean(0), axis=1).argmax())]
    gap = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(gap.argmax()))
        gap = np.minimum(gap, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.int64)


def nearest(
    points: Float[np.ndarray, "V 3"], anchors: Float[np.ndarray, "A 3"]
) -> Int64[np.ndarray, " V"]:
    """Index of the nearest anchor of every point."""
    distance = np.linalg.norm(points[:, None] - anchors[None], axis=-1)
    return np.asarray(distance.argmin(1), dtype=np.int64)


def pooled(
    features: InteractionFeatures, cell: Int64[np.ndarray, " V"], n_anchors: int
) -> tuple[Float[np.ndarray, "T A"], Int64[np.ndarray, "T A"]]:
    """Mean contact over each anchor's cell, and the class that most of its contact vertices have."""
    n_frames = len(features.contact)
    member = np.eye(n_anchors)[cell]
    contact = features.contact.astype(np.float64) @ (member / member.sum(0))
    touching = features.contact > CONTACT_THRESHOLD
    label = np.where(touching, features.semantics.argmax(-1), 0)
    votes = np.zeros((n_frames, n_anchors, features.semantics.shape[-1]))
    frame, vertex = np.nonzero(label)
    np.add.at(votes, (frame, cell[vertex], label[frame, vertex]), 1.0)
    return contact, np.asarray(votes.argmax(-1), dtype=np.int64)


def joint_velocities(moving: MovingBody) -> Float[np.ndarray, "T 22 3"]:
    """Velocities of the joints by central differences, m/s, in axes that turn with the body."""
    velocity = np.gradient(moving.joints, moving.times, axis=0)
    yaw = body_yaw(moving.joints)
    cosine, sine = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y = velocity[..., 0], velocity[..., 1]
    turned = [cosine * x + sine * y, cosine * y - sine * x, velocity[..., 2]]
    return np.asarray(np.stack(turned, axis=-1))

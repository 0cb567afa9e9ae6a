"""The loss terms of POSA and PACE: one small function a symbol.

Every function works per frame and leaves frame weights, term weights and the sum over frames to
`objectives`. Distances are metres, negative inside solids; pose changes are radians of axis-angle.
Leading axes `*B` (candidate starts) are free.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float, Integer
from torch import Tensor


def contact_loss(
    distance: Float[Tensor, "*B T V"], contact: Bool[Tensor, "T V"]
) -> Float[Tensor, "*B T"]:
    """Contact part of L_afford: squared distance to the scene, summed over contact vertices, m².

    Quadratic on both sides of the surface, no robustifier (POSA, Hassan et al. 2021, eq. 5, code).
    """
    return (distance.square() * contact).sum(-1)


def penetration_loss(
    distance: Float[Tensor, "*B T V"],
    contact: Bool[Tensor, "T V"],
    huber: float = 0.0,
    contact_tolerance: float | None = None,
) -> Float[Tensor, "*B T"]:
    """L_pen: depth of the vertices inside solids, summed over the vertices *not* in contact, m.

    POSA leaves contact vertices out of the penalty. With `contact_tolerance` (ours; metres) they
    pay as well for what lies deeper than that. `huber` rounds the kink at the surface, see
    `smoothed_depth`.
    """
    free = smoothed_depth(-distance, huber) * ~contact
    if contact_tolerance is None:
        return free.sum(-1)
    pressed = smoothed_depth(-distance - contact_tolerance, huber) * contact
    return (free + pressed).sum(-1)


def smoothed_depth(depth: Float[Tensor, "*S"], huber: float) -> Float[Tensor, "*S"]:
    """Positive part of a depth (metres), its kink at zero replaced by a parabola `huber` wide.

    Equals relu(y) for `huber` = 0 and is below it by at most huber / 2 otherwise. Line searches
    stop at kinks, long before the optimum.
    """
    positive = depth.clamp(min=0.0)
    if huber == 0.0:
        return positive
    rounded = positive.clamp(max=huber)
    return rounded.square() / (2.0 * huber) + (positive - rounded)


def semantic_loss(
    scene_label: Integer[Tensor, "*B T V"],
    wanted: Integer[Tensor, "T V"],
    contact: Bool[Tensor, "T V"],
) -> Integer[Tensor, "*B T"]:
    """Semantic part of L_afford: number of contact vertices whose nearest scene class is another.

    POSA's cross-entropy of a one-hot label against the predicted class is a constant plus one per
    mismatch; vertices without contact have the label void on both sides. It has no gradient.
    """
    return ((scene_label != wanted) & contact).sum(-1)


def pose_loss(delta: Float[Tensor, "T J 3"]) -> Float[Tensor, " T"]:
    """L_pose: squared change of pose against the original, summed over joints, rad² (eq. 6).

    `delta` is the difference of axis-angle vectors, so no wrap at pi can occur.
    """
    return delta.square().sum((-1, -2))


def motion_loss(
    delta: Float[Tensor, "T J 3"], step_scale: Float[Tensor, " T"]
) -> Float[Tensor, " T"]:
    """Pose half of L_mot: squared difference of frame-to-frame pose changes, rad² (eq. 7).

    The difference of differences is the difference of `delta`. `step_scale` is (1/30 s) / (time
    since the frame before), so that a gap left by thinning does not count as a fast motion;
    frame 0 has no difference and costs nothing.
    """
    return _steps(delta, step_scale).square().sum((-1, -2))


def translation_loss(
    shift: Float[Tensor, "T 3"], step_scale: Float[Tensor, " T"]
) -> Float[Tensor, " T"]:
    """Translation half of L_mot: squared difference of frame-to-frame shifts of the root, m²."""
    return _steps(shift, step_scale).square().sum(-1)


def _steps(series: Float[Tensor, "T *S"], step_scale: Float[Tensor, " T"]) -> Float[Tensor, "T *S"]:
    differences = torch.diff(series, dim=0, prepend=series[:1])
    return differences * step_scale.reshape(-1, *[1] * (series.ndim - 1))

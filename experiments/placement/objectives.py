"""The two objectives of PACE, each returned as its terms by name: E_p and E_alt."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from jaxtyping import Bool, Float, Integer
from torch import Tensor

from experiments.placement import losses
from experiments.placement.settings import PlacementSettings


def placement_terms(
    distance: Float[Tensor, "*B T V"],
    scene_label: Integer[Tensor, "*B T V"] | None,
    contact: Bool[Tensor, "T V"],
    wanted: Integer[Tensor, "T V"],
    k: Float[Tensor, " T"],
    settings: PlacementSettings,
    huber: float = 0.0,
) -> dict[str, Float[Tensor, "*B"]]:
    """E_p = sum_i k_i (L_afford,i + L_pen,i), as `contact`, `penetration` and `semantics`.

    `distance` and `scene_label` are those of the scene at every vertex of every frame, for any
    number of starts at once. The semantic term has no gradient; without labels it is left out.
    """
    per_frame = {
        "contact": settings.contact_weight * losses.contact_loss(distance, contact),
        "penetration": settings.penetration_weight
        * losses.penetration_loss(distance, contact, huber, settings.contact_tolerance),
    }
    if scene_label is not None:
        misses = losses.semantic_loss(scene_label, wanted, contact)
        per_frame["semantics"] = settings.semantic_weight * misses.to(k.dtype)
    return {name: value @ k for name, value in per_frame.items()}


def alteration_terms(
    delta: Float[Tensor, "T J 3"],
    shift: Float[Tensor, "T 3"],
    k: Float[Tensor, " T"],
    step_scale: Float[Tensor, " T"],
    settings: PlacementSettings,
) -> dict[str, Float[Tensor, ""]]:
    """E_alt = sum_i k_i (L_pose,i + lambda_mot L_mot,i), as `pose`, `motion` and `translation`.

    `delta` (axis-angle differences, rad) and `shift` (metres, relative to frame 0) are the
    alteration; both zero give zero.
    """
    translation_weight = settings.lambda_mot * settings.lambda_tau
    per_frame = {
        "pose": settings.lambda_pose * losses.pose_loss(delta),
        "motion": settings.lambda_mot * losses.motion_loss(delta, step_scale),
        "translation": translation_weight * losses.translation_loss(shift, step_scale),
    }
    return {name: value @ k for name, value in per_frame.items()}


def total(terms: Mapping[str, Float[Tensor, "*B"]]) -> Float[Tensor, "*B"]:
    """The energy: the sum of its terms, whose weights they already carry."""
    return torch.stack(list(terms.values())).sum(0)

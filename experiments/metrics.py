"""PlausibilityScores: how plausible a placed motion is, and what its alteration cost.

Non-collision and contact are those of PSI, PLACE, POSA and PACE: per body mesh, on the full skin
and the unthickened signed distance, then averaged over frames. Contact is penetration of at least
one vertex, so a body that rests a millimetre above the floor scores 0; the tolerant scores stand
beside it for that reason.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Integer

from experiments.alteration import AlterationCost, alteration_cost, foot_skate
from experiments.body.model import BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.motion.motion import Motion
from experiments.placement.features import choose_features
from experiments.placement.settings import PlacementSettings
from experiments.scene.lookup import SceneLookup
from experiments.scene.scene import Scene

TOLERANCES_M = {"contact_5mm": 0.005, "contact_1cm": 0.01, "contact_2cm": 0.02}
"""Distances below which a vertex counts as touching, beside the strict zero."""
NEAR_M = 0.02
"""A predicted contact vertex this close to the scene is fulfilled (cv2)."""
DEEP_M = 0.01
"""A vertex deeper than this is inside by more than the volumes' own error."""
_FLOOR = 2


@dataclass(frozen=True)
class PlausibilityScores:
    """Scores of one placed motion. Axis T frames; scalars are means over frames unless said."""

    non_collision: Float[np.ndarray, " T"]
    """Share of the skin's vertices outside everything, per frame (strict)."""
    contact: Float[np.ndarray, " T"]
    """1 where at least one vertex is on or inside a surface, per frame (strict)."""
    tolerant: dict[str, Float[np.ndarray, " T"]]
    """The same with the tolerances of `TOLERANCES_M`, per frame."""
    contact_beyond_floor: Float[np.ndarray, " T"]
    """1 where a vertex within 1 cm is nearest to something other than floor, per frame."""
    depth_sum: Float[np.ndarray, " T"]
    """Summed depth of all vertices inside something, metres, per frame."""
    depth_max: Float[np.ndarray, " T"]
    """Depth of the deepest vertex, metres, per frame."""
    deep: Float[np.ndarray, " T"]
    """Share of the skin's vertices deeper than `DEEP_M` inside something, per frame."""
    predicted_near: float
    """cv2: share of the predicted contact vertices within 2 cm of the scene; nan without any.

    This and the next two do not apply to a method that does not share the motion: nan."""
    semantic_match: float
    """Share of the predicted contact vertices nearest to the predicted class; nan without any."""
    frames_with_prediction: float
    """Share of the frames with at least one predicted contact vertex."""
    foot_skate_cm_s: float
    """Mean horizontal speed of sole vertices on the ground, cm/s."""
    alteration: AlterationCost | None
    """None for a method that does not share the motion: there is nothing that it altered."""

    def as_dict(self) -> dict[str, float]:
        """Means over frames as plain numbers, for the catalogue; what has no value is left out."""
        scores = {
            "non_collision": float(self.non_collision.mean()),
            "contact": float(self.contact.mean()),
            **{name: float(value.mean()) for name, value in self.tolerant.items()},
            "contact_beyond_floor": float(self.contact_beyond_floor.mean()),
            "cv2": self.predicted_near,
            "semantic_match": self.semantic_match,
            "frames_with_prediction": self.frames_with_prediction,
            "depth_sum_m": float(self.depth_sum.mean()),
            "depth_max_m": float(self.depth_max.max()),
            "deeper_1cm": float(self.deep.mean()),
            "foot_skate_cm_s": self.foot_skate_cm_s,
            **(dataclasses.asdict(self.alteration) if self.alteration else {}),
        }
        return {name: value for name, value in scores.items() if np.isfinite(value)}


def plausibility(
    placed: Motion,
    original: Motion,
    scene: Scene,
    body: BodyModel,
    settings: PlacementSettings,
    shares_motion: bool = True,
) -> PlausibilityScores:
    """Score a placed motion (scene's frame) against the scene and against the motion it came from.

    The predicted contacts are those that every method of this motion and scene was given. Without
    `shares_motion` the placed motion only fills the slot of `original`: contacts predicted for
    another motion and the cost of altering it say nothing about it and are left out.
    """
    distance, label = skin_distances(placed, scene, body)
    predicted, alteration = _NOT_PREDICTED, None
    if shares_motion:
        features = choose_features(original, scene, body, settings)
        predicted = _predicted(placed, scene, body, features, settings.contact_threshold)
        alteration = alteration_cost(placed, original, body)
    return PlausibilityScores(
        non_collision=(distance > 0.0).mean(1),
        contact=_any_below(distance, 0.0),
        tolerant={name: _any_below(distance, limit) for name, limit in TOLERANCES_M.items()},
        contact_beyond_floor=_any_below(np.where(label == _FLOOR, np.inf, distance), 0.01),
        depth_sum=np.maximum(-distance, 0.0).sum(1),
        depth_max=np.maximum(-distance, 0.0).max(1),
        deep=(distance < -DEEP_M).mean(1),
        foot_skate_cm_s=alteration.foot_skate_cm_s if alteration else foot_skate(placed, body),
        alteration=alteration,
        **predicted,
    )


def skin_distances(
    motion: Motion, scene: Scene, body: BodyModel
) -> tuple[Float[np.ndarray, "T V"], Integer[np.ndarray, "T V"]]:
    """Unthickened signed distance (m) and nearest class at every vertex of the outer skin."""
    return _read_scene(motion, scene, body, body.body_component)


def _read_scene(
    motion: Motion, scene: Scene, body: BodyModel, vertex_ids: Integer[np.ndarray, " V"]
) -> tuple[Float[np.ndarray, "T V"], Integer[np.ndarray, "T V"]]:
    lookup = SceneLookup(scene, thickened=False)
    pose = torch.as_tensor(motion.pose, dtype=torch.float32)
    transl = torch.as_tensor(motion.transl, dtype=torch.float32)
    with torch.no_grad():
        points = body.posed(pose, transl, vertex_ids).vertices
        return lookup.distance(points).double().numpy(), lookup.label(points).numpy()


def _any_below(distance: Float[np.ndarray, "T V"], limit: float) -> Float[np.ndarray, " T"]:
    # "Non-positive" in PACE's text: a vertex exactly on the surface touches.
    touching: Float[np.ndarray, " T"] = np.any(distance <= limit, axis=1).astype(np.float64)
    return touching


_NOT_PREDICTED = {
    name: float("nan") for name in ("predicted_near", "semantic_match", "frames_with_prediction")
}


def _predicted(
    placed: Motion, scene: Scene, body: BodyModel, features: InteractionFeatures, threshold: float
) -> dict[str, float]:
    contact = features.contact > threshold
    frames = float(contact.any(1).mean())
    near = match = float("nan")
    if contact.any():
        distance, label = _read_scene(placed, scene, body, features.vertex_ids)
        near = float((np.abs(distance) < NEAR_M)[contact].mean())
        match = float((label == features.semantics.argmax(-1))[contact].mean())
    return {"predicted_near": near, "semantic_match": match, "frames_with_prediction": frames}

"""Problem: one motion, one scene, its interaction features and frame weights, ready to be solved."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64, Integer
from torch import Tensor

from experiments.body.model import BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.motion.motion import Motion
from experiments.placement.bones import bone_points
from experiments.placement.rigid import clip_centre, clip_floor, move
from experiments.placement.scene_field import SceneField
from experiments.placement.settings import PlacementSettings
from experiments.scene.scene import MPCAT40, Scene
from experiments.weighting.weights import FrameWeights, uniform_weights

_FLOOR = 2
REFERENCE_STEP_S = 1.0 / 30.0


@dataclass(frozen=True)
class RigidProblem:
    """What E_p of an unaltered motion needs. Axes: T frames, V vertices; clip frame, metres."""

    settings: PlacementSettings
    field: SceneField
    vertices: Float[Tensor, "T V 3"]
    contact: Bool[Tensor, "T V"]
    """Predicted contact above the threshold; fixed during optimisation."""
    wanted: Int64[Tensor, "T V"]
    """Predicted class, 0 (void) where there is no contact."""
    k: Float[Tensor, " T"]
    centre: Float[Tensor, "2"]

    @cached_property
    def touching(self) -> Int64[Tensor, " C"]:
        """The contact vertices' places in a flattened (T, V) array."""
        return self.contact.flatten().nonzero().squeeze(1)

    @cached_property
    def touching_k(self) -> Float[Tensor, " C"]:
        """k at every contact vertex."""
        return self.k[self.touching // self.contact.shape[1]]

    @cached_property
    def touching_wanted(self) -> Int64[Tensor, " C"]:
        """Predicted class of every contact vertex."""
        return self.wanted.flatten()[self.touching]

    def moved(
        self, yaw: Float[Tensor, "*B"], translation: Float[Tensor, "*B 3"]
    ) -> Float[Tensor, "*R 3"]:
        """The unaltered body moved rigidly into the scene's frame."""
        return move(self.vertices, yaw, translation, self.centre)

    def beyond_floor(self) -> Bool[Tensor, "T V"]:
        """Contact vertices that expect something other than the floor."""
        return self.contact & (self.wanted != _FLOOR)

    def thinned(
        self, frames: Integer[np.ndarray, " F"], columns: Integer[np.ndarray, " W"]
    ) -> RigidProblem:
        """Some frames and vertices only, for scoring: the frames left stand for all."""
        frame = torch.as_tensor(frames, device=self.k.device)
        column = torch.as_tensor(columns, device=self.k.device)
        return RigidProblem(
            settings=self.settings,
            field=self.field,
            vertices=coordinate_major(self.vertices[frame][:, column]),
            contact=self.contact[frame][:, column],
            wanted=self.wanted[frame][:, column],
            k=self.k[frame] * (len(self.k) / len(frames)),
            centre=self.centre,
        )


@dataclass(frozen=True)
class Problem(RigidProblem):
    """The whole of it: the motion, its body and scene, and what E_alt needs besides."""

    motion: Motion
    scene: Scene
    body: BodyModel
    features: InteractionFeatures
    weights: FrameWeights
    pose: Float[Tensor, "T 22 3"]
    transl: Float[Tensor, "T 3"]
    pelvis: Float[np.ndarray, "T 3"]
    bones: Float[Tensor, "T M 3"]
    """Points inside the unaltered body; see `bone_points`."""
    step_scale: Float[Tensor, " T"]
    """What frame-to-frame differences are multiplied by; see `time_step_scale`."""
    floor: float
    """Height of the clip's own floor, metres."""
    whole: Motion | None = None
    """The clip that `motion` was thinned from; None if it was not."""

    @property
    def vertex_ids(self) -> Integer[np.ndarray, " V"]:
        """The vertices of the energy, in the body's full numbering."""
        return self.features.vertex_ids

    @property
    def stiffness(self) -> Float[Tensor, " T"]:
        """Frame weights of E_alt: k as printed, or one for every frame."""
        return self.k if self.settings.weighted_alteration else torch.ones_like(self.k)

    def weighted(self, weights: FrameWeights) -> Problem:
        """The same with other frame weights."""
        k = torch.as_tensor(weights.values).to(self.k)
        return dataclasses.replace(self, weights=weights, k=k)

    def expected_classes(self, floor: bool = False) -> list[str]:
        """Names of the classes that the motion expects to touch, with the floor or without."""
        touching = self.contact if floor else self.beyond_floor()
        return [MPCAT40[index] for index in torch.unique(self.wanted[touching]).tolist()]


def build_problem(
    motion: Motion,
    scene: Scene,
    body: BodyModel,
    settings: PlacementSettings,
    features: InteractionFeatures,
    weights: FrameWeights | None = None,
    dtype: torch.dtype = torch.float32,
) -> Problem:
    """Skin the unaltered motion once and turn features and weights into tensors.

    Without weights every frame counts alike.
    """
    weights = weights or uniform_weights(motion.n_frames)
    device = torch.device(settings.device)
    pose = torch.as_tensor(motion.pose, dtype=dtype, device=device)
    transl = torch.as_tensor(motion.transl).to(pose)
    mesh = body.posed(pose, transl, features.vertex_ids)
    pelvis = mesh.joints[:, 0].double().cpu().numpy()
    lowest = mesh.vertices[..., 2].min(1).values.double().cpu().numpy()
    contact = torch.as_tensor(features.contact > settings.contact_threshold, device=device)
    classes = torch.as_tensor(features.semantics.argmax(-1), dtype=torch.int64, device=device)
    step_scale = time_step_scale(motion.times) if settings.time_aware else np.ones(len(pelvis))
    return Problem(
        motion=motion,
        scene=scene,
        body=body,
        settings=settings,
        features=features,
        weights=weights,
        field=SceneField(scene, dtype, device),
        pose=pose,
        transl=transl,
        vertices=coordinate_major(mesh.vertices),
        pelvis=pelvis,
        bones=bone_points(mesh.joints),
        contact=contact,
        wanted=torch.where(contact, classes, 0),
        k=torch.as_tensor(weights.values).to(pose),
        step_scale=torch.as_tensor(step_scale).to(pose),
        centre=torch.as_tensor(clip_centre(pelvis)).to(pose),
        floor=clip_floor(lowest),
    )


def coordinate_major(points: Float[Tensor, "T V 3"]) -> Float[Tensor, "T V 3"]:
    """The same points, all x before all y before all z in memory: `move` then need not copy."""
    return points.movedim(-1, 0).contiguous().movedim(0, -1)


def time_step_scale(times: Float[np.ndarray, " T"]) -> Float[np.ndarray, " T"]:
    """(1/30 s) / (time since the frame before), 1 for frame 0: what differences are multiplied by."""
    steps = np.diff(times, prepend=times[0] - REFERENCE_STEP_S)
    scale: Float[np.ndarray, " T"] = REFERENCE_STEP_S / steps
    return scale

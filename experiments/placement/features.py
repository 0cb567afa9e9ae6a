"""Which feature map of an interaction model a (motion, scene) is placed and scored with."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from experiments.body.model import BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.interaction.registry import INTERACTIONS, InteractionModel, first_fitting_map
from experiments.motion.motion import Motion
from experiments.placement.candidates import coarse_best, start_grid
from experiments.placement.errors import NoAdmissibleStart
from experiments.placement.problem import build_problem
from experiments.placement.settings import PlacementSettings
from experiments.scene.scene import Scene
from renderer.files import InputError


def choose_features(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings
) -> InteractionFeatures:
    """The feature map that every method and metric uses for this motion in this scene.

    `posa`: the first whose most common class exists in the scene. `search` (ours): of the first maps
    that share their contacts and of which one has a start, the one whose best start is best at
    uniform weights, whatever the method, so that all methods are asked for the same contacts.
    Raises `PlacementError` where no map has a start. The last answers are remembered: all methods,
    and the scores of each, ask for the same map.
    """
    if settings.interaction not in INTERACTIONS:
        wanted = "one of " + ", ".join(INTERACTIONS)
        raise InputError("placement settings", "interaction", settings.interaction, wanted)
    arrays = (motion.pose, motion.transl, motion.times)
    digest = hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()
    model = INTERACTIONS[settings.interaction]
    key = (digest, motion.motion_id, id(scene), id(body), id(model), settings.config_hash())
    return _chosen(_Question(key, motion, scene, body, model, settings))


@dataclass(frozen=True)
class _Question:
    """Arguments of `choose_features`, equal if their key is; holds them, so that ids stay taken."""

    key: tuple[str | int, ...]
    motion: Motion = field(compare=False)
    scene: Scene = field(compare=False)
    body: BodyModel = field(compare=False)
    model: InteractionModel = field(compare=False)
    settings: PlacementSettings = field(compare=False)


@lru_cache(maxsize=2)
def _chosen(question: _Question) -> InteractionFeatures:
    motion, scene = question.motion, question.scene
    body, settings = question.body, question.settings
    maps = question.model(motion, body, scene.class_names())
    if settings.feature_choice == "posa":
        return maps[first_fitting_map(maps, scene)]
    if len(maps) == 1:
        return maps[0]
    refusal: NoAdmissibleStart | None = None
    for rivals in alike_in_contact(maps, settings.contact_threshold):
        scores: list[tuple[float, int]] = []
        for index in rivals:
            problem = build_problem(motion, scene, body, settings, maps[index])
            try:
                scores.append((coarse_best(problem, start_grid(problem)), index))
            except NoAdmissibleStart as error:
                refusal = refusal or error
        if scores:
            return maps[min(scores)[1]]
    assert refusal is not None
    raise refusal


def alike_in_contact(maps: Sequence[InteractionFeatures], threshold: float) -> list[list[int]]:
    """Indices of the maps, those that expect the same contacts together, in order of preference.

    Energies of maps compare only where the contacts are the same: who expects fewer pays less.
    """
    groups: list[list[int]] = []
    for index, features in enumerate(maps):
        touching = features.contact > threshold
        for group in groups:
            if np.array_equal(maps[group[0]].contact > threshold, touching):
                group.append(index)
                break
        else:
            groups.append([index])
    return groups

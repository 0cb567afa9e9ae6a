"""Interaction models by name, and the choice of one feature map among those they offer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from experiments.body.model import BodyModel
from experiments.interaction.features import InteractionFeatures
from experiments.interaction.geometric import geometric_features
from experiments.interaction.learned import SHIPPED, learned_features
from experiments.motion.motion import Motion
from experiments.scene.scene import MPCAT40, Scene

InteractionModel = Callable[[Motion, BodyModel, Sequence[str]], tuple[InteractionFeatures, ...]]
"""(motion, body, classes of the scene) -> feature maps, in the order of the model's preference."""

INTERACTIONS: dict[str, InteractionModel] = {
    "geometric": geometric_features,
    **{name: partial(learned_features, model=name) for name in SHIPPED},
}
"""Models that predict contact and classes; `PlacementSettings.interaction` names one."""

VOID, FLOOR = 0, 2


def first_fitting_map(
    maps: Sequence[InteractionFeatures], scene: Scene, count_floor: bool = True
) -> int:
    """POSA's choice: index of the first map whose most common class exists in the scene, else 0.

    The most common class is that over all vertices and frames, void left out. Without `count_floor`
    (ours) the floor is left out too: it is everywhere, and nearly always the most common.
    """
    present = set(scene.class_names())
    for index, features in enumerate(maps):
        counts = class_counts(features)
        if not count_floor:
            counts[FLOOR] = 0
        if counts.sum() == 0 or MPCAT40[int(counts.argmax())] in present:
            return index
    return 0


def class_counts(features: InteractionFeatures) -> np.ndarray:
    """How many vertices, over all frames, have each class as their highest score; void is 0."""
    counts = np.bincount(features.semantics.argmax(-1).ravel(), minlength=len(MPCAT40))
    counts[VOID] = 0
    return counts

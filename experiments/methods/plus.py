"""The `plus` block: the three placement methods with scene terms of ours, the same for all.

The paper prints none of these terms, so nothing here may stand in one row with its methods. What
is added: contact vertices pay for what is deeper than 3 mm, starts must bring the body to the
classes it expects whatever the preset, and PACE's alteration holds standing feet and does not
tremble.
"""

from __future__ import annotations

import dataclasses

from experiments.body.model import BodyModel
from experiments.methods.paak import paak_weights
from experiments.methods.pace import place_altered
from experiments.methods.posa_t import alike
from experiments.methods.preparation import prepare
from experiments.methods.rigid import place_rigid, rigid_fits
from experiments.motion.motion import Motion
from experiments.placement.placement import Placement
from experiments.placement.settings import PlacementSettings
from experiments.scene.scene import Scene

CONTACT_TOLERANCE_M = 0.003
SLIDE_WEIGHT = 5000.0
BEND_WEIGHT = 300.0


def posa_t_plus(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings, seed: int
) -> Placement:
    """POSA-T with the scene terms of this block. Raises `PlacementError`."""
    problem = prepare(motion, scene, body, settings, seed, alike, plus_settings(settings))
    return place_rigid(problem, "posa_t_plus", seed)


def paak_plus(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings, seed: int
) -> Placement:
    """PAAK-style placement with the scene terms of this block. Raises `PlacementError`."""
    problem = prepare(motion, scene, body, settings, seed, paak_weights, plus_settings(settings))
    return place_rigid(problem, "paak_plus", seed)


def pace_plus(
    motion: Motion, scene: Scene, body: BodyModel, settings: PlacementSettings, seed: int
) -> Placement:
    """PACE with the scene terms of this block and a steady alteration. Raises `PlacementError`."""
    problem = prepare(motion, scene, body, settings, seed, energy=plus_settings(settings))
    return place_altered(problem, rigid_fits(problem), "pace_plus", seed)


def plus_settings(settings: PlacementSettings) -> PlacementSettings:
    """The settings of this block: those given, with its terms and checks switched on."""
    checks = PlacementSettings()
    return dataclasses.replace(
        settings,
        contact_tolerance=CONTACT_TOLERANCE_M,
        slide_weight=SLIDE_WEIGHT,
        bend_weight=BEND_WEIGHT,
        start_filter=settings.start_filter or checks.start_filter,
        max_depth=settings.max_depth or checks.max_depth,
        max_gap=settings.max_gap or checks.max_gap,
        bone_clearance=settings.bone_clearance or checks.bone_clearance,
    )

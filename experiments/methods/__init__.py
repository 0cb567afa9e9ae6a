"""The methods that place a motion in a scene, by name. Adding one is a file and an entry here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from experiments.body.model import BodyModel
from experiments.methods.ablations import pace_no_motion, pace_no_pose
from experiments.methods.paak import paak
from experiments.methods.pace import pace
from experiments.methods.plus import paak_plus, pace_plus, posa_t_plus
from experiments.methods.posa_t import posa_t
from experiments.methods.synthesis import display_name, synthesis
from experiments.motion.motion import Motion
from experiments.placement.placement import Placement
from experiments.placement.settings import PlacementSettings
from experiments.scene.scene import Scene

Place = Callable[[Motion, Scene, BodyModel, PlacementSettings, int], Placement]
"""(motion, scene, body, settings, seed) -> placement; raises `PlacementError` where there is none.

The seed stands for all that a method draws at random; `synthesis` alone draws, the others record it.
"""


@dataclass(frozen=True)
class Method:
    """A named way to place a motion."""

    place: Place
    display_name: str
    summary: str
    """One line."""
    alters_motion: bool
    study: bool
    """Shown to participants; the others are placed and scored only."""
    block: Literal["paper", "plus", "ablation"] = "paper"
    """Which table it stands in: `plus` methods share scene terms of ours that the paper does not
    print, so that they compare with one another and not with the `paper` block."""
    shares_motion: bool = True
    """Whether the motion that it is given is the one that it places; if not, it fills the motion's slot
    (name, frames, frame rate) with a motion of its own."""


METHODS: dict[str, Method] = {
    "posa_t": Method(
        posa_t,
        "POSA-T",
        "POSA's loss summed over all frames; the motion is moved rigidly, all frames count alike",
        alters_motion=False,
        study=True,
    ),
    "synthesis": Method(
        synthesis,
        display_name(),
        "a motion of its own for the room: sub-goal bodies, route, poses, refinement (Wang et al. 2021)",
        alters_motion=True,
        study=True,
        shares_motion=False,
    ),
    "paak": Method(
        paak,
        "PAAK-style (re-implemented)",
        "POSA's loss with every frame weighted; the motion is moved rigidly",
        alters_motion=False,
        study=True,
    ),
    "pace": Method(
        pace,
        "PACE",
        "weighted frames; place, pose and translation of every frame are optimised together",
        alters_motion=True,
        study=True,
    ),
    "pace_no_pose": Method(
        pace_no_pose,
        "PACE without pose term",
        "ablation: nothing holds a pose to the original",
        alters_motion=True,
        study=False,
        block="ablation",
    ),
    "pace_no_motion": Method(
        pace_no_motion,
        "PACE without motion term",
        "ablation: nothing holds a frame to its neighbours",
        alters_motion=True,
        study=False,
        block="ablation",
    ),
    "posa_t_plus": Method(
        posa_t_plus,
        "POSA-T+ (ours)",
        "POSA-T with the scene terms of PACE+",
        alters_motion=False,
        study=False,
        block="plus",
    ),
    "paak_plus": Method(
        paak_plus,
        "PAAK-style+ (ours)",
        "PAAK-style placement with the scene terms of PACE+",
        alters_motion=False,
        study=False,
        block="plus",
    ),
    "pace_plus": Method(
        pace_plus,
        "PACE+ (ours)",
        "PACE; contacts must not sink in, standing feet are held, nothing trembles",
        alters_motion=True,
        study=False,
        block="plus",
    ),
}
"""Every method there is, in the order of tables."""

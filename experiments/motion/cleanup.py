"""Clean-up of a retargeted or composed motion: floor, root, feet, in this order."""

from __future__ import annotations

from experiments.motion.figure import Figure
from experiments.motion.foot_lock import lock_feet
from experiments.motion.ground import ground
from experiments.motion.motion import Motion
from experiments.motion.root import drive_root

RECORDED_SPEED_LIMIT = 0.35
BLENDED_SPEED_LIMIT = 0.7


def clean_recording(motion: Motion, figure: Figure) -> Motion:
    """Recorded motion that stays on its feet: its own root path is kept."""
    return lock_feet(ground(motion, figure), figure, RECORDED_SPEED_LIMIT)


def clean_blend(motion: Motion, figure: Figure) -> Motion:
    """Composed motion: blending makes feet slide, so the root is driven by them."""
    driven = drive_root(ground(motion, figure), figure)
    return lock_feet(driven, figure, BLENDED_SPEED_LIMIT)

"""Results that are not placements: why a motion has no place in a scene."""

from __future__ import annotations


class PlacementError(Exception):
    """A motion that a method could not place; one line naming motion, scene and reason.

    This is an outcome to record, not a fault of the program: the pipeline drops the (scene, motion)
    for every study method together.
    """

    def __init__(self, motion_id: str, scene_id: str, reason: str) -> None:
        super().__init__(f"motion {motion_id} in scene {scene_id}: {reason}")
        self.motion_id, self.scene_id, self.reason = motion_id, scene_id, reason


class MotionTooLong(PlacementError):
    """The motion covers more ground than the room has, whichever way it is turned."""


class NoAdmissibleStart(PlacementError):
    """No start of the grid fits: the scene offers nothing of the kind the motion interacts with."""


class OptimisationFailed(PlacementError):
    """Not one start reached a finite energy."""

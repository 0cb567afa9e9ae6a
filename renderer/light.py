"""The light of every room: one fixed key light with shadows, sky and ground ambient, a soft fill.

The light is tied to the room's axes and to nothing else, so that all clips of a room are lit alike
whatever the body does. Colours are linear RGB.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

KEY_AZIMUTH_DEG, KEY_ELEVATION_DEG = -62.0, 58.0
KEY_COLOUR = (1.0, 0.965, 0.90)
KEY_INTENSITY = 2.0
SKY_AMBIENT = (0.555, 0.57, 0.59)
GROUND_AMBIENT = (0.42, 0.41, 0.395)
FILL_COLOUR = (0.15, 0.155, 0.165)
FILL_AZIMUTH_DEG, FILL_ELEVATION_DEG = 118.0, 22.0
BACKGROUND = (0.93, 0.93, 0.925)
"""sRGB of the void around the room."""

OVERHANG = 0.7
"""Metres around the room box that still cast and receive shadows."""
DEPTH_RANGE = 40.0


@dataclass(frozen=True)
class LightBox:
    """The orthographic box of the shadow map: world to light-camera and to clip coordinates."""

    view: Float[np.ndarray, "4 4"]
    projection: Float[np.ndarray, "4 4"]
    half_width: float
    half_height: float

    def texel(self, shadow_size: int) -> float:
        """Metres along the longer side of one texel."""
        return 2 * max(self.half_width, self.half_height) / shadow_size


def light_direction(azimuth_deg: float, elevation_deg: float) -> Float[np.ndarray, "3"]:
    """Unit vector in which the light travels, for a light seen at this azimuth and elevation."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    towards = (
        math.cos(elevation) * math.cos(azimuth),
        math.cos(elevation) * math.sin(azimuth),
        math.sin(elevation),
    )
    return -np.array(towards)


def walls_towards_key() -> set[str]:
    """Groups of the walls between the key light and the room: they and what hangs there cast none.

    The bare wall is open to the light (its back is culled), and the frames of its doors and windows
    alone would draw meaningless lines over the floor.
    """
    towards = -light_direction(KEY_AZIMUTH_DEG, KEY_ELEVATION_DEG)
    outward = {"n": towards[1], "s": -towards[1], "e": towards[0], "w": -towards[0]}
    return {f"wall:{wall}" for wall, share in outward.items() if share > 0}


def light_pose() -> Float[np.ndarray, "4 4"]:
    """Camera-to-world pose of the key light, looking along -z (origin arbitrary)."""
    back = -light_direction(KEY_AZIMUTH_DEG, KEY_ELEVATION_DEG)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(back, right), back
    return pose


def light_box(room_size: tuple[float, float, float], floor_z: float) -> LightBox:
    """The shadow box of a room: the room box with its overhang, seen from the key light.

    It depends on the room alone. A box that followed the body would shift the shadow grid from
    frame to frame and from method to method.
    """
    low = np.array([-OVERHANG, -OVERHANG, floor_z - 0.1])
    high = np.array([room_size[0] + OVERHANG, room_size[1] + OVERHANG, floor_z + room_size[2]])
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1).T
    pose = light_pose()
    seen = corners @ pose[:3, :3]
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    half = 0.5 * (seen.max(axis=0) - seen.min(axis=0))
    pose[:3, 3] = pose[:3, :3] @ (middle + np.array([0.0, 0.0, DEPTH_RANGE / 2]))
    projection = np.diag([1 / half[0], 1 / half[1], -2 / DEPTH_RANGE, 1.0])
    projection[2, 3] = -1.0
    return LightBox(np.linalg.inv(pose), projection, float(half[0]), float(half[1]))


def sky_box(room_size: tuple[float, float, float], floor_z: float) -> LightBox:
    """The orthographic box of the contact map: the room seen from below, looking up.

    The map holds the height of the body's underside over every floor point; what stands close
    above a surface keeps the sky's light from it.
    """
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    half_x, half_y = room_size[0] / 2 + OVERHANG, room_size[1] / 2 + OVERHANG
    pose[:3, 3] = [room_size[0] / 2, room_size[1] / 2, floor_z - 1.0]
    projection = np.diag([1 / half_x, 1 / half_y, -2 / SKY_RANGE, 1.0])
    projection[2, 3] = -1.0
    return LightBox(np.linalg.inv(pose), projection, half_x, half_y)


SKY_RANGE = 8.0

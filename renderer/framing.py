"""Framing: the box a motion sweeps through, and the closest camera that shows all of it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

ROOM_OVERHANG = 0.5
"""Bodies are clipped to the room box plus this many metres before they may move a camera."""
MARGIN_M = 0.6
MIN_WIDTH_M = 2.2
MIN_HEIGHT_M = 0.9
FRAME_MARGIN = 0.03
"""Share of the picture left free on each side."""


def swept_box(
    bodies: Sequence[Float[np.ndarray, "_ V 3"]],
    room_size: tuple[float, float, float],
    floor_z: float,
) -> Float[np.ndarray, "2 3"]:
    """The axis-aligned box to be framed: low and high corner in metres.

    It holds all bodies in all frames (clipped to the room box plus 0.5 m) with a margin of 0.6 m
    to the sides, is at least 2.2 m wide, and stands on the floor.
    """
    low_limit, high_limit = room_limits(room_size, floor_z)
    clipped = [np.clip(_ends(vertices), low_limit, high_limit) for vertices in bodies]
    low = np.min([ends[0] for ends in clipped], axis=0)
    high = np.max([ends[1] for ends in clipped], axis=0)
    missing = np.maximum(MIN_WIDTH_M - (high - low)[:2], 2 * MARGIN_M) / 2
    low[:2] -= missing
    high[:2] += missing
    low[2] = floor_z
    high[2] = max(high[2] + 0.05, floor_z + MIN_HEIGHT_M)
    return np.stack([low, high])


def room_limits(
    room_size: tuple[float, float, float], floor_z: float
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Low and high corner of the room box plus its overhang."""
    low = np.array([0.0, 0.0, floor_z]) - ROOM_OVERHANG
    high = np.array([room_size[0], room_size[1], floor_z + room_size[2]]) + ROOM_OVERHANG
    return low, high


def fit_camera(
    box: Float[np.ndarray, "2 3"],
    azimuth_deg: float,
    elevation_deg: float,
    yfov: float,
    aspect: float,
) -> Float[np.ndarray, "4 4"]:
    """Camera-to-world pose of the nearest camera in this direction that frames the whole box.

    In camera axes (right, up, back) a corner c is inside the frame of a camera at p when
    |c_r - p_r| <= k (p_b - c_b), and likewise upwards. Taking the extreme corners on both sides
    gives the smallest p_b in closed form, and the centred p_r, p_u.
    """
    pose = look_from(azimuth_deg, elevation_deg)
    corners = np.array(np.meshgrid(*box.T)).reshape(3, -1).T @ pose[:3, :3]
    right, up, back = corners.T
    tangent = math.tan(yfov / 2) * (1 - 2 * FRAME_MARGIN)
    position = np.zeros(3)
    distances = []
    for axis, (across, slope) in enumerate(((right, tangent * aspect), (up, tangent))):
        highest = float((across + slope * back).max())
        lowest = float((across - slope * back).min())
        position[axis] = (highest + lowest) / 2
        distances.append((highest - lowest) / (2 * slope))
    position[2] = max(distances)
    pose[:3, 3] = pose[:3, :3] @ position
    return pose


def look_from(azimuth_deg: float, elevation_deg: float) -> Float[np.ndarray, "4 4"]:
    """Pose at the origin of a camera that stands at this azimuth and elevation and looks back."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    back = np.array([
        math.cos(elevation) * math.cos(azimuth),
        math.cos(elevation) * math.sin(azimuth),
        math.sin(elevation),
    ])  # fmt: skip
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(back, right), back
    return pose


def _ends(vertices: Float[np.ndarray, "T V 3"]) -> Float[np.ndarray, "2 3"]:
    flat = vertices.reshape(-1, 3)
    return np.stack([flat.min(axis=0), flat.max(axis=0)]).astype(np.float64)

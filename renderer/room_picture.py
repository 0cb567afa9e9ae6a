"""A picture of a room without anybody in it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8

from renderer.cameras import YFOV_DEG, single_camera
from renderer.cutaway import Cutaway
from renderer.framing import fit_camera
from renderer.settings import RenderSettings
from renderer.stage import StagePart

FRAMED_HEIGHT_M = 1.6
"""The picture frames the room up to this height: what is above are mostly bare walls."""


def room_picture(
    parts: Sequence[StagePart],
    room_size: tuple[float, float, float],
    floor_z: float,
    azimuth_deg: float,
    elevation_deg: float,
    settings: RenderSettings,
) -> UInt8[np.ndarray, "h w 3"]:
    """The whole room from outside, as clips draw it: no ceiling, no walls on the camera's side.

    `azimuth_deg` is where the camera stands, counter-clockwise from east. Raises `InputError` for
    a room that cannot be drawn and for a missing platform.
    """
    from renderer.offscreen import context_number, offscreen

    box = np.array([[0.0, 0.0, floor_z], [*room_size[:2], floor_z + FRAMED_HEIGHT_M]])
    yfov = math.radians(YFOV_DEG)
    pose = fit_camera(box, azimuth_deg, elevation_deg, yfov, settings.width / settings.height)
    hidden = Cutaway.of_room(parts, room_size, floor_z).hidden_before_room(pose[:3, 3], box)
    view = single_camera(pose, yfov, sorted(hidden)).views[0]
    with offscreen(settings.platform):
        from renderer.static_room import StaticRoom
        from renderer.surfaces import surfaces_of

        room = StaticRoom(
            parts, room_size, floor_z, (view,), dataclasses.replace(settings, tiling="single"),
            surfaces_of(context_number()),
        )  # fmt: skip
        picture = room.views[0].background
        room.delete()
    return picture

"""Camera paths: one camera pose a frame, for clips that go round a person, follow one or fly."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from renderer.cameras import YFOV_DEG, CameraView
from renderer.files import InputError, read_json
from renderer.framing import FRAME_MARGIN, look_from

HiddenFrom = Callable[[Float[np.ndarray, "3"]], frozenset[str]]
"""What a camera at this place must not draw; `Cutaway.hidden_from` with its other arguments."""

SCHEMA_VERSION = 1
ORBIT_ELEVATION_DEG = 28.0
FOLLOW_SMOOTHING_S = 0.5
RECUT_M = 0.5
"""A flying camera's cutaway is chosen anew when it has moved this far, not in every frame."""


def orbit(
    box: Float[np.ndarray, "2 3"],
    start_deg: float,
    n_frames: int,
    aspect: float,
    hidden_from: HiddenFrom,
) -> tuple[CameraView, ...]:
    """One full turn around `box` (low and high corner, metres), counter-clockwise from above.

    The distance is constant and frames the box from all sides. The cutaway changes four times, when
    the camera passes a corner of the room's axes.
    """
    azimuths = start_deg + 360.0 * np.arange(n_frames) / n_frames
    yfov = math.radians(YFOV_DEG)
    centre = box.mean(0)
    distance = max(_framing_distance(box, azimuth, yfov, aspect) for azimuth in azimuths)
    quarters = [_stand(centre, 45.0 + 90.0 * k, ORBIT_ELEVATION_DEG, distance) for k in range(4)]
    hidden = [hidden_from(pose[:3, 3]) for pose in quarters]
    return tuple(
        _view(
            _stand(centre, azimuth, ORBIT_ELEVATION_DEG, distance),
            yfov,
            hidden[int(azimuth % 360 // 90)],
        )
        for azimuth in azimuths
    )


def follow(
    places: Float[np.ndarray, "N 3"],
    fps: float,
    view: CameraView,
    reach: float,
    aspect: float,
) -> tuple[CameraView, ...]:
    """Keep the direction of `view` and travel with the body.

    `places` are the body's centre per frame (metres), smoothed over half a second so that steps do
    not shake the picture; a sphere of radius `reach` around it stays in the frame.
    """
    smooth = _smoothed(places, FOLLOW_SMOOTHING_S * fps)
    rotation = view.matrix[:3, :3]
    narrow = math.atan(math.tan(view.yfov / 2) * min(1.0, aspect))
    back = rotation[:, 2] * reach / math.sin(narrow)
    views = []
    for place in smooth:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, place + back
        views.append(_view(pose, view.yfov, frozenset(view.hidden)))
    return tuple(views)


def read_path(
    source: Path, times: Float[np.ndarray, " N"], hidden_from: HiddenFrom
) -> tuple[CameraView, ...]:
    """A path from a file: keys with `time` (s), `position` and `target` (metres, scene frame).

    Between keys positions and targets run along monotone cubic curves (they never overshoot a
    key); before the first and after the last the camera stands. One key is a fixed camera.
    Raises `InputError` naming file, key and value.
    """
    yfov, keys = _read_keys(source)
    positions, targets = (_between(keys, name, times) for name in ("position", "target"))
    views: list[CameraView] = []
    hidden, chosen_at = frozenset[str](), np.full(3, np.inf)
    for position, target in zip(positions, targets, strict=True):
        if not np.linalg.norm(position - chosen_at) < RECUT_M:
            hidden, chosen_at = hidden_from(position), position
        views.append(_view(_look_at(source, position, target), yfov, hidden))
    return tuple(views)


def same_cutaway(views: tuple[CameraView, ...]) -> Iterator[tuple[CameraView, ...]]:
    """Runs of consecutive views that hide the same, in order."""
    for _, run in itertools.groupby(views, key=lambda view: view.hidden):
        yield tuple(run)


def _view(pose: Float[np.ndarray, "4 4"], yfov: float, hidden: frozenset[str]) -> CameraView:
    rows = tuple(tuple(float(x) for x in row) for row in pose)
    return CameraView("path", rows, yfov, tuple(sorted(hidden)), 0.0, 0.0, 1.0, 1.0)


def _stand(
    centre: Float[np.ndarray, "3"], azimuth: float, elevation: float, distance: float
) -> Float[np.ndarray, "4 4"]:
    pose = look_from(azimuth, elevation)
    pose[:3, 3] = centre + distance * pose[:3, 2]
    return pose


def _framing_distance(
    box: Float[np.ndarray, "2 3"], azimuth: float, yfov: float, aspect: float
) -> float:
    """How far from the box's centre a camera that looks at it must stand to see all of it."""
    corners = np.array(np.meshgrid(*(box - box.mean(0)).T)).reshape(3, -1).T
    right, up, back = (corners @ look_from(azimuth, ORBIT_ELEVATION_DEG)[:3, :3]).T
    slope = math.tan(yfov / 2) * (1 - 2 * FRAME_MARGIN)
    return float((np.maximum(np.abs(right) / aspect, np.abs(up)) / slope + back).max())


def _look_at(
    source: Path, position: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "4 4"]:
    back = position - target
    distance = float(np.linalg.norm(back))
    if distance < 1e-3:
        raise InputError(source, "target", target.round(3).tolist(), "a point away from position")
    azimuth = math.degrees(math.atan2(back[1], back[0]))
    elevation = math.degrees(math.asin(np.clip(back[2] / distance, -1.0, 1.0)))
    return _stand(target, azimuth, elevation, distance)


def _smoothed(places: Float[np.ndarray, "N 3"], sigma: float) -> Float[np.ndarray, "N 3"]:
    from scipy.ndimage import gaussian_filter1d

    smooth: Float[np.ndarray, "N 3"] = gaussian_filter1d(
        places.astype(np.float64), sigma, axis=0, mode="nearest"
    )
    return smooth


def _between(
    keys: list[dict[str, Any]], name: str, times: Float[np.ndarray, " N"]
) -> Float[np.ndarray, "N 3"]:
    at = np.array([key["time"] for key in keys])
    points = np.array([key[name] for key in keys])
    if len(keys) == 1:
        return np.repeat(points, len(times), axis=0)
    curve = PchipInterpolator(at, points, axis=0)
    run: Float[np.ndarray, "N 3"] = curve(np.clip(times, at[0], at[-1]))
    return run


def _read_keys(source: Path) -> tuple[float, list[dict[str, Any]]]:
    record = read_json(source)
    if not isinstance(record, dict) or record.get("schema_version") != SCHEMA_VERSION:
        found = record.get("schema_version", "nothing") if isinstance(record, dict) else "no table"
        raise InputError(source, "schema_version", found, f"the number {SCHEMA_VERSION}")
    for name in sorted(record.keys() - {"schema_version", "fov_deg", "keys"}):
        raise InputError(source, name, record[name], "one of schema_version, fov_deg, keys")
    fov = record.get("fov_deg", YFOV_DEG)
    if not _is_number(fov) or not 5 <= fov <= 120:
        raise InputError(source, "fov_deg", fov, "a vertical angle of 5 to 120 degrees")
    keys = record.get("keys")
    if not isinstance(keys, list) or not keys:
        raise InputError(source, "keys", keys, "a list of at least one key")
    read = [_read_key(source, index, raw) for index, raw in enumerate(keys)]
    for index, (before, after) in enumerate(itertools.pairwise(read)):
        if after["time"] <= before["time"]:
            raise InputError(source, f"keys[{index + 1}].time", after["time"], "rising times")
    return math.radians(fov), read


def _read_key(source: Path, index: int, raw: Any) -> dict[str, Any]:
    where = f"keys[{index}]"
    if not isinstance(raw, dict) or raw.keys() - {"time", "position", "target"}:
        raise InputError(source, where, raw, "a table of time, position and target")
    if not _is_number(raw.get("time", 0.0)):
        raise InputError(source, f"{where}.time", raw["time"], "seconds")
    for name in ("position", "target"):
        value = raw.get(name)
        if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
            raise InputError(source, f"{where}.{name}", value, "three numbers in metres")
    return {
        "time": float(raw.get("time", 0.0)),
        **{name: [float(x) for x in raw[name]] for name in ("position", "target")},
    }


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

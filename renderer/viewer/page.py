"""The 3D viewer as a folder: one page, its data as scripts, and the models as glTF files.

Data are scripts and not files to fetch, because a page opened from the disk (`file://`) may load
scripts beside it and nothing else. Each is gzip, then base64. three.js lies in the folder of its
licence, unmodified; the page compresses it and gives its modules their addresses at run time.
"""

from __future__ import annotations

import base64
import dataclasses
import gzip
import html
import json
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from renderer import light
from renderer.files import InputError, write_bytes

SCHEMA_VERSION = 1
MODULES = (
    "three/three.core.js", "three/three.module.js", "three/OrbitControls.js",
    "page/glb.js", "page/skin.js", "page/marks.js", "page/clock.js", "page/room.js",
    "page/body.js", "page/stage.js", "page/graph.js", "page/app.js",
)  # fmt: skip
"""In order of dependency: a module may import only those before it."""


@dataclass(frozen=True)
class ViewerBody:
    """One animated body of the page."""

    key: str
    """Name in files and in the page's programming interface."""
    label: str
    glb: bytes
    error_p99_mm: float
    error_max_mm: float


@dataclass(frozen=True)
class ViewerCamera:
    """A camera to start from; metres, z up, 32 degrees high, 16:9."""

    label: str
    eye: tuple[float, float, float]
    target: tuple[float, float, float]


@dataclass(frozen=True)
class ViewerPage:
    """What the page shows. Room box [0, W] x [0, D] x [floor_z, floor_z + H], metres, z up."""

    scene: str
    scene_label: str
    motion_label: str
    fps: float
    n_frames: int
    room_size: tuple[float, float, float]
    floor_z: float
    tolerance_mm: float
    room: bytes
    bodies: tuple[ViewerBody, ...]
    views: tuple[ViewerCamera, ...] = ()
    """Offered as buttons; the first is where the page opens."""


def write_page(page: ViewerPage, out: Path) -> dict[str, Any]:
    """Write the page into the folder `out`; `index.html` last. Returns names and sizes.

    Raises InputError if the folder cannot be written.
    """
    files = dict(_files(page))
    try:
        for name, content in files.items():
            write_bytes(out / name, content)
    except OSError as error:
        raise InputError(out, "--out", error.strerror, "a folder that can be written") from None
    opened = [name for name in files if name == "index.html" or name.startswith("data/")]
    return {
        "page": str(out / "index.html"),
        "page_bytes": sum(len(files[name]) for name in opened),
        "bodies": {
            body.key: {
                "label": body.label,
                "error_p99_mm": body.error_p99_mm,
                "error_max_mm": body.error_max_mm,
                "glb": str(out / f"models/{body.key}.glb"),
                "glb_bytes": len(body.glb),
                "page_bytes": len(files[f"data/{body.key}.js"]),
            }
            for body in page.bodies
        },
        "room_bytes": len(files["data/room.js"]),
    }


def _files(page: ViewerPage) -> Iterator[tuple[str, bytes]]:
    yield "models/room.glb", page.room
    yield "data/room.js", _script("room", page.room)
    for body in page.bodies:
        yield f"models/{body.key}.glb", body.glb
        yield f"data/{body.key}.js", _script(body.key, body.glb)
    yield "data/program.js", _script("program", _program())
    yield "three.js-LICENSE.txt", _asset("three/LICENSE")
    yield "index.html", _index(page)


def _script(key: str, content: bytes) -> bytes:
    packed = base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()
    return f"paceViewerData({json.dumps(key)}, {json.dumps(packed)});\n".encode()


def _program() -> bytes:
    return json.dumps([[name, _asset(name).decode()] for name in MODULES]).encode()


def _asset(name: str) -> bytes:
    return resources.files("renderer.viewer").joinpath(name).read_bytes()


def _index(page: ViewerPage) -> bytes:
    # "<" is written so that no text of ours can end the script element.
    manifest = json.dumps(_manifest(page), sort_keys=True).replace("<", "\\u003c")
    return _filled(
        _asset("index.html").decode(),
        title=html.escape(f"{page.scene_label}: {page.motion_label}"),
        scene_label=html.escape(page.scene_label),
        motion_label=html.escape(page.motion_label),
        methods="\n".join(_choice(number, body) for number, body in enumerate(page.bodies, 1)),
        views="\n".join(_view_button(index, view) for index, view in enumerate(page.views)),
        tolerance=f"{page.tolerance_mm:g}",
        last_frame=str(page.n_frames - 1),
        style=_asset("viewer.css").decode(),
        boot=_asset("boot.js").decode(),
        manifest=manifest,
    ).encode()


def _choice(number: int, body: ViewerBody) -> str:
    mark, key = (" checked" if number == 1 else ""), html.escape(body.key)
    shortcut = f"<kbd>{number}</kbd>" if number < 10 else ""
    return (
        f'    <label><input type="radio" name="method" value="{key}"{mark}>'
        f'<span class="name">{html.escape(body.label)}{shortcut}</span></label>'
    )


def _view_button(index: int, view: ViewerCamera) -> str:
    label = html.escape(view.label)
    return f'      <button type="button" data-view="{index}" title="Look from {label} (V)">{label}</button>'


def _filled(template: str, **values: str) -> str:
    # Piece by piece, so that a value that looks like a placeholder stays as it is.
    pieces = template.split("{{")
    rest = (piece.split("}}", 1) for piece in pieces[1:])
    return pieces[0] + "".join(values[name] + text for name, text in rest)


def _manifest(page: ViewerPage) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "scene": page.scene,
        "scene_label": page.scene_label,
        "motion_label": page.motion_label,
        "fps": page.fps,
        "n_frames": page.n_frames,
        "room_size": list(page.room_size),
        "floor_z": page.floor_z,
        "tolerance_mm": page.tolerance_mm,
        "bodies": [
            {
                "key": body.key,
                "label": body.label,
                "error_p99_mm": round(body.error_p99_mm, 3),
                "error_max_mm": round(body.error_max_mm, 3),
            }
            for body in page.bodies
        ],
        "views": [dataclasses.asdict(view) for view in page.views],
        "light": {
            "key_travels": light.light_direction(
                light.KEY_AZIMUTH_DEG, light.KEY_ELEVATION_DEG
            ).tolist(),
            "key_colour": list(light.KEY_COLOUR),
            "key_intensity": light.KEY_INTENSITY,
            "sky": list(light.SKY_AMBIENT),
            "ground": list(light.GROUND_AMBIENT),
            "fill_travels": light.light_direction(
                light.FILL_AZIMUTH_DEG, light.FILL_ELEVATION_DEG
            ).tolist(),
            "fill_colour": list(light.FILL_COLOUR),
            "no_shadow_from": sorted(light.walls_towards_key()),
        },
    }

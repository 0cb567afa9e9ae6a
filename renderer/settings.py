"""Settings of a render: sizes, tiling, encoding and platform, with presets by name."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

from renderer.files import InputError

Tiling = Literal["grid", "strip", "single"]
Platform = Literal["osmesa", "egl", "auto"]

_SIZES = {
    "demo": (480, 270),
    "480p": (854, 480),
    "540p": (960, 540),
    "720p": (1280, 720),
    "1080p": (1920, 1080),
}
"""Width and height in pixels of one view; a 2x2 clip is twice as wide and twice as high."""


@dataclass(frozen=True)
class RenderSettings:
    """What decides the look, size and bytes of a clip, besides the stage and the cameras."""

    width: int = 960
    """Pixels of one view (even)."""
    height: int = 540
    tiling: str = "grid"
    """grid: 2x2 views; strip: 1x4 views side by side; single: the best view alone."""
    fps: float = 30.0
    msaa: int = 4
    """Samples a pixel: 4, or 0 for no anti-aliasing."""
    crf: int = 18
    """x264's constant rate factor; 18 is visually close to lossless."""
    platform: str = "auto"
    """auto: OSMesa where its library is found, else EGL; the one in use goes into the catalogue."""
    shadow_size: int = 2048
    """Texels along a side of the key light's shadow map."""

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            value = getattr(self, name)
            if not isinstance(value, int) or not 16 <= value <= 4096 or value % 2:
                self._refuse(name, "an even number of pixels from 16 to 4096")
        if self.tiling not in get_args(Tiling):
            self._refuse("tiling", "one of " + ", ".join(get_args(Tiling)))
        if self.platform not in get_args(Platform):
            self._refuse("platform", "one of " + ", ".join(get_args(Platform)))
        if not (math.isfinite(self.fps) and 1 <= self.fps <= 120):
            self._refuse("fps", "1 to 120 frames a second")
        if self.msaa not in (0, 4):
            self._refuse("msaa", "0 or 4 samples a pixel")
        if not isinstance(self.crf, int) or not 0 <= self.crf <= 51:
            self._refuse("crf", "a whole number from 0 to 51")
        if self.shadow_size not in (512, 1024, 2048, 4096):
            self._refuse("shadow_size", "512, 1024, 2048 or 4096")

    def _refuse(self, name: str, wanted: str) -> None:
        raise InputError("render settings", name, getattr(self, name), wanted)

    @property
    def clip_size(self) -> tuple[int, int]:
        """Width and height of the whole video in pixels."""
        columns, rows = {"grid": (2, 2), "strip": (4, 1), "single": (1, 1)}[self.tiling]
        return columns * self.width, rows * self.height

    def to_dict(self) -> dict[str, Any]:
        """All settings as JSON values."""
        return dataclasses.asdict(self)


PRESETS: dict[str, RenderSettings] = {
    name: RenderSettings(width=width, height=height) for name, (width, height) in _SIZES.items()
}
"""Ready-made settings by name; they differ in the size of a view alone."""


def preset(name: str, **changes: Any) -> RenderSettings:
    """Settings by preset name, with single settings changed by keyword.

    Raises `InputError` for an unknown preset, setting or value.
    """
    if name not in PRESETS:
        raise InputError("render settings", "preset", name, "one of " + ", ".join(PRESETS))
    known = {field.name for field in dataclasses.fields(RenderSettings)}
    for key in sorted(changes.keys() - known):
        raise InputError("render settings", key, changes[key], "no setting of this name")
    return dataclasses.replace(PRESETS[name], **changes)

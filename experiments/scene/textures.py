"""Procedural floor and wall textures: square sRGB tiles that repeat without a seam."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

PIXELS = 512
TILE_METRES = 2.0
"""Side of one tile on the floor or wall."""
BRIGHTEST = 0.86
"""Albedo above this would clip in the light."""

Colour = tuple[float, float, float]
Image = Float[np.ndarray, "s s"]


def floor_texture(kind: str, tint: Colour, seed: int = 0) -> UInt8[np.ndarray, "s s 3"]:
    """Boards, tiles or carpet around the colour `tint` (sRGB); `kind` is wood, tile or carpet."""
    pattern = {"wood": _wood, "tile": _tile, "carpet": _carpet}[kind]
    return _coloured(pattern(np.random.default_rng([seed, 1])), tint)


def paint_texture(colour: Colour, seed: int = 0) -> UInt8[np.ndarray, "s s 3"]:
    """Wall paint: the colour with the faint unevenness of a roller."""
    rng = np.random.default_rng([seed, 2])
    return _coloured(1 + 0.005 * _noise(rng, 24.0, 24.0) + 0.006 * _noise(rng, 1.2, 1.2), colour)


def _wood(rng: np.random.Generator) -> Float[np.ndarray, "s s 3"]:
    """Boards of 12.5 cm by 1 m along the first texture axis, each of its own shade and grain."""
    rows, per_row = 16, 2
    y, x = np.mgrid[0:PIXELS, 0:PIXELS]
    height, length = PIXELS // rows, PIXELS // per_row
    row = y // height
    shift = rng.permutation(rows)[row] * (length // rows) * 3
    board = (x + shift) // length % per_row + per_row * row
    shade = rng.uniform(-0.075, 0.075, rows * per_row)[board]
    warm = rng.uniform(-0.02, 0.02, rows * per_row)[board]
    # Every board is cut from another place of the same endless grain.
    grain = (
        0.030 * _noise(rng, 90.0, 1.6)
        + 0.022 * _noise(rng, 30.0, 3.0)
        + 0.012 * _noise(rng, 8.0, 0.7)
    )
    offset = rng.integers(0, PIXELS, rows * per_row)[board]
    grain = grain[(y + 7 * board) % PIXELS, (x + offset) % PIXELS]
    joint = _joint(y % height) * 0.16 + _joint((x + shift) % length) * 0.16
    light = 1 + shade + grain - np.minimum(joint, 0.16)
    hue = 1 + warm[..., None] * np.array([1.0, 0.0, -1.0])
    coloured: Float[np.ndarray, "s s 3"] = light[..., None] * hue
    return coloured


def _tile(rng: np.random.Generator) -> Image:
    """Square tiles of 25 cm in two shades, with grout lines."""
    count = 8
    side = PIXELS // count
    y, x = np.mgrid[0:PIXELS, 0:PIXELS]
    shade = rng.uniform(-0.02, 0.02, (count, count))[y // side, x // side]
    chequer = 0.07 * ((y // side + x // side) % 2)
    grout = np.maximum(_joint(y % side), _joint(x % side))
    surface = 1 - chequer + shade + 0.010 * _noise(rng, 12.0, 12.0)
    light: Image = surface * (1 - 0.14 * grout)
    return light


def _carpet(rng: np.random.Generator) -> Image:
    """Short pile: two scales of unevenness."""
    return 1 + 0.022 * _noise(rng, 16.0, 16.0) + 0.035 * _noise(rng, 0.8, 0.8)


def _joint(place: np.ndarray) -> Float[np.ndarray, "..."]:
    """A dark line two pixels wide at the start of a board, softened at its far edge."""
    return np.where(place == 0, 1.0, np.where(place == 1, 0.55, 0.0))


def _noise(rng: np.random.Generator, x_scale: float, y_scale: float) -> Image:
    """Periodic Gaussian noise, unit variance, smooth over that many pixels along each axis."""
    frequency = np.fft.fftfreq(PIXELS)
    damping = np.exp(-2 * (np.pi * frequency * x_scale) ** 2)[None, :]
    damping = damping * np.exp(-2 * (np.pi * frequency * y_scale) ** 2)[:, None]
    spectrum = np.fft.fft2(rng.standard_normal((PIXELS, PIXELS))) * damping
    smooth = np.fft.ifft2(spectrum).real
    scaled: Image = (smooth - smooth.mean()) / smooth.std()
    return scaled


def _coloured(light: Float[np.ndarray, "s s ..."], colour: Colour) -> UInt8[np.ndarray, "s s 3"]:
    """Lightness factors times an sRGB colour, kept below what the light would clip."""
    factor = light if light.ndim == 3 else light[..., None]
    shown = np.clip(factor * np.array(colour), 0, BRIGHTEST)
    pixels: UInt8[np.ndarray, "s s 3"] = np.round(255 * shown).astype(np.uint8)
    return pixels

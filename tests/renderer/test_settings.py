"""Render settings: presets, clip sizes, refused values."""

from __future__ import annotations

import pytest

from renderer.files import InputError
from renderer.settings import PRESETS, RenderSettings, preset


@pytest.mark.parametrize(
    ("tiling", "size"), [("grid", (960, 540)), ("strip", (1920, 270)), ("single", (480, 270))]
)
def test_the_clip_is_as_large_as_its_tiles(tiling, size):
    assert preset("demo", tiling=tiling).clip_size == size


def test_presets_have_even_sizes_of_about_sixteen_to_nine():
    for chosen in PRESETS.values():
        assert chosen.width % 2 == chosen.height % 2 == 0
        assert abs(chosen.width / chosen.height - 16 / 9) < 0.005


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("width", 481), ("height", 0), ("tiling", "pile"), ("platform", "glx"), ("fps", 0.0),
        ("fps", float("nan")), ("msaa", 3), ("crf", 52), ("shadow_size", 1000),
    ],
)  # fmt: skip
def test_a_setting_out_of_range_is_named(field, value):
    with pytest.raises(InputError, match=f"render settings: {field}: got"):
        RenderSettings(**{field: value})


def test_an_unknown_preset_or_setting_is_refused():
    with pytest.raises(InputError, match=r"preset: got '4k', wanted one of demo"):
        preset("4k")
    with pytest.raises(InputError, match="colour"):
        preset("demo", colour="red")

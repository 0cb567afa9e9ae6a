"""Pictures of rooms through the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from experiments.scene.cli import scene
from renderer import offscreen
from renderer.files import InputError


@pytest.fixture(scope="module", autouse=True)
def free_the_context():
    """Leave no context behind for the tests of other packages."""
    yield
    offscreen.release()


def draw(out: Path, *options: str) -> dict[str, object]:
    arguments = ["picture", "booth", "--out", str(out), "--preset", "demo", "--json", *options]
    result = CliRunner().invoke(scene, arguments, catch_exceptions=False)
    record: dict[str, object] = json.loads(result.stdout)
    return record


def test_a_picture_has_the_size_of_its_preset_and_shows_the_side_asked_for(tmp_path: Path) -> None:
    first, second = tmp_path / "a.png", tmp_path / "b.png"
    record = draw(first)
    draw(second, "--azimuth", "135")
    assert (record["scene"], record["width"], record["height"]) == ("booth", 480, 270)
    ours, theirs = (np.asarray(Image.open(path)) for path in (first, second))
    assert ours.shape == (270, 480, 3) and (ours != theirs).any(axis=-1).mean() > 0.2


def test_a_picture_of_another_kind_is_refused_and_not_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.png or \.jpg"):
        draw(tmp_path / "a.gif")
    assert list(tmp_path.iterdir()) == []

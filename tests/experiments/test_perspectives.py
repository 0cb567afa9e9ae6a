"""One placement drawn from any perspective, through the command line."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from experiments.cli import render
from experiments.motion.motion import Motion
from experiments.placement.placement import Placement, write_placement
from renderer.files import InputError
from renderer.video import probe

ROOM = "booth"


@pytest.fixture(scope="module")
def placement(slim, tmp_path_factory) -> Path:
    """A body that stands for a second in the middle of a furnished room, sampled at 60 fps."""
    pose, transl = np.zeros((61, 22, 3)), np.zeros((61, 3))
    pose[:, 0, 0] = np.pi / 2
    transl[:] = [1.6, 1.6, 0.95 + 0.2]
    motion = Motion(pose, transl, np.arange(61) / 60, 60.0, "stands", "stand", "test", slim.name)
    placed = Placement(
        ROOM, "stands", "posa_t", np.zeros(3), 0.0, motion, False, np.ones(61), {}, 1, "none"
    )
    return write_placement(placed, tmp_path_factory.mktemp("placements") / "p")[1]


def run(placement: Path, out: Path, *options: str) -> dict:
    arguments = [str(placement), "--out", str(out), "--preset", "demo", "--json", *options]
    result = CliRunner().invoke(render, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    return json.loads(result.stdout)


def test_a_still_is_a_picture_and_perspectives_differ(placement, tmp_path):
    pictures = []
    for camera in ("fixed", "orbit", "follow"):
        out = tmp_path / f"{camera}.png"
        record = run(placement, out, "--camera", camera, "--still", "0.5")
        assert (record["width"], record["height"], record["frame"]) == (480, 270, 30)
        pictures.append(np.asarray(Image.open(out)))
    assert all((a != b).any() for a, b in itertools.pairwise(pictures))


def test_a_turntable_has_the_length_asked_for(placement, tmp_path):
    out = tmp_path / "turn.mp4"
    record = run(placement, out, "--camera", "orbit", "--freeze", "0.5", "--seconds", "0.2")
    assert record["n_frames"] == probe(out).n_frames == 6
    assert (record["width"], record["height"]) == (480, 270)


def test_a_clip_lasts_as_long_as_its_motion_whatever_the_rates(placement, tmp_path):
    key = {"position": [1.6, -3.0, 1.5], "target": [1.6, 1.6, 1.0]}
    path = tmp_path / "pose.json"
    path.write_text(json.dumps({"schema_version": 1, "keys": [key]}))
    record = run(placement, tmp_path / "own.mp4", "--camera", str(path))
    assert record["n_frames"] == 31 and record["fps"] == 30.0


@pytest.mark.parametrize(
    ("options", "field"),
    [
        (["--camera", "helicopter"], "camera"),
        (["--still", "0.5"], "out"),
        (["--seconds", "3"], "seconds"),
        (["--freeze", "7"], "freeze"),
        (["--freeze", "0", "--seconds", "0"], "seconds"),
        (["--preset", "huge"], "preset"),
    ],
)
def test_a_perspective_without_sense_is_refused_and_nothing_is_written(
    placement, tmp_path, options, field
):
    out = tmp_path / "x.mp4"
    with pytest.raises(InputError) as refusal:
        CliRunner().invoke(
            render, [str(placement), "--out", str(out), *options], catch_exceptions=False
        )
    assert refusal.value.field == field and list(tmp_path.iterdir()) == []

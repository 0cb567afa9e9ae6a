import json

import pytest
from click.testing import CliRunner

from experiments.scene.cli import scene
from experiments.scene.layout import LAYOUTS
from renderer.files import InputError


def run(*arguments):
    return CliRunner().invoke(scene, arguments)


def test_inspect_answers_with_one_json_object():
    result = run("inspect", "bedroom", "--json")
    record = json.loads(result.stdout)
    wanted = {
        "triangles",
        "objects",
        "floor_standing",
        "free_floor",
        "walkable",
        "largest_component",
    }
    assert result.exit_code == 0 and wanted | {"overlaps", "faults"} <= set(record)
    assert record["faults"] == [] and record["objects"] >= 25


def test_inspect_says_in_words_what_is_wrong_and_fails(tmp_path):
    text = (LAYOUTS / "bedroom.toml").read_text(encoding="utf-8")
    moved = tmp_path / "moved.toml"
    moved.write_text(text.replace("x = 3.57, y = 2.15", "x = 3.57, y = 1.2"), encoding="utf-8")
    result = run("inspect", str(moved))
    assert result.exit_code == 1
    assert "FAULT: wardrobe reaches" in result.stdout and "into armchair" in result.stdout


def test_an_unknown_room_is_one_line():
    result = run("inspect", "attic")
    assert isinstance(result.exception, InputError) and "got 'attic'" in str(result.exception)


@pytest.mark.parametrize("command", ["inspect", "bake"])
def test_a_missing_room_is_bad_use(command):
    assert run(command).exit_code == 2
    assert "NAME|DIR" in run(command, "--help").stdout

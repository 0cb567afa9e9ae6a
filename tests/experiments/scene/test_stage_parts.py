from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.scene.assembly import assemble
from experiments.scene.layout import Layout
from experiments.scene.refine import refine
from experiments.scene.scene import MPCAT40
from experiments.scene.stage_parts import (
    BRIGHTEST,
    displayed_colour,
    displayed_texture,
    object_groups,
    room_parts,
)
from experiments.scene.synthetic import box_object, synthetic_room

ROOM = Layout("test", (3.0, 2.5, 2.4), "tile", (0.6, 0.6, 0.6), (0.8, 0.8, 0.75), (), ())


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PACE_CACHE", str(tmp_path))


def test_groups_follow_height_support_and_wall() -> None:
    objects = [
        box_object("wardrobe", (0.2, 0.2, 0.0), (0.8, 0.8, 2.0), "cabinet"),
        box_object("hatbox", (0.3, 0.3, 2.0), (0.5, 0.5, 2.2), "objects", on="wardrobe"),
        box_object("desk", (1.2, 0.2, 0.0), (2.0, 0.8, 0.74), "table"),
        box_object("lamp", (1.3, 0.3, 0.74), (1.4, 0.4, 1.3), "lighting", on="desk"),
        box_object("cup", (1.6, 0.3, 0.74), (1.7, 0.4, 0.84), "objects", on="desk"),
        box_object("picture", (1.0, 2.48, 1.2), (1.6, 2.5, 1.7), "picture", wall="n"),
    ]
    assert object_groups(objects) == {
        "wardrobe": "object:wardrobe",
        "hatbox": "object:wardrobe",
        "desk": "room",
        "lamp": "object:lamp",
        "cup": "room",
        "picture": "wall:n",
    }


def test_a_hidden_wardrobe_leaves_no_shadow_on_wall_and_floor() -> None:
    wardrobe = box_object("wardrobe", (0.02, 0.4, 0.0), (0.6, 1.6, 2.0), "cabinet")
    parts = room_parts(ROOM, [wardrobe])
    bare = {part.instance: part for part in room_parts(ROOM, []) if part.uv is not None}
    for name in ("floor", "wall_w"):
        (with_it,) = (p for p in parts if p.instance == name and p.uv is not None)
        behind = np.abs(with_it.occlusion - bare[name].occlusion).max()
        left = np.abs(with_it.occlusion_without({"object:wardrobe"}) - bare[name].occlusion)
        assert behind > 0.3
        # Two bakes differ by the noise of their rays.
        assert np.quantile(left, 0.99) < 0.06


def test_every_part_is_ready_to_draw() -> None:
    shelf = box_object("shelf", (0.1, 0.1, 0.0), (0.9, 0.4, 1.2), "shelving")
    parts = room_parts(ROOM, [shelf])
    assert {part.group for part in parts} >= {"floor", "wall:n", "wall:s", "object:shelf"}
    for part in parts:
        assert np.isfinite(part.corners).all() and part.occlusion.shape == part.corners.shape[:2]
        np.testing.assert_allclose(np.linalg.norm(part.normals, axis=2), 1, atol=1e-4)
        assert (part.uv is None) == (part.texture is None)
        assert part.colours.min() >= 0 and part.colours.max() <= 1


@given(st.tuples(*[st.floats(0.0, 1.0)] * 3))
def test_drawn_colours_never_clip_and_are_less_saturated(
    colour: tuple[float, float, float],
) -> None:
    drawn = displayed_colour(np.float32([colour]), lifted=True)[0]
    assert (drawn >= -1e-6).all() and (drawn <= BRIGHTEST + 1e-6).all()
    assert np.ptp(drawn) <= np.ptp(np.float32(colour) ** 0.8) + 1e-6


def test_a_grey_texture_is_only_limited() -> None:
    grey = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    np.testing.assert_array_equal(displayed_texture(grey)[0, :, 0], np.minimum(np.arange(256), 219))


def test_refinement_keeps_area_and_fits_at_shared_edges() -> None:
    ring = np.float32([[0, 0, 0], [1.7, 0, 0], [1.7, 0.9, 0], [0, 0.9, 0]])
    corners = np.stack([ring[[0, 1, 2]], ring[[0, 2, 3]]])
    fine = refine(np.concatenate([corners, 2 * corners], axis=2), 0.3)
    edges = np.linalg.norm(fine[..., :3] - np.roll(fine[..., :3], 1, axis=1), axis=2)
    assert edges.max() <= 0.3
    normal = np.cross(fine[:, 1, :3] - fine[:, 0, :3], fine[:, 2, :3] - fine[:, 0, :3])
    assert (normal[:, 2] > 0).all() and normal[:, 2].sum() / 2 == pytest.approx(1.7 * 0.9, rel=1e-5)
    np.testing.assert_allclose(fine[..., 3:], 2 * fine[..., :3], atol=1e-6)
    ends = np.round(np.stack([fine[..., :3], np.roll(fine[..., :3], -1, axis=1)], axis=2), 5)
    both = np.sort(ends.reshape(-1, 2, 3).view([("", ends.dtype)] * 3)[..., 0], axis=1)
    _, count = np.unique(both, axis=0, return_counts=True)
    border = 2 * (1.7 + 0.9)
    single = np.flatnonzero(count == 1)
    assert count.max() == 2 and len(single) < border / 0.1


def test_a_scene_knows_its_classes_and_instances() -> None:
    scene = synthetic_room(cell=0.2)
    assert scene.class_names() == ("wall", "floor", "chair")
    seat = next(i for i, instance in enumerate(scene.instances) if instance.id == "seat")
    own = scene.vertex_instance == seat
    assert set(scene.vertex_label[own]) == {MPCAT40.index("chair")} and own.sum() == 8
    np.testing.assert_allclose(scene.vertices[own].min(axis=0), (1.2, 1.5, 0.0), atol=1e-6)


def test_a_rug_is_not_an_obstacle_and_content_decides_the_hash() -> None:
    rug = box_object("rug", (0.5, 0.5, 0.0), (1.5, 1.5, 0.012), "floor")
    with_rug = assemble("a", ROOM.size, [rug], cell=0.2)
    bare, again = (assemble(name, ROOM.size, [], cell=0.2) for name in ("a", "b"))
    np.testing.assert_array_equal(with_rug.volumes.sdf, bare.volumes.sdf)
    assert bare.content_hash == again.content_hash != with_rug.content_hash

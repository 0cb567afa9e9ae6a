import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.scene.parametric import SHAPES, make_shape
from experiments.scene.parametric_primitives import (
    box,
    cylinder,
    heightfield,
    pillow,
    superellipsoid,
    tube,
    turned,
)
from renderer.files import InputError

SOLIDS = {
    "box": (box((1.0, 2.0, 3.0)), 6.0),
    "cylinder": (cylinder(0.5, 2.0, segments=400), np.pi * 0.25 * 2.0),
    "cone": (cylinder(0.3, 1.0, segments=400, top_radius=0.0), np.pi * 0.09 / 3),
    "tube": (tube((0, 0, 0), (1, 2, 2), 0.1, 400), np.pi * 0.01 * 3.0),
    "ellipsoid": (superellipsoid((1, 2, 3), flat=1.0, square=1.0, n=160), 4 / 3 * np.pi * 0.75),
    "slab": (heightfield(np.full((4, 5), 0.2), (1.0, 2.0)), 0.4),
}


def volume(corners):
    """Signed volume by the divergence theorem: positive where all faces look outwards."""
    return float(np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_primitive_is_closed_faces_outwards_and_has_its_textbook_volume(name):
    corners, wanted = SOLIDS[name]
    assert volume(corners) == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize("name", [*SOLIDS, "block", "bevelled"])
def test_a_primitive_has_no_cracks(name):
    more = {
        "block": (superellipsoid((0.45, 0.54, 0.11), flat=0.18, square=0.18, n=16), 0),
        "bevelled": (box((0.4, 0.3, 0.2), bevel=0.02), 0),
    }
    corners, _ = (SOLIDS | more)[name]
    vertex = np.unique(np.round(corners.reshape(-1, 3), 9), axis=0, return_inverse=True)[1]
    faces = vertex.reshape(-1, 3)
    edges = {(int(f[k]), int(f[(k + 1) % 3])) for f in faces for k in range(3)}
    assert len(edges) == 3 * len(faces)
    assert {(b, a) for a, b in edges} == edges


@given(st.tuples(*[st.floats(0.05, 2.0)] * 3), st.floats(0.001, 0.1))
@settings(deadline=None, max_examples=40)
def test_a_bevel_keeps_the_size_of_a_box_and_takes_a_little_volume(size, bevel):
    corners = box(size, bevel=bevel)
    assert np.ptp(corners.reshape(-1, 3), axis=0) == pytest.approx(size)
    plain = size[0] * size[1] * size[2]
    assert 0.2 * plain < volume(corners) < plain


def test_turning_a_quarter_about_z_takes_x_to_y():
    point = np.array([[[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]])
    assert turned(point, "z", 90) == pytest.approx(np.array([[[0, 1, 0], [-1, 0, 0], [0, 0, 1]]]))


def test_a_pillow_encloses_volume_and_faces_outwards():
    assert 0.3 < volume(pillow((0.4, 0.5, 0.1))) / (0.4 * 0.5 * 0.1) < 0.9


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_stands_on_the_floor_in_its_middle_with_its_faces_outwards(name):
    corners = np.concatenate([part.corners for part in make_shape(name, {})])
    low, high = corners.min((0, 1)), corners.max((0, 1))
    hangs = name in ("picture", "clock")
    assert low[2] == pytest.approx(-high[2] if hangs else 0.0, abs=0.012)
    assert abs(low[0] + high[0]) < 0.15 * (high[0] - low[0]) + 0.02
    assert volume(corners) > 0


@pytest.mark.parametrize("name", ["bookcase", "bookstack", "papers", "picture", "blanket"])
def test_the_seed_alone_decides_a_random_shape(name):
    def flat(seed):
        parts = make_shape(name, {"seed": seed})
        arrays = [p.corners for p in parts] + [p.texture for p in parts if p.texture is not None]
        return np.concatenate([array.reshape(-1).astype(float) for array in arrays])

    assert np.array_equal(flat(3), flat(3))
    first, second = flat(3), flat(4)
    assert first.shape != second.shape or not np.array_equal(first, second)


@pytest.mark.parametrize(
    ("name", "params", "wanted"),
    [
        ("tabel", {}, "shape: got 'tabel', wanted one of armchair"),
        ("table", {"colur": (1, 1, 1)}, "table.colur: got (1, 1, 1), wanted one of size"),
        ("table", {"size": (1.0, 1.0)}, "table.size: got (1.0, 1.0), wanted a list of 3 numbers"),
        ("table", {"shelf": 1}, "table.shelf: got 1, wanted true or false"),
    ],
)
def test_unknown_shapes_and_parameters_are_named(name, params, wanted):
    with pytest.raises(InputError) as caught:
        make_shape(name, params)
    assert wanted in str(caught.value)

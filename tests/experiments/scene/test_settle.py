import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.scene.parametric_primitives import box
from experiments.scene.settle import settled_height, surface_heights


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
@settings(deadline=None, max_examples=50)
def test_a_slope_is_as_high_as_its_plane_says(x, y):
    slope = np.array([[[-1.0, -1, 0], [1, -1, 2], [1, 1, 3]], [[-1, -1, 0], [1, 1, 3], [-1, 1, 1]]])
    height = surface_heights(slope, np.array([[x, y]]))[0]
    assert height == pytest.approx((x + 1) + (y + 1) / 2)


def test_beside_a_support_there_is_no_height():
    assert np.isnan(surface_heights(box((1, 1, 1)), np.array([[0.6, 0.0]]))).all()


def test_a_thing_settles_on_the_top_of_a_table():
    assert settled_height(box((1, 1, 0.74)), 0.2, 0.1, (0.2, 0.3)) == 0.74


def test_a_thing_beyond_the_edge_does_not_settle():
    assert np.isnan(settled_height(box((1, 1, 0.74)), 0.55, 0.0, (0.2, 0.2)))

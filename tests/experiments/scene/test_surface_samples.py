import numpy as np
import pytest

from experiments.scene.parametric_primitives import box
from experiments.scene.surface import surface_samples


def test_samples_lie_on_the_surface_and_are_spread_by_area():
    corners = box((2.0, 1.0, 0.5))
    points, face = surface_samples(corners, 0.02)
    assert len(points) == pytest.approx(len(corners) + 7.0 / 0.02**2, rel=0.01)
    distance = np.abs(points - [0, 0, 0.25]) / [1.0, 0.5, 0.25]
    assert distance.max(1) == pytest.approx(np.ones(len(points)))
    top = corners[face][:, :, 2].min(1) == 0.5
    assert top.mean() == pytest.approx(2.0 / 7.0, abs=0.01)
    assert np.histogram(points[top, 0], bins=10, range=(-1, 1))[0].std() / top.sum() < 0.003


def test_the_number_of_samples_is_bounded():
    assert len(surface_samples(box((5, 5, 5)), 0.001, at_most=5000)[0]) < 5100

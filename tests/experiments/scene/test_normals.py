import numpy as np
import pytest

from experiments.scene.normals import creased_normals
from experiments.scene.parametric_primitives import box, superellipsoid


def test_a_box_keeps_hard_edges():
    corners = box((1.0, 2.0, 0.5))
    normals = creased_normals(corners)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert normals == pytest.approx(np.repeat(flat[:, None], 3, axis=1))


def test_a_sphere_is_smooth_and_its_normals_point_from_the_centre():
    corners = superellipsoid((2, 2, 2), flat=1.0, square=1.0, n=48)
    radial = corners - [0, 0, 1]
    radial /= np.linalg.norm(radial, axis=2, keepdims=True)
    assert (creased_normals(corners) * radial).sum(-1).min() > 0.995


def test_the_crease_angle_divides_soft_from_sharp():
    slope = np.tan(np.radians(30))
    ridge = ([0, 0, slope], [1, 0, slope])
    roof = np.array([[[0, -1, 0], ridge[1], ridge[0]], [[0, 1, 0], ridge[0], ridge[1]]], float)
    up = [0.0, 0.0, 1.0]
    assert creased_normals(roof, 70.0)[0, 2] == pytest.approx(up, abs=1e-9)
    assert creased_normals(roof, 50.0)[0, 2, 2] == pytest.approx(np.cos(np.radians(30)))

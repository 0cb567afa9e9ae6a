"""Decimation of furniture meshes to a triangle budget, with the guards that keep shapes honest.

Uses pymeshlab's quadric edge collapse (Garland and Heckbert 1997), offline only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymeshlab
import trimesh
from jaxtyping import Float, Integer
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from experiments.assets.furniture_repair import areas

_WELD = 1e-5
"""Metres below which two corners are the same vertex."""
_CRUMB = 0.012


@dataclass(frozen=True)
class Welded:
    """An indexed mesh."""

    vertices: Float[np.ndarray, "V 3"]
    faces: Integer[np.ndarray, "F 3"]

    def corners(self) -> Float[np.ndarray, "F 3 3"]:
        """The same mesh as a triangle soup."""
        return np.asarray(self.vertices[self.faces])


def weld(corners: Float[np.ndarray, "F 3 3"]) -> Welded:
    """Join corners at the same place; faces that collapse are dropped."""
    points = corners.reshape(-1, 3)
    _, first, index = np.unique(
        np.round(points / _WELD).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = index.reshape(-1, 3)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2])
    whole &= faces[:, 0] != faces[:, 2]
    return Welded(points[first], faces[whole])


def decimate(corners: Float[np.ndarray, "F 3 3"], target: int) -> Float[np.ndarray, "G 3 3"]:
    """Collapse edges until `target` faces are left; boundaries and normals are preserved."""
    mesh = weld(corners)
    if len(mesh.faces) <= max(target, 4):
        return mesh.corners()
    work = pymeshlab.MeshSet(verbose=False)
    work.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces.astype(np.int32)))
    work.meshing_decimation_quadric_edge_collapse(
        targetfacenum=int(target),
        qualitythr=0.3,
        preserveboundary=True,
        boundaryweight=1.0,
        preservenormal=True,
        planarquadric=True,
        optimalplacement=True,
    )
    result = work.current_mesh()
    return weld(result.vertex_matrix()[result.face_matrix()]).corners()


def thin_leaves(
    corners: Float[np.ndarray, "F 3 3"], target: int, rng: np.random.Generator
) -> Float[np.ndarray, "G 3 3"]:
    """Keep a random share of the loose leaves, enlarged about their centres to keep the foliage full.

    No collapse helps thousands of separate leaves, so whole connected components are dropped.
    """
    mesh = weld(corners)
    leaf = _components(mesh)
    n_leaves = int(leaf.max()) + 1
    size = np.bincount(leaf)
    order = rng.permutation(n_leaves)
    kept = order[: max(1, int(np.searchsorted(np.cumsum(size[order]), target)))]
    growth = min(1.7, float(np.sqrt(len(mesh.faces) / max(size[kept].sum(), 1))))
    faces = np.isin(leaf, kept)
    soup, owner = mesh.corners()[faces], leaf[faces]
    centres = np.zeros((n_leaves, 3))
    np.add.at(centres, owner, soup.mean(1))
    centres /= np.maximum(np.bincount(owner, minlength=n_leaves), 1)[:, None]
    grown = centres[owner][:, None] + growth * (soup - centres[owner][:, None])
    grown[..., 2] = np.maximum(grown[..., 2], 0.0)
    return np.asarray(grown)


def without_crumbs(corners: Float[np.ndarray, "F 3 3"]) -> Float[np.ndarray, "G 3 3"]:
    """Drop loose components smaller than a centimetre (screws, stitches): no view shows them."""
    mesh = weld(corners)
    part = _components(mesh)
    low, high = np.full((2, int(part.max()) + 1, 3), np.inf)
    soup = mesh.corners()
    np.minimum.at(low, part, soup.min(1))
    np.minimum.at(high, part, -soup.max(1))
    extent = np.linalg.norm(-high - low, axis=1)
    return soup[extent[part] >= _CRUMB] if (extent >= _CRUMB).any() else soup


def distance_quantile(
    points: Float[np.ndarray, "N 3"], corners: Float[np.ndarray, "F 3 3"], q: float = 0.999
) -> float:
    """Quantile of the distances from points to a surface, metres."""
    return float(np.quantile(closest(points, corners)[1], q))


def closest(
    points: Float[np.ndarray, "N 3"], corners: Float[np.ndarray, "F 3 3"], near: int = 12
) -> tuple[Integer[np.ndarray, " N"], Float[np.ndarray, " N"], Float[np.ndarray, "N 3"]]:
    """Closest face, distance and foot point, exact over the faces of the nearest surface samples."""
    samples, owner = surface_samples(corners, 0.004)
    _, index = cKDTree(samples).query(points, k=min(near, len(samples)))
    best_face = np.zeros(len(points), int)
    best = np.full(len(points), np.inf)
    best_foot = np.zeros_like(points)
    for face in owner[index.reshape(len(points), -1)].T:
        foot = np.asarray(trimesh.triangles.closest_point(corners[face], points))  # type: ignore[no-untyped-call]
        distance = np.linalg.norm(foot - points, axis=1)
        nearer = distance < best
        best_face[nearer], best[nearer] = face[nearer], distance[nearer]
        best_foot[nearer] = foot[nearer]
    return best_face, best, best_foot


def surface_samples(
    corners: Float[np.ndarray, "F 3 3"], spacing: float
) -> tuple[Float[np.ndarray, "S 3"], Integer[np.ndarray, " S"]]:
    """Points spread over a surface, at least the centroid of every face, with their faces."""
    rng = np.random.default_rng(0)
    count = 1 + (areas(corners) / spacing**2).astype(int)
    count = np.minimum(count, 4000)
    owner = np.repeat(np.arange(len(corners)), count)
    u, v = rng.random(len(owner)), rng.random(len(owner))
    over = u + v > 1
    u[over], v[over] = 1 - u[over], 1 - v[over]
    a, b, c = corners[owner, 0], corners[owner, 1], corners[owner, 2]
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    return np.concatenate([corners.mean(1), points]), np.concatenate(
        [np.arange(len(corners)), owner]
    )


def _components(mesh: Welded) -> Integer[np.ndarray, " F"]:
    """Connected component of every face (faces that share a vertex)."""
    a, b = mesh.faces[:, [0, 1, 2]].ravel(), mesh.faces[:, [1, 2, 0]].ravel()
    n = len(mesh.vertices)
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
    labels = np.asarray(connected_components(graph, directed=False)[1])
    return np.asarray(labels[mesh.faces[:, 0]])

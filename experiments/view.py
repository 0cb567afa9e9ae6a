"""Placements as a page to look at in three dimensions: rigs, measured skin error, contact and penetration."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int16

from experiments.body.embedded import load_body
from experiments.body.rig import Rig, helper_rig
from experiments.body.skinned_body import SkinnedBody
from experiments.body.surface import vertex_normals
from experiments.clips import skinned
from experiments.methods import METHODS
from experiments.motion.motion import Motion
from experiments.motion.rotations import to_quaternion
from experiments.placement.placement import Placement, read_placement
from experiments.scene.baking import load_room
from experiments.scene.lookup import SceneLookup
from experiments.scene.scene import Scene
from experiments.scene.stage_parts import stage_parts
from renderer.cameras import choose_cameras
from renderer.files import InputError
from renderer.gltf import UNMARKED, SkinnedMesh, skinned_glb
from renderer.gltf_room import room_glb
from renderer.settings import RenderSettings
from renderer.stage import StagePart
from renderer.viewer.page import ViewerBody, ViewerCamera, ViewerPage, write_page

TOLERANCE_MM = 10.0
"""Within this distance of a surface a vertex touches; deeper inside it penetrates."""
ERROR_P99_MM, ERROR_MAX_MM = 1.0, 10.0
"""How far the skinned glTF body may lie from the body model: 99 % and all of the vertices."""
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class SkinError:
    """Distance between the skinned glTF body and the body model, millimetres, over all frames."""

    p99_mm: float
    max_mm: float


def view_placements(
    sources: Sequence[Path],
    out: Path,
    tolerance_mm: float = TOLERANCE_MM,
    progress: Progress = lambda *_: None,
) -> dict[str, Any]:
    """Write the page for placements of one room and one length; returns what was written, as JSON.

    Contact and penetration are read from the scene's unthickened signed distance at the vertices of
    the outer skin, `tolerance_mm` on both sides of the surface counting as touch. Raises
    InputError: a placement missing or damaged, another room, length or frame rate.
    """
    placements = [read_placement(source) for source in sources]
    _refuse_mixture(sources, placements)
    names = _labels(sources, placements)
    first = placements[0]
    scene, parts = load_room(first.scene), stage_parts(first.scene)
    bodies = []
    for index, (placement, (key, label)) in enumerate(zip(placements, names, strict=True)):
        progress("bodies", index, len(placements))
        bodies.append(_viewer_body(key, label, placement, scene, tolerance_mm))
    progress("bodies", len(placements), len(placements))
    page = ViewerPage(
        scene=first.scene,
        scene_label=first.scene.replace("_", " ").capitalize(),
        motion_label=" / ".join(dict.fromkeys(p.motion.label for p in placements)),
        fps=first.motion.fps,
        n_frames=first.motion.n_frames,
        room_size=scene.room_size,
        floor_z=scene.floor_z,
        tolerance_mm=tolerance_mm,
        room=room_glb(parts),
        bodies=tuple(bodies),
        views=_views(placements, scene, parts),
    )
    return write_page(page, out)


def body_mesh(
    motion: Motion, name: str, distances: Int16[np.ndarray, "T V"] | None = None
) -> tuple[SkinnedMesh, SkinError]:
    """A motion as arrays for glTF, and how far its skin is from the body model.

    Raises InputError if the error is above 1 mm for 99 % or 10 mm for any of the vertices.
    """
    body = load_body(motion.body)
    if not isinstance(body, SkinnedBody):
        raise InputError(motion.motion_id, "body", motion.body, "a body of rest points")
    rig = helper_rig(body.points, body.rest_joints)
    error = skin_error(body, rig, motion)
    if error.p99_mm > ERROR_P99_MM or error.max_mm > ERROR_MAX_MM:
        found = f"{error.p99_mm:.2f} mm (99 %), {error.max_mm:.2f} mm (all)"
        wanted = f"a rig within {ERROR_P99_MM:g} mm and {ERROR_MAX_MM:g} mm of the body model"
        raise InputError(motion.motion_id, "skin error", found, wanted)
    return _mesh_of(motion, name, body, rig, distances), error


def skin_error(body: SkinnedBody, rig: Rig, motion: Motion) -> SkinError:
    """Distance of the rig's vertices from the body model's, over all frames and vertices."""
    gaps = []
    for start in range(0, motion.n_frames, 32):
        pose = torch.as_tensor(motion.pose[start : start + 32])
        transl = torch.as_tensor(motion.transl[start : start + 32])
        rotations, positions = body.joint_transforms(pose, transl)
        exact = body.posed(pose, transl).vertices.numpy()
        gap = rig.posed(rotations.numpy(), positions.numpy()) - exact
        gaps.append(np.linalg.norm(gap, axis=2).astype(np.float32))
    all_gaps = 1000 * np.concatenate(gaps)
    return SkinError(float(np.percentile(all_gaps, 99)), float(all_gaps.max()))


def skin_marks(motion: Motion, scene: Scene, tolerance_mm: float) -> Int16[np.ndarray, "T V"]:
    """Signed distance in tenths of a millimetre for vertices that touch or penetrate, else UNMARKED.

    Unthickened distance, outer skin; eyes and teeth are never marked.
    """
    body, lookup = load_body(motion.body), SceneLookup(scene, thickened=False)
    skin = body.body_component
    marks = np.full((motion.n_frames, body.n_vertices), UNMARKED, np.int16)
    with torch.no_grad():
        for start in range(0, motion.n_frames, 32):
            pose = torch.as_tensor(motion.pose[start : start + 32], dtype=torch.float32)
            transl = torch.as_tensor(motion.transl[start : start + 32], dtype=torch.float32)
            points = body.posed(pose, transl, skin).vertices
            tenths = np.round(1e4 * lookup.distance(points).double().numpy())
            near = tenths <= 10 * tolerance_mm
            clipped = np.where(near, tenths.clip(-32000, 32000), UNMARKED)
            marks[start : start + 32, skin] = clipped.astype(np.int16)
    return marks


def _viewer_body(
    key: str, label: str, placement: Placement, scene: Scene, tolerance_mm: float
) -> ViewerBody:
    marks = skin_marks(placement.motion, scene, tolerance_mm)
    mesh, error = body_mesh(placement.motion, key, marks)
    return ViewerBody(key, label, skinned_glb(mesh), error.p99_mm, error.max_mm)


def _views(
    placements: Sequence[Placement], scene: Scene, parts: Sequence[StagePart]
) -> tuple[ViewerCamera, ...]:
    """The four cameras that a clip of these placements would have, the best seen first."""
    body = load_body(placements[0].motion.body)
    bodies = [skinned(load_body(p.motion.body), p.motion) for p in placements]
    rig = choose_cameras(
        parts, scene.room_size, scene.floor_z, bodies, body.regions, body.faces, RenderSettings()
    )
    swept = np.concatenate([vertices.reshape(-1, 3) for vertices in bodies])
    centre = 0.5 * (swept.min(0) + swept.max(0)).astype(np.float64)
    views = sorted(rig.views, key=lambda view: view != rig.best())
    return tuple(_camera(view.matrix, view.azimuth_deg, centre) for view in views)


def _camera(
    pose: Float[np.ndarray, "4 4"], azimuth_deg: float, centre: Float[np.ndarray, "3"]
) -> ViewerCamera:
    eye, forward = pose[:3, 3], -pose[:3, 2]
    target = eye + forward * float((centre - eye) @ forward)
    compass = ("E", "NE", "N", "NW", "W", "SW", "S", "SE")[round(azimuth_deg / 45) % 8]
    return ViewerCamera(compass, tuple(eye.tolist()), tuple(target.tolist()))


def _mesh_of(
    motion: Motion,
    name: str,
    body: SkinnedBody,
    rig: Rig,
    distances: Int16[np.ndarray, "T V"] | None,
) -> SkinnedMesh:
    return SkinnedMesh(
        name=name,
        vertices=rig.rest_vertices,
        normals=vertex_normals(rig.rest_vertices, body.faces),
        faces=body.faces,
        joint_names=rig.names,
        parents=rig.parents,
        offsets=rig.offsets,
        binds=rig.binds,
        joints=rig.joints,
        weights=rig.weights,
        rotations=to_quaternion(motion.pose),
        root_positions=motion.transl + body.rest_joints[0],
        times=motion.times - motion.times[0],
        distances=distances,
    )


def _refuse_mixture(sources: Sequence[Path], placements: Sequence[Placement]) -> None:
    first = placements[0]
    for source, placement in zip(sources[1:], placements[1:], strict=True):
        for field, found, wanted in (
            ("scene", placement.scene, first.scene),
            ("frames", placement.motion.n_frames, first.motion.n_frames),
            ("fps", placement.motion.fps, first.motion.fps),
        ):
            if found != wanted:
                raise InputError(source, field, found, f"{wanted} as in {sources[0]}")


def _labels(sources: Sequence[Path], placements: Sequence[Placement]) -> list[tuple[str, str]]:
    """A key for files and a label for people; methods that occur twice are numbered."""
    counts, seen = Counter(p.method for p in placements), Counter[str]()
    found = []
    for placement in placements:
        name = placement.method
        label = METHODS[name].display_name if name in METHODS else name
        seen[name] += 1
        if counts[name] > 1:
            name, label = f"{name}_{seen[name]}", f"{label} {seen[name]}"
        found.append((name, label))
    return found

"""The drawn room: shell and furniture with colours, textures and occlusion, ready for the renderer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from experiments.scene.furnish import furnish
from experiments.scene.layout import Layout, read_layout
from experiments.scene.objects import MaterialPart, PlacedObject
from experiments.scene.occlusion import Occlusion, Surface, bake_occlusion
from experiments.scene.progress import progress_bar
from experiments.scene.refine import refine
from experiments.scene.scene_folder import is_scene_folder, read_parts
from experiments.scene.shell import shell_parts
from renderer.stage import StagePart

HIDEABLE = 0.85
"""Objects whose top is above this (metres) may be hidden in a view, and form groups."""
LONGEST_EDGE = 0.3
"""Furniture triangles are cut to edges of at most this, metres, before occlusion is baked."""
SATURATION = 0.72
LIFT = 0.8
"""Exponent on catalogue colours, which are too dark for the light they will stand in."""
BRIGHTEST, BRIGHTEST_TEXTURE = 0.82, 0.86


def stage_parts(name_or_dir: str | Path) -> tuple[StagePart, ...]:
    """The drawn parts of a room of the project, a layout file (.toml) or a scene folder.

    Occlusion is baked the first time, a few seconds, and kept. Raises InputError.
    """
    if is_scene_folder(name_or_dir):
        return read_parts(Path(name_or_dir))
    layout = read_layout(name_or_dir)
    with progress_bar(f"Lighting {layout.name}") as on_step:
        return room_parts(layout, furnish(layout), on_step)


def room_parts(
    layout: Layout,
    objects: Sequence[PlacedObject],
    on_step: Callable[[float], None] = lambda share: None,
) -> tuple[StagePart, ...]:
    """Stage parts of a furnished room: shell first, then the objects in their order.

    Groups: `floor`; `wall:n` and so on for a wall with all that belongs to it; `object:<id>` for an
    object that may hide the body, with everything that stands on it; `room` for the rest.
    """
    drafts = [*_shell_drafts(layout), *_object_drafts(objects)]
    removable = sorted({d.group for d in drafts if d.group.startswith("object:")})
    surfaces = [Surface(d.corners, d.normals, d.group) for d in drafts]
    baked = bake_occlusion(surfaces, removable, on_step=on_step)
    return tuple(_finished(draft, light) for draft, light in zip(drafts, baked, strict=True))


@dataclass(frozen=True)
class _Draft:
    """A stage part before its occlusion is known."""

    corners: Float[np.ndarray, "F 3 3"]
    normals: Float[np.ndarray, "F 3 3"]
    colours: Float[np.ndarray, "F 3 3"]
    uv: Float[np.ndarray, "F 3 2"] | None
    texture: UInt8[np.ndarray, "h w 3"] | None
    instance: str
    group: str
    wall: str | None
    occlusion: float | None = None


def _finished(draft: _Draft, light: Occlusion) -> StagePart:
    constant = draft.occlusion
    factor = light.factor if constant is None else np.full_like(light.factor, constant)
    return StagePart(
        corners=draft.corners,
        normals=draft.normals,
        colours=draft.colours,
        occlusion=factor,
        instance=draft.instance,
        group=draft.group,
        uv=draft.uv,
        texture=draft.texture,
        wall=draft.wall,
        released=light.released if constant is None else {},
    )


def _shell_drafts(layout: Layout) -> list[_Draft]:
    drafts = []
    for part in shell_parts(layout):
        material = part.material
        group = "floor" if part.wall is None else f"wall:{part.wall}"
        colours = np.broadcast_to(np.array(material.colour, np.float32), material.corners.shape)
        drafts.append(
            _Draft(
                corners=material.corners,
                normals=material.normals,
                colours=np.ascontiguousarray(colours),
                uv=material.uv,
                texture=material.texture,
                instance=part.instance,
                group=group,
                wall=part.wall,
                occlusion=part.occlusion,
            )
        )
    return drafts


def _object_drafts(objects: Sequence[PlacedObject]) -> list[_Draft]:
    groups = object_groups(objects)
    drafts = []
    for placed in objects:
        lifted = placed.asset.startswith("pack:")
        for material in placed.parts:
            corners, normals, colours, uv = _refined(material, lifted)
            texture = None if material.texture is None else displayed_texture(material.texture)
            place = (placed.id, groups[placed.id], placed.wall)
            drafts.append(_Draft(corners, normals, colours, uv, texture, *place))
    return drafts


def object_groups(objects: Sequence[PlacedObject]) -> dict[str, str]:
    """The group of each object, by id. What stands on something follows its support."""
    groups: dict[str, str] = {}
    for placed in objects:
        below = groups.get(placed.on or "", "room")
        top = float(placed.triangles()[..., 2].max())
        if below != "room":
            groups[placed.id] = below
        elif placed.wall is not None:
            groups[placed.id] = f"wall:{placed.wall}"
        else:
            groups[placed.id] = f"object:{placed.id}" if top > HIDEABLE else "room"
    return groups


def _refined(
    material: MaterialPart, lifted: bool
) -> tuple[
    Float[np.ndarray, "F 3 3"],
    Float[np.ndarray, "F 3 3"],
    Float[np.ndarray, "F 3 3"],
    Float[np.ndarray, "F 3 2"] | None,
]:
    """Corners, normals, colours and texture coordinates, cut to small triangles."""
    colours = material.vertex_colours
    if colours is None:
        colours = np.broadcast_to(np.array(material.colour, np.float32), material.corners.shape)
    if material.texture is None:
        colours = displayed_colour(colours, lifted)
    channels = [material.corners, material.normals, colours]
    channels += [] if material.uv is None else [material.uv]
    fine = refine(np.concatenate(channels, axis=2).astype(np.float32), LONGEST_EDGE)
    uv = None if material.uv is None else fine[..., 9:11]
    return fine[..., :3], _unit(fine[..., 3:6], fine[..., :3]), fine[..., 6:9], uv


def _unit(
    normals: Float[np.ndarray, "F 3 3"], corners: Float[np.ndarray, "F 3 3"]
) -> Float[np.ndarray, "F 3 3"]:
    """Normals of length one; that of the triangle where a mesh has none."""
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = np.where(np.linalg.norm(flat, axis=1, keepdims=True) > 1e-12, flat, [0.0, 0.0, 1.0])
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    chosen = np.where(length > 0.1, normals, flat[:, None])
    unit = chosen / np.linalg.norm(chosen, axis=2, keepdims=True)
    return np.asarray(unit, dtype=np.float32)


def displayed_colour(colour: Float[np.ndarray, "*n 3"], lifted: bool) -> Float[np.ndarray, "*n 3"]:
    """An authored sRGB colour as it is drawn: less saturated than the body, never clipping."""
    lighter = colour**LIFT if lifted else colour
    shown: Float[np.ndarray, "*n 3"] = np.minimum(_muted(lighter), BRIGHTEST).astype(np.float32)
    return shown


def displayed_texture(texture: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    """The same for a texture."""
    muted = np.clip(_muted(texture / 255.0), 0, BRIGHTEST_TEXTURE)
    pixels: UInt8[np.ndarray, "h w 3"] = np.round(255 * muted).astype(np.uint8)
    return pixels


def _muted(colour: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Towards the grey of the same luma (Rec. 709)."""
    grey = (colour @ np.array([0.2126, 0.7152, 0.0722]))[..., None]
    muted: Float[np.ndarray, "*n 3"] = grey + SATURATION * (colour - grey)
    return muted

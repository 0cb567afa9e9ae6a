"""Build the furniture pack from the CC0 library of the Debian package `sweethome3d-furniture`.

    apt-get install sweethome3d-furniture && pip install -e '.[assets]'
    python -m experiments.assets.build_furniture

Writes `furniture.json`, `furniture_<n>.npz` and `furniture.sha256` beside this file, and the
furniture section of `CREDITS.md`. The same library and the same decimator give the same bytes.
Run time: one to two CPU minutes. Never needed to run or to test the project.
"""

from __future__ import annotations

import io
import re
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image
from rich.progress import Progress

from experiments.assets import furniture_credits
from experiments.assets.furniture_decimate import (
    closest,
    decimate,
    distance_quantile,
    surface_samples,
    thin_leaves,
    weld,
    without_crumbs,
)
from experiments.assets.furniture_repair import areas, repaired, sheets
from experiments.assets.furniture_source import Library, SourcePart, SourcePiece
from experiments.scene.settle import settled_height
from renderer.files import file_sha256, write_bytes, write_json

HERE = Path(__file__).parent
LIBRARY = Path("/usr/share/sweethome3d/furniture/BlendSwap-CC-0.sh3f")
_RETRIES = (1.0, 1.5, 2.2, 3.5, 6.0)
_TEXTURE_SIDE = 256
_SHARD_BYTES = 3_400_000
_DARKEST, _BRIGHTEST = 0.03, 0.95
"""Range of the colours kept: on pure black no shadow shows, on pure white no light."""


@dataclass(frozen=True)
class PackedPart:
    """One material of a finished piece."""

    colour: tuple[float, float, float]
    corners: Float[np.ndarray, "F 3 3"]
    uv: Float[np.ndarray, "F 3 2"] | None
    texture: UInt8[np.ndarray, "h w 3"] | None


@click.command()
@click.option("--library", type=click.Path(path_type=Path), default=LIBRARY, show_default=True)
@click.option("--out", type=click.Path(path_type=Path), default=HERE, help="Folder of the pack.")
@click.option("--only", type=int, multiple=True, help="Build these catalogue numbers only.")
def main(library: Path, out: Path, only: tuple[int, ...]) -> None:
    """Build the furniture pack."""
    source = Library(library)
    specs = tomllib.loads((HERE / "furniture_pieces.toml").read_text(encoding="utf-8"))["piece"]
    specs = [spec for spec in specs if not only or spec["number"] in only]
    pieces: dict[str, dict[str, Any]] = {}
    arrays: dict[str, dict[str, np.ndarray]] = {}
    with Progress() as progress:
        for spec in progress.track(specs, description="furniture"):
            piece = source.piece(spec["number"])
            name = piece_name(piece)
            parts, report = build_piece(piece, spec)
            pieces[name], arrays[name] = _encode(piece, parts, spec, report)
            progress.console.print(f"{name}: {report}")
    write_pack(out, pieces, arrays, {"library": library.name, "sha256": file_sha256(library)})
    furniture_credits.write(out / "CREDITS.md", pieces)


def piece_name(piece: SourcePiece) -> str:
    """Title and catalogue number, as layouts spell it: `bedside_table_4`."""
    return re.sub(r"[^a-z0-9]+", "_", piece.title.lower()).strip("_") + f"_{piece.number}"


def build_piece(
    piece: SourcePiece, spec: dict[str, Any]
) -> tuple[tuple[PackedPart, ...], dict[str, Any]]:
    """Repair, decimate within the error guard, restore textures, double the sheets."""
    whole = tuple(part for part in _repair(piece) if part.material not in spec.get("drop", ()))
    for factor in _RETRIES:
        reduced, errors = _reduce(whole, spec, factor)
        if _seat_kept(whole, reduced, spec, piece):
            break
    else:
        raise click.ClickException(f"{piece.title} {piece.number}: decimation moves the seat")
    seat = _seat(reduced, spec, piece)
    parts = tuple(
        _finish(before, after, spec) for before, after in zip(whole, reduced, strict=True)
    )
    parts = _doubled(tuple(part for part in parts if len(part.corners)))
    report = {
        "source": sum(len(part.corners) for part in piece.parts),
        "triangles": sum(len(part.corners) for part in parts),
        "error_mm": round(1000 * max(errors), 1),
        "seat": seat,
    }
    return parts, report


def _repair(piece: SourcePiece) -> tuple[SourcePart, ...]:
    """Flip faces that look inwards and drop faces that nobody can see, over the whole piece."""
    soup = np.concatenate([part.corners for part in piece.parts])
    keep, flip = repaired(soup)
    starts = np.cumsum([0, *(len(part.corners) for part in piece.parts)])
    parts = []
    for part, start, stop in zip(piece.parts, starts[:-1], starts[1:], strict=True):
        solid = keep[start:stop] & (areas(part.corners) > 1e-12)
        corners, uv = _flipped(part, flip[start:stop])
        uv = uv[solid] if uv is not None else None
        parts.append(replace(part, corners=corners[solid], uv=uv))
    return tuple(part for part in parts if len(part.corners))


def _flipped(
    part: SourcePart, flip: np.ndarray
) -> tuple[Float[np.ndarray, "F 3 3"], Float[np.ndarray, "F 3 2"] | None]:
    corners = part.corners.copy()
    corners[flip] = corners[flip][:, ::-1]
    if part.uv is None:
        return corners, None
    uv = part.uv.copy()
    uv[flip] = uv[flip][:, ::-1]
    return corners, uv


def _reduce(
    parts: tuple[SourcePart, ...], spec: dict[str, Any], factor: float
) -> tuple[tuple[Float[np.ndarray, "F 3 3"], ...], list[float]]:
    """Decimate every material to its share of the budget, or more where the guard demands it."""
    total = sum(len(part.corners) for part in parts)
    size = float(np.ptp(np.concatenate([p.corners.reshape(-1, 3) for p in parts]), axis=0).max())
    allowed = (0.006 + 0.008 * size) * spec.get("loose", 1.0)
    rng = np.random.default_rng(spec["number"])
    reduced, errors = [], []
    for part in parts:
        target = max(int(factor * spec["budget"] * len(part.corners) / total), 12)
        if part.material in spec.get("foliage", ()):
            reduced.append(thin_leaves(part.corners, target, rng))
            errors.append(0.0)
            continue
        corners, error = _guarded(part.corners, target, allowed)
        reduced.append(corners)
        errors.append(error)
    return tuple(reduced), errors


def _guarded(
    corners: Float[np.ndarray, "F 3 3"], target: int, allowed: float
) -> tuple[Float[np.ndarray, "G 3 3"], float]:
    """The coarsest of several decimations that stays within the allowed error, or the original.

    The error is the 99.9 % quantile of the distances from the original's vertices and centroids to
    the result, or from the result to the original, whichever is larger: it sees both lost seats
    and new spikes.
    """
    coarse = without_crumbs(corners)
    samples = np.concatenate([coarse.reshape(-1, 3), coarse.mean(1)])
    for factor in _RETRIES:
        reduced = decimate(coarse, int(factor * target))
        back, _ = surface_samples(reduced, 0.02)
        error = max(distance_quantile(samples, reduced), distance_quantile(back, coarse))
        if error <= allowed:
            return reduced, error
    return coarse, 0.0


def _seat(
    reduced: tuple[np.ndarray, ...], spec: dict[str, Any], piece: SourcePiece
) -> float | None:
    """Seat height of a piece that has one in the list: measured, and checked against the list."""
    if "seat" not in spec:
        return None
    measured = _drop(np.concatenate(reduced))
    if abs(measured - spec["seat"]) > 0.02:
        click.echo(f"{piece.title} {piece.number}: seat {measured}, list says {spec['seat']}")
    return measured


def _seat_kept(
    whole: tuple[SourcePart, ...],
    reduced: tuple[np.ndarray, ...],
    spec: dict[str, Any],
    piece: SourcePiece,
) -> bool:
    """Whether what one sits or puts things on is where it was, within 2 cm."""
    if "seat" not in spec and piece.drop_height is None:
        return True
    before = _drop(np.concatenate([part.corners for part in whole]))
    after = _drop(np.concatenate(reduced))
    return bool(np.isnan(before)) or abs(after - before) <= 0.02


def _drop(corners: Float[np.ndarray, "F 3 3"]) -> float:
    """Height under the middle of the piece, a little to the front (backs stand behind)."""
    points = corners.reshape(-1, 3)
    width, depth, _ = np.ptp(points, axis=0)
    return settled_height(corners, 0.0, -0.08 * float(depth), (float(width), float(depth)))


def _finish(before: SourcePart, after: np.ndarray, spec: dict[str, Any]) -> PackedPart:
    """Texture coordinates from the closest point of the original; or the colour of the list."""
    colour = spec.get("colours", {}).get(before.material)
    if before.texture is None or before.uv is None or colour is not None:
        red, green, blue = np.clip(colour or before.colour, _DARKEST, _BRIGHTEST).tolist()
        return PackedPart((red, green, blue), after, None, None)
    return PackedPart((1.0, 1.0, 1.0), after, _carried_uv(before, after), _shrunk(before.texture))


def _carried_uv(
    before: SourcePart, after: Float[np.ndarray, "G 3 3"]
) -> Float[np.ndarray, "G 3 2"]:
    """Pull every corner 3 % to its face's centre first, so that seams resolve to the right chart."""
    assert before.uv is not None
    pulled = (0.97 * after + 0.03 * after.mean(1, keepdims=True)).reshape(-1, 3)
    face, _, foot = closest(pulled, before.corners)
    weights = _barycentric(before.corners[face], foot)
    return np.asarray(np.einsum("nk,nkc->nc", weights, before.uv[face]).reshape(-1, 3, 2))


def _barycentric(
    corners: Float[np.ndarray, "N 3 3"], points: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, "N 3"]:
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    to = points - corners[:, 0]
    d11, d12, d22 = (e1 * e1).sum(1), (e1 * e2).sum(1), (e2 * e2).sum(1)
    t1, t2 = (to * e1).sum(1), (to * e2).sum(1)
    det = np.maximum(d11 * d22 - d12 * d12, 1e-24)
    v, w = (d22 * t1 - d12 * t2) / det, (d11 * t2 - d12 * t1) / det
    return np.asarray(np.clip(np.stack([1 - v - w, v, w], 1), 0.0, 1.0))


def _shrunk(texture: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h2 w2 3"]:
    image = Image.fromarray(texture)
    image.thumbnail((_TEXTURE_SIDE, _TEXTURE_SIDE), Image.Resampling.LANCZOS)
    return np.asarray(image)


def _doubled(parts: tuple[PackedPart, ...]) -> tuple[PackedPart, ...]:
    """Reversed copies of the faces that are seen from both sides."""
    both = sheets(np.concatenate([part.corners for part in parts]))
    starts = np.cumsum([0, *(len(part.corners) for part in parts)])
    result = []
    for part, start, stop in zip(parts, starts[:-1], starts[1:], strict=True):
        again = both[start:stop]
        corners = np.concatenate([part.corners, part.corners[again][:, ::-1]])
        uv = part.uv
        if uv is not None:
            uv = np.concatenate([uv, uv[again][:, ::-1]])
        result.append(replace(part, corners=corners, uv=uv))
    return tuple(result)


def _encode(
    piece: SourcePiece,
    parts: tuple[PackedPart, ...],
    spec: dict[str, Any],
    report: dict[str, Any],
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Sixteen-bit vertices and texture coordinates, textures as PNG with a palette."""
    mesh = weld(np.concatenate([part.corners for part in parts]))
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    step = np.maximum(high - low, 1e-6) / 65535.0
    arrays: dict[str, np.ndarray] = {
        "vertices": np.round((mesh.vertices - low) / step).astype(np.uint16)
    }
    entries = []
    for index, part in enumerate(parts):
        solid = _solid(part)
        arrays[f"faces.{index}"] = _faces_of(mesh.vertices, part.corners[solid])
        entry: dict[str, Any] = {"colour": [round(float(c), 4) for c in part.colour]}
        if part.uv is not None and part.texture is not None:
            uv = part.uv[solid]
            uv_low, uv_high = uv.reshape(-1, 2).min(0), uv.reshape(-1, 2).max(0)
            uv_step = np.maximum(uv_high - uv_low, 1e-6) / 65535.0
            arrays[f"uv.{index}"] = np.round((uv - uv_low) / uv_step).astype(np.uint16)
            arrays[f"texture.{index}"] = _png(part.texture)
            entry |= {"uv_low": uv_low.tolist(), "uv_step": uv_step.tolist()}
        entries.append(entry)
    facts = {
        "title": piece.title,
        "number": piece.number,
        "creator": piece.creator,
        "seat": report["seat"],
        "source_triangles": report["source"],
        "triangles": report["triangles"],
        "error_mm": report["error_mm"],
        "low": low.tolist(),
        "step": step.tolist(),
        "parts": entries,
    }
    return facts, arrays


def _solid(part: PackedPart) -> np.ndarray:
    """Faces that survive welding."""
    key = np.round(part.corners / 1e-5).astype(np.int64)
    a, b, c = key[:, 0], key[:, 1], key[:, 2]
    same = np.all(a == b, 1) | np.all(b == c, 1) | np.all(a == c, 1)
    return np.asarray(~same)


def _faces_of(
    vertices: Float[np.ndarray, "V 3"], corners: Float[np.ndarray, "F 3 3"]
) -> np.ndarray:
    """Vertex index of every corner."""
    lookup = {tuple(key): index for index, key in enumerate(_keys(vertices))}
    index = [lookup[tuple(key)] for key in _keys(corners.reshape(-1, 3))]
    return np.array(index, dtype=np.uint16).reshape(-1, 3)


def _keys(points: Float[np.ndarray, "N 3"]) -> list[list[int]]:
    keys: list[list[int]] = np.round(points / 1e-5).astype(np.int64).tolist()
    return keys


def _png(texture: UInt8[np.ndarray, "h w 3"]) -> np.ndarray:
    image = Image.fromarray(texture).quantize(
        128, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.FLOYDSTEINBERG
    )
    stream = io.BytesIO()
    image.save(stream, "PNG", optimize=True)
    return np.frombuffer(stream.getvalue(), dtype=np.uint8)


def write_pack(
    out: Path,
    pieces: dict[str, dict[str, Any]],
    arrays: dict[str, dict[str, np.ndarray]],
    source: dict[str, str],
) -> None:
    """Spread the pieces over files of a few MiB, write the index and the list of hashes."""
    shards: list[dict[str, np.ndarray]] = [{}]
    filled = 0
    for name in sorted(pieces):
        size = len(_npz({f"{name}/{key}": value for key, value in arrays[name].items()}))
        if filled and filled + size > _SHARD_BYTES:
            shards.append({})
            filled = 0
        filled += size
        shards[-1] |= {f"{name}/{key}": value for key, value in arrays[name].items()}
        pieces[name]["file"] = f"furniture_{len(shards) - 1}.npz"
    for old in out.glob("furniture_*.npz"):
        old.unlink()
    for index, shard in enumerate(shards):
        write_bytes(out / f"furniture_{index}.npz", _npz(shard))
    write_json(out / "furniture.json", {"schema_version": 1, "source": source, "pieces": pieces})
    names = ["furniture.json", *(f"furniture_{index}.npz" for index in range(len(shards)))]
    lines = [f"{file_sha256(out / name)}  {name}\n" for name in names]
    write_bytes(out / "furniture.sha256", "".join(lines).encode())


def _npz(arrays: dict[str, np.ndarray]) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


if __name__ == "__main__":
    main()

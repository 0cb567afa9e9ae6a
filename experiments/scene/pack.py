"""The furniture pack: reader of the committed pieces, verified against their recorded hashes.

`build_furniture.py` writes it: `furniture.json` (index), `furniture_<n>.npz` (sixteen-bit vertices,
faces, texture coordinates; PNG textures) and `furniture.sha256`.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from renderer.files import InputError, file_sha256, read_json

PACK_DIR = Path(__file__).resolve().parents[1] / "assets"
SCHEMA_VERSION = 1


@dataclass(frozen=True)
class PiecePart:
    """The triangles of one material of a piece, in the piece's own frame."""

    corners: Float[np.ndarray, "F 3 3"]
    colour: tuple[float, float, float]
    """sRGB; white where the texture carries the colour."""
    uv: Float[np.ndarray, "F 3 2"] | None
    texture: UInt8[np.ndarray, "h w 3"] | None


@dataclass(frozen=True)
class Piece:
    """One piece of furniture: metres, z up, standing on z = 0, front towards -y."""

    name: str
    title: str
    creator: str
    seat: float | None
    """Height of the seat or mattress, where one sits or lies on it."""
    parts: tuple[PiecePart, ...]

    def points(self) -> Float[np.ndarray, "N 3"]:
        """All corners of all materials."""
        return np.concatenate([part.corners.reshape(-1, 3) for part in self.parts])


class Pack:
    """An opened pack; pieces are decoded when they are asked for."""

    def __init__(self, folder: Path = PACK_DIR) -> None:
        _verify(folder)
        self.folder = folder
        index = read_json(folder / "furniture.json")
        if index.get("schema_version") != SCHEMA_VERSION:
            raise InputError(
                folder / "furniture.json",
                "schema_version",
                index.get("schema_version"),
                str(SCHEMA_VERSION),
            )
        self._pieces: Mapping[str, Any] = index["pieces"]
        self._shards: dict[str, Any] = {}

    def names(self) -> tuple[str, ...]:
        """All pieces of the pack."""
        return tuple(sorted(self._pieces))

    def seat(self, name: str) -> float | None:
        """Seat height of a piece without decoding it."""
        seat = self._facts(name)["seat"]
        return None if seat is None else float(seat)

    def piece(self, name: str) -> Piece:
        """Decode one piece; InputError when the pack has none of that name."""
        facts = self._facts(name)
        vertices = np.asarray(facts["low"]) + self._array(facts, name, "vertices") * np.asarray(
            facts["step"]
        )
        parts = tuple(
            self._part(facts, name, index, vertices) for index in range(len(facts["parts"]))
        )
        return Piece(name, facts["title"], facts["creator"], self.seat(name), parts)

    def _part(
        self, facts: Mapping[str, Any], name: str, index: int, vertices: Float[np.ndarray, "V 3"]
    ) -> PiecePart:
        entry = facts["parts"][index]
        red, green, blue = entry["colour"]
        corners = vertices[self._array(facts, name, f"faces.{index}")]
        if "uv_low" not in entry:
            return PiecePart(corners, (red, green, blue), None, None)
        steps = self._array(facts, name, f"uv.{index}") * np.asarray(entry["uv_step"])
        encoded = self._array(facts, name, f"texture.{index}").tobytes()
        texture = np.asarray(Image.open(io.BytesIO(encoded)).convert("RGB"))
        return PiecePart(corners, (red, green, blue), np.asarray(entry["uv_low"]) + steps, texture)

    def _facts(self, name: str) -> Mapping[str, Any]:
        if name not in self._pieces:
            raise InputError(self.folder / "furniture.json", "piece", name, "a piece of the pack")
        facts: Mapping[str, Any] = self._pieces[name]
        return facts

    def _array(self, facts: Mapping[str, Any], name: str, key: str) -> np.ndarray:
        shard = facts["file"]
        if shard not in self._shards:
            self._shards[shard] = np.load(self.folder / shard, allow_pickle=False)
        array: np.ndarray = self._shards[shard][f"{name}/{key}"]
        return array


@lru_cache(maxsize=1)
def default_pack() -> Pack:
    """The pack that comes with the project."""
    return Pack()


def _verify(folder: Path) -> None:
    """Compare every file with its recorded hash before anything is read."""
    record = folder / "furniture.sha256"
    try:
        lines = record.read_text(encoding="utf-8").splitlines()
    except OSError:
        raise InputError(record, "file", "missing", "the recorded hashes of the pack") from None
    for line in lines:
        wanted, _, name = line.partition("  ")
        path = folder / name
        if not path.is_file():
            raise InputError(path, "file", "missing", "a file of the furniture pack")
        if (found := file_sha256(path)) != wanted:
            raise InputError(path, "sha256", found, f"{wanted}: the asset pack was altered")

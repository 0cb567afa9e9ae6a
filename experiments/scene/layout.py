"""Layout: a furnished room as data, one small TOML file a room.

Frame: metres, z up, origin at the south-west corner of the floor, x east, y north. Walls are `n`
(y = depth), `s` (y = 0), `w` (x = 0) and `e` (x = width). Colours are sRGB in [0, 1].
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast, get_args

from experiments.scene.scene import MPCAT40
from renderer.files import InputError

Wall = Literal["n", "e", "s", "w"]
OpeningKind = Literal["window", "door"]
Floor = Literal["wood", "tile", "carpet"]
Colour = tuple[float, float, float]

LAYOUTS = Path(__file__).with_name("layouts")
SCHEMA_VERSION = 1
_VARIATION = re.compile(r"([a-z]+)_v(\d{1,9})")


@dataclass(frozen=True)
class Opening:
    """A window or door: an interval [u0, u1] along its wall (x for n/s, y for e/w) and [z0, z1]."""

    wall: Wall
    kind: OpeningKind
    u0: float
    u1: float
    z0: float
    z1: float


@dataclass(frozen=True)
class Item:
    """One object of a layout, before its shape is made."""

    id: str
    label: int
    """mpcat40 class index."""
    x: float
    """Centre of the footprint."""
    y: float
    yaw: float = 0.0
    """Degrees counter-clockwise from above; the front looks along -y at yaw 0."""
    piece: str | None = None
    """Name in the furniture pack; exactly one of `piece` and `shape` is set."""
    shape: str | None = None
    """Name of a parametric shape."""
    params: Mapping[str, Any] = field(default_factory=dict)
    """Parameters of the shape."""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """In the piece's own axes, before the yaw."""
    seat: float | None = None
    """Wanted height of the seat or mattress; sets the third scale factor."""
    tint: Colour | None = None
    """Recolours the piece, keeping its light and dark parts."""
    z: float | None = None
    """Height of the base; None means settled on `on`, or on the floor."""
    on: str | None = None
    wall: Wall | None = None
    """The wall that it hangs on or belongs to."""

    @property
    def asset(self) -> str:
        """`pack:<name>` or `shape:<name>`."""
        return f"pack:{self.piece}" if self.piece else f"shape:{self.shape}"


@dataclass(frozen=True)
class Layout:
    """A room: its box, its surfaces, its openings and what stands in it."""

    name: str
    size: tuple[float, float, float]
    """Width (x), depth (y), height (z)."""
    floor: Floor
    floor_tint: Colour
    wall_colour: Colour
    openings: tuple[Opening, ...]
    items: tuple[Item, ...]

    def item(self, item_id: str) -> Item:
        """The item of that id; KeyError if there is none."""
        for item in self.items:
            if item.id == item_id:
                return item
        raise KeyError(item_id)


def read_layout(path_or_name: Path | str) -> Layout:
    """Read and check one layout: a path, or the name of a room that comes with the project.

    `office_v3` is the variation of `office` with seed 3 (see `variations`). Raises InputError naming
    the file, the field and the value at fault.
    """
    if (match := _VARIATION.fullmatch(str(path_or_name))) and match[1] in layout_names():
        from experiments.scene.variations import vary

        return vary(read_layout(match[1]), int(match[2]))
    source = _source_file(path_or_name)
    try:
        data = tomllib.loads(source.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(source, "file", str(error), "a readable TOML file") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(source, "content", str(error), "valid TOML") from None
    return parse_layout(data, source)


def layout_names() -> tuple[str, ...]:
    """Names of the rooms that come with the project."""
    return tuple(sorted(path.stem for path in LAYOUTS.glob("*.toml")))


def parse_layout(data: Mapping[str, Any], source: object) -> Layout:
    """Check the parsed content of a layout file and turn it into a `Layout`."""
    top = _Table(source, "", data)
    top.only("schema_version", "room", "opening", "object")
    if (version := top.get("schema_version")) != SCHEMA_VERSION:
        raise InputError(source, "schema_version", version, str(SCHEMA_VERSION))
    room = top.table("room")
    room.only("name", "size", "floor", "floor_tint", "wall")
    size = room.numbers("size", 3, 0.5, 100.0)
    return Layout(
        name=room.text("name"),
        size=size,
        floor=cast(Floor, room.choice("floor", get_args(Floor))),
        floor_tint=room.colour("floor_tint"),
        wall_colour=room.colour("wall"),
        openings=tuple(_opening(entry, size) for entry in top.tables("opening")),
        items=_items(top.tables("object"), size),
    )


def _source_file(path_or_name: Path | str) -> Path:
    """The file meant: names without a dot or slash are rooms of the project."""
    text = str(path_or_name)
    if isinstance(path_or_name, Path) or text.endswith(".toml") or "/" in text:
        return Path(path_or_name)
    source = LAYOUTS / f"{text}.toml"
    if not source.is_file():
        raise InputError("layout", "name", text, "one of " + ", ".join(layout_names()))
    return source


def _opening(entry: _Table, size: tuple[float, float, float]) -> Opening:
    entry.only("wall", "kind", "u0", "u1", "z0", "z1")
    wall = cast(Wall, entry.choice("wall", get_args(Wall)))
    length = size[0] if wall in "ns" else size[1]
    u0, u1 = entry.number("u0", 0.0, length), entry.number("u1", 0.0, length)
    z0, z1 = entry.number("z0", 0.0, size[2]), entry.number("z1", 0.0, size[2])
    if u1 <= u0 or z1 <= z0:
        raise entry.error("u1" if u1 <= u0 else "z1", u1 if u1 <= u0 else z1, "more than its start")
    kind = cast(OpeningKind, entry.choice("kind", get_args(OpeningKind)))
    return Opening(wall, kind, u0, u1, z0, z1)


def _items(entries: list[_Table], size: tuple[float, float, float]) -> tuple[Item, ...]:
    """Items in file order; a support must stand before what stands on it."""
    seen: dict[str, Item] = {}
    for entry in entries:
        item = _item(entry, size)
        if item.id in seen:
            raise entry.error("id", item.id, "an id that no other object has")
        if item.on is not None and item.on not in seen:
            raise entry.error("on", item.on, "the id of an object further up in the file")
        seen[item.id] = item
    return tuple(seen.values())


def _item(entry: _Table, size: tuple[float, float, float]) -> Item:
    entry.only(
        *("id", "class", "piece", "shape", "params", "x", "y", "z", "yaw"),
        *("scale", "seat", "tint", "on", "wall"),
    )
    if entry.has("piece") == entry.has("shape"):
        raise entry.error("piece", entry.get("piece"), "either piece or shape, not both")
    return Item(
        id=entry.text("id"),
        label=MPCAT40.index(entry.choice("class", MPCAT40[1:])),
        x=entry.number("x", 0.0, size[0]),
        y=entry.number("y", 0.0, size[1]),
        yaw=entry.number("yaw", -360.0, 360.0) if entry.has("yaw") else 0.0,
        piece=entry.text("piece") if entry.has("piece") else None,
        shape=entry.text("shape") if entry.has("shape") else None,
        params=entry.params("params"),
        scale=entry.numbers("scale", 3, 0.1, 10.0) if entry.has("scale") else (1.0, 1.0, 1.0),
        seat=entry.number("seat", 0.2, 1.2) if entry.has("seat") else None,
        tint=entry.colour("tint") if entry.has("tint") else None,
        z=entry.number("z", 0.0, size[2]) if entry.has("z") else None,
        on=entry.text("on") if entry.has("on") else None,
        wall=cast(Wall, entry.choice("wall", get_args(Wall))) if entry.has("wall") else None,
    )


class _Table:
    """One TOML table that knows where it stands, so that errors name file and field."""

    def __init__(self, source: object, prefix: str, data: Any) -> None:
        self.source, self.prefix = source, prefix
        if not isinstance(data, Mapping):
            raise InputError(source, prefix.rstrip("."), data, "a table")
        self.data = data

    def error(self, key: str, value: object, wanted: str) -> InputError:
        return InputError(self.source, self.prefix + key, value, wanted)

    def only(self, *keys: str) -> None:
        for key in self.data:
            if key not in keys:
                raise self.error(key, self.data[key], "one of the keys " + ", ".join(keys))

    def has(self, key: str) -> bool:
        return key in self.data

    def get(self, key: str) -> Any:
        return self.data.get(key)

    def table(self, key: str) -> _Table:
        return _Table(self.source, f"{self.prefix}{key}.", self.get(key))

    def tables(self, key: str) -> list[_Table]:
        entries = self.data.get(key, [])
        if not isinstance(entries, list):
            raise self.error(key, entries, "a list of tables")
        return [_Table(self.source, f"{key}[{i}].", entry) for i, entry in enumerate(entries)]

    def text(self, key: str) -> str:
        value = self.get(key)
        if not isinstance(value, str) or not value:
            raise self.error(key, value, "a text that is not empty")
        return value

    def choice(self, key: str, allowed: tuple[str, ...]) -> str:
        value = self.get(key)
        if value not in allowed:
            raise self.error(key, value, "one of " + ", ".join(allowed))
        return str(value)

    def number(self, key: str, low: float, high: float) -> float:
        return self._number(key, self.get(key), low, high)

    def numbers(self, key: str, n: int, low: float, high: float) -> tuple[float, float, float]:
        value = self.get(key)
        if not isinstance(value, list) or len(value) != n:
            raise self.error(key, value, f"a list of {n} numbers")
        one, two, three = (self._number(key, entry, low, high) for entry in value)
        return one, two, three

    def colour(self, key: str) -> Colour:
        return self.numbers(key, 3, 0.0, 1.0)

    def params(self, key: str) -> dict[str, Any]:
        """Numbers, booleans, and lists of numbers (which become tuples)."""
        table = _Table(self.source, f"{self.prefix}{key}.", self.data.get(key, {}))
        return {name: table._param(name, value) for name, value in table.data.items()}

    def _param(self, name: str, value: Any) -> Any:
        if isinstance(value, list):
            return tuple(self._number(name, entry, -100.0, 100.0) for entry in value)
        if isinstance(value, bool | int):
            return value
        return self._number(name, value, -100.0, 100.0)

    def _number(self, key: str, value: Any, low: float, high: float) -> float:
        good = isinstance(value, int | float) and not isinstance(value, bool)
        if not good or not low <= value <= high:
            raise self.error(key, value, f"a number from {low:g} to {high:g}")
        return float(value)

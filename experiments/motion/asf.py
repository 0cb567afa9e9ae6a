"""Reader of Acclaim skeletons (`.asf`): bone lengths, directions, local axes and degrees of freedom."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from renderer.files import InputError

INCH_M = 0.0254
_DOFS = ("rx", "ry", "rz")


@dataclass(frozen=True)
class Bone:
    """One bone: it starts where its parent ends, and rotates about its own start."""

    name: str
    parent: str
    offset: Float[np.ndarray, "3"]
    """From start to end in the rest pose, metres, y up."""
    axes: Float[np.ndarray, "3 3"]
    """Local axes in which the degrees of freedom are meant."""
    dofs: tuple[str, ...]


@dataclass(frozen=True)
class AcclaimSkeleton:
    """Bones in an order in which parents come first; the root is called `root`."""

    bones: dict[str, Bone]
    root_order: tuple[str, ...]
    metres_per_unit: float


@dataclass
class _Draft:
    fields: dict[str, list[str]] = field(default_factory=dict)
    line: int = 0


def read_asf(path: Path) -> AcclaimSkeleton:
    """Read a skeleton. Raises `InputError` naming the line at fault."""
    sections = _sections(path)
    for name in (":units", ":root", ":bonedata", ":hierarchy"):
        if name not in sections:
            raise InputError(path, "section", "nothing", f"a section {name} (truncated file?)")
    scale = _metres_per_unit(path, sections[":units"])
    drafts = _drafts(path, sections[":bonedata"])
    parents = _parents(path, sections[":hierarchy"], drafts)
    bones = {name: _bone(path, drafts[name], parents[name], scale) for name in parents}
    return AcclaimSkeleton(bones, _root_order(path, sections[":root"]), scale)


def _sections(path: Path) -> dict[str, list[tuple[int, list[str]]]]:
    """Lines by section, each with its number, split into words."""
    try:
        text = path.read_text()
    except FileNotFoundError:
        raise InputError(path, "file", "missing", "an existing .asf skeleton") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, "content", str(error), "a text file") from None
    sections: dict[str, list[tuple[int, list[str]]]] = {}
    current: list[tuple[int, list[str]]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#")[0].replace("(", " ").replace(")", " ").split()
        if words and words[0].startswith(":"):
            current = sections.setdefault(words[0].lower(), [])
        elif words:
            current.append((number, words))
    return sections


def _metres_per_unit(path: Path, lines: list[tuple[int, list[str]]]) -> float:
    """CMU's convention: one unit is `1 / length` inches."""
    values = {words[0]: (number, words[1:]) for number, words in lines}
    number, words = values.get("length", (lines[0][0] if lines else 0, []))
    (length,) = _numbers(path, number, words, 1)
    if length <= 0:
        raise InputError(path, f"line {number} length", length, "a positive unit length")
    if values.get("angle", (0, ["deg"]))[1] != ["deg"]:
        raise InputError(path, "angle", values["angle"][1], "deg")
    return INCH_M / length


def _drafts(path: Path, lines: list[tuple[int, list[str]]]) -> dict[str, _Draft]:
    drafts: dict[str, _Draft] = {}
    draft: _Draft | None = None
    for number, words in lines:
        if words[0] == "begin":
            draft = _Draft(line=number)
        elif words[0] == "end":
            if draft is None or "name" not in draft.fields:
                raise InputError(path, f"line {number}", "end", "a bone with a name before it")
            drafts[draft.fields["name"][0]] = draft
            draft = None
        elif draft is not None:
            draft.fields.setdefault(words[0], words[1:])
    if draft is not None:
        raise InputError(path, f"line {draft.line}", "begin", "a matching end (truncated file?)")
    return drafts


def _parents(
    path: Path, lines: list[tuple[int, list[str]]], drafts: dict[str, _Draft]
) -> dict[str, str]:
    """Parent of every bone, in an order in which parents come first."""
    parents: dict[str, str] = {}
    for number, words in lines:
        if words[0] in ("begin", "end"):
            continue
        for name in words[1:]:
            if name not in drafts:
                raise InputError(path, f"line {number}", name, "a bone of the section :bonedata")
            if words[0] != "root" and words[0] not in parents:
                raise InputError(path, f"line {number}", words[0], "a bone placed before")
            parents[name] = words[0]
    missing = sorted(drafts.keys() - parents.keys())
    if missing:
        raise InputError(path, ":hierarchy", missing[0], "a parent for every bone")
    return parents


def _bone(path: Path, draft: _Draft, parent: str, scale: float) -> Bone:
    def numbers(name: str, count: int) -> list[float]:
        words = draft.fields.get(name)
        if words is None:
            raise InputError(path, f"line {draft.line} {name}", "nothing", f"{count} numbers")
        return _numbers(path, draft.line, words[:count], count)

    direction, (length,) = np.array(numbers("direction", 3)), numbers("length", 1)
    dofs = tuple(draft.fields.get("dof", []))
    for dof in dofs:
        if dof not in _DOFS:
            raise InputError(path, f"line {draft.line} dof", dof, "rx, ry or rz")
    axes = Rotation.from_euler("xyz", numbers("axis", 3), degrees=True).as_matrix()
    return Bone(draft.fields["name"][0], parent, direction * length * scale, np.array(axes), dofs)


def _root_order(path: Path, lines: list[tuple[int, list[str]]]) -> tuple[str, ...]:
    for number, words in lines:
        if words[0] == "order":
            order = tuple(word.lower() for word in words[1:])
            if sorted(order) != ["rx", "ry", "rz", "tx", "ty", "tz"]:
                raise InputError(path, f"line {number} order", words[1:], "TX TY TZ RX RY RZ")
            return order
    raise InputError(path, ":root", "nothing", "a line order TX TY TZ RX RY RZ")


def _numbers(path: Path, number: int, words: list[str], count: int) -> list[float]:
    if len(words) != count:
        raise InputError(path, f"line {number}", " ".join(words), f"{count} numbers")
    return list(_floats(path, number, words))


def _floats(path: Path, number: int, words: list[str]) -> Iterator[float]:
    for word in words:
        value = float(word) if re.fullmatch(r"[-+]?[\d.]+([eE][-+]?\d+)?", word) else np.nan
        if not np.isfinite(value):
            raise InputError(path, f"line {number}", word, "a finite number")
        yield value

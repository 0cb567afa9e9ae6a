"""The registry of parametric shapes, and making one from the parameters of a layout."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from experiments.scene import parametric_clutter as clutter
from experiments.scene import parametric_furniture as furniture
from experiments.scene.parametric_primitives import ShapePart
from renderer.files import InputError

Shape = Callable[..., tuple[ShapePart, ...]]

SHAPES: Mapping[str, Shape] = {
    shape.__name__: shape
    for shape in (
        furniture.armchair,
        furniture.bench,
        furniture.board,
        furniture.bookcase,
        furniture.curtain,
        furniture.drawers,
        furniture.floorlamp,
        furniture.rug,
        furniture.swivel,
        furniture.table,
        clutter.backpack,
        clutter.basket,
        clutter.blanket,
        clutter.bookstack,
        clutter.bowl,
        clutter.briefcase,
        clutter.carton,
        clutter.clock,
        clutter.cushion,
        clutter.glass,
        clutter.keyboard,
        clutter.laptop,
        clutter.monitor,
        clutter.openbook,
        clutter.papers,
        clutter.pen_cup,
        clutter.picture,
        clutter.pouf,
        clutter.printer,
        clutter.tv,
        clutter.vase,
    )
}


def make_shape(
    name: str, params: Mapping[str, Any], source: object = "layout"
) -> tuple[ShapePart, ...]:
    """Make a shape; InputError names an unknown shape, or a parameter that it does not have."""
    shape = SHAPES.get(name)
    if shape is None:
        raise InputError(source, "shape", name, "one of " + ", ".join(SHAPES))
    known = inspect.signature(shape).parameters
    for key, value in params.items():
        if key not in known:
            raise InputError(source, f"{name}.{key}", value, "one of " + ", ".join(known))
        if (wanted := _kind(known[key].default)) != _kind(value):
            raise InputError(source, f"{name}.{key}", value, wanted)
    return shape(**{key: _as(known[key].default, value) for key, value in params.items()})


def _as(default: Any, value: Any) -> Any:
    """The value in the number type of the default: TOML tells 2 from 2.0."""
    if isinstance(default, tuple):
        return tuple(float(entry) for entry in value)
    return type(default)(value)


def _kind(value: Any) -> str:
    """What a parameter may hold, told from its default."""
    if isinstance(value, tuple):
        return f"a list of {len(value)} numbers"
    if isinstance(value, bool):
        return "true or false"
    return "a number" if isinstance(value, int | float) else "nothing else"

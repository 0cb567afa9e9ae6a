"""Figures, drawn from `results.json` alone; the same bytes for the same results and versions."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from analysis.results import Results, ordered

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, SECOND, GREY, PALE = "#1f4e79", "#c05a00", "#6b6b6b", "#c9c9c9"
FORMATS = ("svg", "pdf", "png")
_STYLE: Any = {
    "svg.hashsalt": "pace-study", "svg.fonttype": "path", "pdf.fonttype": 42,
    "font.family": "DejaVu Sans", "font.size": 9, "axes.spines.top": False,
    "axes.spines.right": False, "axes.edgecolor": GREY, "xtick.color": GREY, "ytick.color": "black",
    "axes.labelcolor": "black", "figure.dpi": 100, "savefig.dpi": 200,
}  # fmt: skip
_METADATA: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "png": {"Software": None},
}


def all_figures(results: Results) -> dict[str, Callable[[Results], Figure]]:
    """The figures that these results allow, by file name."""
    return {"forest": forest}


def draw(figure: Callable[[Results], Figure], results: Results) -> dict[str, bytes]:
    """Draw one figure in every format, watermarked."""
    with _style():
        drawn = figure(results)
        _watermark(drawn, results["watermark"])
        return {kind: _encode(drawn, kind) for kind in FORMATS}


def forest(results: Results) -> Figure:
    """Rate per baseline: headline interval thick, naive interval thin and dashed below, 50 % dotted."""
    rows = ordered(results)
    figure, axes = _canvas(7.2, 1.1 + 0.52 * len(rows))
    for place, (_, row) in enumerate(rows):
        low, high = (100 * bound for bound in row["ci"])
        axes.plot([low, high], [place, place], color=INK, lw=2.6, solid_capstyle="butt", zorder=3)
        axes.plot(100 * row["rate"], place, "o", color=INK, ms=6, zorder=4)
        naive = [100 * bound for bound in row["ci_naive"]]
        axes.plot(naive, [place + 0.22] * 2, color=GREY, lw=1, ls=(0, (3, 2)), zorder=2)
        shown = row["display"]
        text = f"{shown['rate']} % [{shown['ci'].replace('–', ', ')}]"
        axes.text(102, place, text, va="center", ha="left", fontsize=8.5)
    axes.axvline(50, color=GREY, lw=1, ls=":", zorder=1)
    _share_axis(axes, f"answers in favour of {', '.join(results['targets'])} (%)")
    axes.set_yticks(range(len(rows)), [f"{name}  (n = {row['n']:,})" for name, row in rows])
    axes.set_ylim(len(rows) - 0.45, -0.55)
    legend = "thick: clustered interval    dashed: assumes independent answers"
    axes.set_title(legend, fontsize=7.5, color=GREY, loc="left")
    return figure


def _share_axis(axes: Axes, label: str) -> None:
    axes.set_xlim(0, 100)
    axes.set_xticks(range(0, 101, 25))
    axes.set_xlabel(label)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def _canvas(width: float, height: float) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    return figure, figure.add_subplot()


def _watermark(figure: Figure, mark: str) -> None:
    if not mark:
        return
    figure.text(
        0.5, 0.5, mark, ha="center", va="center", rotation=12, fontsize=26, color=SECOND,
        alpha=0.13, zorder=0,
    )  # fmt: skip
    figure.text(0.995, 0.995, mark, ha="right", va="top", fontsize=7, color=SECOND)


def _encode(figure: Figure, kind: str) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format=kind, metadata=_METADATA[kind], bbox_inches="tight")
    return stream.getvalue()


@contextmanager
def _style() -> Iterator[None]:
    import matplotlib

    with matplotlib.rc_context(_STYLE):
        yield

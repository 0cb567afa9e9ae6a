"""Figures, drawn from `results.json` alone; the same bytes for the same results and versions."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from analysis.results import Results, comparison_label, method_label, ordered, target_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, SECOND, GREY, PALE = "#1f4e79", "#c05a00", "#6b6b6b", "#c9c9c9"
FORMATS = ("svg", "pdf", "png")
MOST_STIMULI = 150
"""A comparison with more stimuli is left out of the plot of single stimuli (they stand in the csv)."""
Drawing = Callable[[Results], "Figure"]
CAPTIONS = {
    "forest": "Share of answers in favour of the target, per comparison.",
    "shares": "Both shares of every comparison, around an even split.",
    "scenes": "Rate per scene with clustered intervals; the thin line is the comparison's overall rate.",
    "participants": "One dot per participant; the triangle is the overall rate.",
    "stimuli": "Rate of every stimulus, raw (hollow) and drawn towards the mean by the mixed model (filled).",
    "scale": "Bradley-Terry scale of all methods with clustered intervals; hollow: the target.",
}
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


def all_figures(results: Results) -> dict[str, Drawing]:
    """The figures that these results allow, by file name, in reading order."""
    found: dict[str, Drawing] = {"forest": forest, "shares": shares}
    rows = results["baselines"].values()
    if max(len(row["scenes"]) for row in rows) > 1:
        found["scenes"] = scene_panels
    if any(row["participant_counts"] for row in rows):
        found["participants"] = participant_dots
    if any(len(row["stimuli_rates"]) <= MOST_STIMULI for row in rows):
        found["stimuli"] = stimulus_dots
    if results["scale"]["methods"]:
        found["scale"] = scale
    return found


def draw(figure: Drawing, results: Results) -> dict[str, bytes]:
    """Draw one figure in every format, watermarked."""
    with _style():
        drawn = figure(results)
        _watermark(drawn, results["watermark"])
        return {kind: _encode(drawn, kind) for kind in FORMATS}


def forest(results: Results) -> Figure:
    """Rate per baseline: headline interval thick, naive interval thin and dashed below, 50 % dotted."""
    rows = ordered(results)
    figure, axes = _canvas(7.2, 0.8 + 0.52 * len(rows))
    for place, (_, row) in enumerate(rows):
        low, high = (100 * bound for bound in row["ci"])
        axes.plot([low, high], [place, place], color=INK, lw=2.6, solid_capstyle="butt", zorder=3)
        axes.plot(100 * row["rate"], place, "o", color=INK, ms=6, zorder=4, clip_on=False)
        naive = [100 * bound for bound in row["ci_naive"]]
        axes.plot(naive, [place + 0.22] * 2, color=GREY, lw=1, ls=(0, (3, 2)), zorder=2)
        shown = row["display"]
        text = f"{shown['rate']} % [{shown['ci'].replace('–', ', ')}]"
        axes.text(102, place, text, va="center", ha="left", fontsize=8.5)
    axes.axvline(50, color=GREY, lw=1, ls=":", zorder=1)
    _share_axis(axes, f"answers in favour of {target_labels(results)} (%)")
    axes.set_yticks(
        range(len(rows)),
        [_label(comparison_label(results, name), f"n = {row['n']:,}") for name, row in rows],
    )
    axes.set_ylim(len(rows) - 0.45, -0.55)
    legend = "thick: clustered interval    dashed: assumes independent answers"
    axes.set_title(legend, fontsize=7.5, color=GREY, loc="left")
    return figure


def shares(results: Results) -> Figure:
    """Diverging bars around an even split; the share of the small side stands outside its bar."""
    rows = ordered(results)
    figure, axes = _canvas(7.2, 0.7 + 0.42 * len(rows))
    for place, (_, row) in enumerate(rows):
        won, lost = 100 * row["rate"], 100 - 100 * row["rate"]
        axes.barh(place, won, color=INK, height=0.56)
        axes.barh(place, -lost, color=PALE, height=0.56)
        axes.text(won + 1.5, place, f"{row['display']['rate']} %", va="center", fontsize=8.5)
        axes.text(-lost - 1.5, place, f"{row['display']['baseline_rate']} %", va="center", ha="right",
                  fontsize=8.5, color=GREY)  # fmt: skip
    axes.axvline(0, color="black", lw=0.8)
    axes.set_xlim(-118, 118)
    axes.set_xticks([-100, -50, 0, 50, 100], ["100", "50", "0", "50", "100"])
    axes.set_xlabel(f"chose the other (%)      chose {target_labels(results)} (%)")
    axes.set_yticks(
        range(len(rows)),
        [_label(comparison_label(results, name), f"n = {row['n']:,}") for name, row in rows],
    )
    axes.set_ylim(len(rows) - 0.5, -0.5)
    _bare_left(axes)
    return figure


def scene_panels(results: Results) -> Figure:
    """One panel a comparison, one row a scene, all on the same axis."""
    rows = ordered(results)
    names = sorted({scene["scene"] for _, row in rows for scene in row["scenes"]})
    columns = min(3, len(rows))
    depth = -(-len(rows) // columns)
    figure, grid = _grid(depth, columns, 2.5 * columns + 1.0, (0.9 + 0.26 * len(names)) * depth)
    for axes, (name, row) in zip(grid, rows, strict=False):
        axes.axvline(100 * row["rate"], color=SECOND, lw=0.8, zorder=1)
        axes.axvline(50, color=GREY, lw=1, ls=":", zorder=1)
        for scene in row["scenes"]:
            place = names.index(scene["scene"])
            axes.plot([100 * b for b in scene["ci"]], [place, place], color=INK, lw=2, zorder=2)
            axes.plot(100 * scene["rate"], place, "o", color=INK, ms=4.5, zorder=3, clip_on=False)
        axes.set_title(
            _label(comparison_label(results, name), f"n = {row['n']:,}"), fontsize=8.5, loc="left"
        )
        _share_axis(axes, "")
        axes.set_xticks([0, 50, 100])
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
    for axes in grid[len(rows) - columns : len(rows)]:
        axes.tick_params(labelbottom=True)  # the lowest panel of every column
    for axes in grid[len(rows) :]:
        axes.set_visible(False)
    figure.supxlabel(f"answers in favour of {target_labels(results)} (%)", fontsize=9)
    return figure


def participant_dots(results: Results) -> Figure:
    """Rate of every participant as a stacked dot; the triangle marks the overall rate."""
    rows = [(name, row) for name, row in ordered(results) if row["participant_counts"]]
    stacks = [_stacks([k / n for k, n in row["participant_counts"]]) for _, row in rows]
    tallest = max(max(stack.values()) for stack in stacks)
    figure, axes = _canvas(7.2, 0.6 + 1.0 * len(rows))
    step = min(0.09, 0.66 / tallest)
    for place, ((_, row), stack) in enumerate(zip(rows, stacks, strict=True)):
        for value, height in stack.items():
            levels = [place + 0.3 - step * level for level in range(height)]
            axes.plot(
                [value] * height,
                levels,
                "o",
                color=INK,
                ms=min(5.0, 66 * step),
                mew=0,
                clip_on=False,
            )
        axes.plot(100 * row["rate"], place + 0.42, "^", color=SECOND, ms=6, clip_on=False)
    axes.axvline(50, color=GREY, lw=1, ls=":", zorder=0)
    _share_axis(axes, f"answers of one participant in favour of {target_labels(results)} (%)")
    labels = [
        _label(comparison_label(results, name), f"{row['participants']} participants")
        for name, row in rows
    ]
    axes.set_yticks(range(len(rows)), labels)
    axes.set_ylim(len(rows) - 0.42, -0.5)
    return figure


def stimulus_dots(results: Results) -> Figure:
    """Every stimulus: raw rate hollow, drawn towards the mean by the mixed model filled, joined by a line."""
    rows = [
        (name, row) for name, row in ordered(results) if len(row["stimuli_rates"]) <= MOST_STIMULI
    ]
    figure, axes = _canvas(7.2, 0.7 + 0.7 * len(rows))
    for place, (_, row) in enumerate(rows):
        for one in row["stimuli_rates"]:
            raw, pooled = 100 * one["rate"], one["pooled"]
            if pooled is not None:
                axes.plot(
                    [raw, 100 * pooled], [place + 0.2, place - 0.15], color=PALE, lw=0.7, zorder=1
                )
                axes.plot(100 * pooled, place - 0.15, "o", color=INK, ms=4, mew=0, zorder=3)
            axes.plot(raw, place + 0.2, "o", mfc="white", mec=GREY, ms=4, zorder=2, clip_on=False)
    axes.axvline(50, color=GREY, lw=1, ls=":", zorder=0)
    _share_axis(axes, f"answers about one stimulus in favour of {target_labels(results)} (%)")
    labels = [
        _label(comparison_label(results, name), f"{len(row['stimuli_rates'])} stimuli")
        for name, row in rows
    ]
    axes.set_yticks(range(len(rows)), labels)
    axes.set_ylim(len(rows) - 0.55, -0.5)
    return figure


def scale(results: Results) -> Figure:
    """One row a method: ability relative to the mean, clustered interval, the target hollow."""
    methods = results["scale"]["methods"]
    figure, axes = _canvas(7.2, 0.6 + 0.36 * len(methods))
    for place, row in enumerate(methods):
        hollow = "white" if row["method"] in results["targets"] else INK
        axes.plot(row["ci"], [place, place], color=INK, lw=2, zorder=2)
        axes.plot(row["ability"], place, "o", mfc=hollow, mec=INK, ms=6.5, zorder=3)
    axes.axvline(0, color=GREY, lw=1, ls=":", zorder=0)
    axes.set_yticks(
        range(len(methods)),
        [textwrap.fill(method_label(results, row["method"]), 30) for row in methods],
    )
    axes.set_ylim(len(methods) - 0.5, -0.5)
    axes.set_xlabel("ability (log odds, relative to the mean method)")
    _bare_left(axes)
    return figure


def _label(name: str, detail: str) -> str:
    """A name on at most two lines, both sides of a pair on their own, and a detail in brackets below."""
    sides = name.split(" vs ")
    if len(name) > 26 and len(sides) == 2:
        lines = [
            textwrap.shorten(side, 26, placeholder=" …") for side in (sides[0], f"vs {sides[1]}")
        ]
    else:
        lines = textwrap.wrap(name, 26, max_lines=2, placeholder=" …") or [name]
    if len(lines) == 1 and len(name) + len(detail) < 26:
        return f"{name}  ({detail})"
    return "\n".join([*lines, f"({detail})"])


def _stacks(rates: list[float]) -> dict[float, int]:
    """Rates in bins of 2.5 points, and how many lie in each."""
    stack: dict[float, int] = {}
    for rate in rates:
        value = round(100 * rate / 2.5) * 2.5
        stack[value] = stack.get(value, 0) + 1
    return stack


def _share_axis(axes: Axes, label: str) -> None:
    axes.set_xlim(0, 100)
    axes.set_xticks(range(0, 101, 25))
    axes.set_xlabel(label)
    _bare_left(axes)


def _bare_left(axes: Axes) -> None:
    axes.tick_params(axis="y", length=0, pad=7)
    axes.spines["left"].set_visible(False)


def _canvas(width: float, height: float) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.add_subplot()


def _grid(depth: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    figure.set_layout_engine("constrained", wspace=0.09)  # tick labels of neighbours must not touch
    axes = figure.subplots(depth, columns, sharex=True, sharey=True, squeeze=False)
    return figure, list(axes.ravel())


def _watermark(figure: Figure, mark: str) -> None:
    if not mark:
        return
    figure.text(
        0.5, 0.5, mark, ha="center", va="center", rotation=12, fontsize=26, color=SECOND,
        alpha=0.13, zorder=0,
    )  # fmt: skip
    figure.text(0.995, 1.005, mark, ha="right", va="bottom", fontsize=7, color=SECOND)


def _encode(figure: Figure, kind: str) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format=kind, metadata=_METADATA[kind], bbox_inches="tight")
    return stream.getvalue()


@contextmanager
def _style() -> Iterator[None]:
    import matplotlib

    with matplotlib.rc_context(_STYLE):
        yield

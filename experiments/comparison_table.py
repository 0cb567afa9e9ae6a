"""The comparison as Markdown: our table beside the published one, costs, classes, ablations, plus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from experiments.motion_class import CLASSES

Method = dict[str, Any]

STRICT = ("non_collision", "contact")
TOUCH = ("contact_5mm", "contact_1cm", "contact_2cm", "cv2", "contact_beyond_floor")
DEPTH = ("deeper_1cm", "depth_sum_m", "depth_max_m", "semantic_match")
COST = ("angle_mean_deg", "angle_max_deg", "root_shift_mean_cm", "jerk_change_mm", "jerk_ratio",
        "foot_skate_before_cm_s", "foot_skate_cm_s")  # fmt: skip
CLASS_SCORES = ("non_collision", "contact", "contact_1cm", "cv2")
HEADINGS = {
    "non_collision": "non-collision", "contact": "contact", "contact_5mm": "contact 5 mm",
    "contact_1cm": "contact 1 cm", "contact_2cm": "contact 2 cm",
    "cv2": "predicted contacts within 2 cm", "contact_beyond_floor": "contact beyond floor",
    "deeper_1cm": "vertices deeper than 1 cm", "depth_sum_m": "summed depth (m)",
    "depth_max_m": "deepest vertex (m)", "semantic_match": "class match",
    "angle_mean_deg": "mean angle (deg)", "angle_max_deg": "max angle (deg)",
    "root_shift_mean_cm": "root shift (cm)", "jerk_change_mm": "jerk change (mm/frame³)",
    "jerk_ratio": "jerk ratio", "foot_skate_before_cm_s": "foot skate before (cm/s)",
    "foot_skate_cm_s": "after (cm/s)",
}  # fmt: skip
_DECIMALS = {"non_collision": 4, "deeper_1cm": 4, "angle_max_deg": 1}


def comparison_markdown(evaluation: dict[str, Any]) -> str:
    """The whole comparison as one Markdown page."""
    methods = evaluation["methods"]
    parts = [f"# Comparison: {evaluation['set_id']}", _conditions(evaluation)]
    parts += _block(_of(methods, "paper"), "The paper's methods", published=True)
    parts += _ablations(methods)
    parts += _block(_of(methods, "plus"), "With the scene terms of ours (plus)")
    parts += [plus_sentence(methods)]
    parts += ["## By class of motion", _classes(methods)]
    if "full" in evaluation:
        full = evaluation["full"]
        parts += [f"## The same with preset `{full['placement']['preset']}`", _conditions(full)]
        parts += [
            _strict(full["methods"], published=False),
            _scores(full["methods"], TOUCH + DEPTH),
        ]
    parts += ["## Not placed", _dropped(evaluation["dropped"])]
    return "\n\n".join(part for part in parts if part) + "\n"


def collision_sentence(methods: dict[str, Method]) -> str:
    """What a difference in strict non-collision between PACE and the rigid methods consists of."""
    rigid = [methods[name] for name in ("posa_t", "paak") if _has(methods, name)]
    if not rigid or not _has(methods, "pace"):
        return ""
    pace = methods["pace"]
    best = max(rigid, key=lambda method: method["non_collision"])
    gap = best["non_collision"] - pace["non_collision"]
    if gap <= 0.0:
        return (
            f"PACE's strict non-collision is not lower than that of the rigid methods (by {-gap:.4f} "
            f"above {best['display_name']})."
        )
    deep = pace["deeper_1cm"] - best["deeper_1cm"]
    floating = 1.0 - best["contact_1cm"]
    cause = (
        "the strict pair rewards floating, and contact attraction puts vertices astride the surface"
        if deep <= gap / 2
        else "PACE's bodies are deeper inside things"
    )
    return (
        f"PACE's strict non-collision is {gap:.4f} lower than that of {best['display_name']}: {cause}. "
        f"Of that gap {max(gap - deep, 0.0):.4f} are vertices less than 1 cm deep; vertices deeper than "
        f"1 cm differ by {deep:+.4f}. {best['display_name']} keeps everything more than 1 cm away in "
        f"{floating:.0%} of the frames, PACE in {1.0 - pace['contact_1cm']:.0%}."
    )


def plus_sentence(methods: dict[str, Method]) -> str:
    """Whether PACE+ lies above the rigid methods with printed terms in contact, and not below in
    non-collision. Other scene terms: it says what the terms bring, not which method is better."""
    if not _has(methods, "pace_plus"):
        return ""
    plus, parts = methods["pace_plus"], []
    for name in ("posa_t", "paak"):
        if _has(methods, name):
            other = methods[name]
            touch = "above" if plus["contact"] > other["contact"] else "NOT above"
            free = "not below" if plus["non_collision"] >= other["non_collision"] else "BELOW"
            parts.append(
                f"{other['display_name']} (printed terms): contact {plus['contact']:.3f} is {touch} "
                f"{other['contact']:.3f}, non-collision {plus['non_collision']:.4f} is {free} "
                f"{other['non_collision']:.4f}"
            )
    return f"PACE+ against {'; '.join(parts)}." if parts else ""


def _block(methods: dict[str, Method], title: str, published: bool = False) -> list[str]:
    if not methods:
        return []
    parts = [f"## {title}", _strict(methods, published), collision_sentence(methods)]
    parts += [_scores(methods, TOUCH), _scores(methods, DEPTH), "Cost of the alteration:"]
    return [*parts, _scores(methods, COST), _differences(methods)]


def _ablations(methods: dict[str, Method]) -> list[str]:
    own = _of(methods, "ablation")
    if not own:
        return []
    shown = {**({"pace": methods["pace"]} if "pace" in methods else {}), **own}
    rows = [
        [
            *_named(method),
            _number(method, "non_collision"),
            _number(method, "contact"),
            _number(method, "contact_1cm"),
            _number(method, "cv2"),
            _number(method, "frames_with_prediction"),
            _optimiser(method),
            _published(method, "non_collision"),
            _published(method, "contact"),
        ]
        for method in shown.values()
    ]
    heads = ["method", "clips", "non-collision", "contact", "contact 1 cm",
             "predicted contacts within 2 cm", "frames with predicted contact", "optimiser",
             "non-collision (published, PROX)", "contact (published, PROX)"]  # fmt: skip
    return ["## Ablations", _table(heads, rows), _scores(shown, COST), _differences(shown)]


def _conditions(evaluation: dict[str, Any]) -> str:
    set_up, cases = evaluation["conditions"], evaluation["cases"]
    cells = ", ".join(f"{100 * cell:.1f} cm" for cell in set_up["sdf_cell_m"])
    length = f"cut to {set_up['cut_seconds']:g} s" if set_up["cut_seconds"] else "at full length"
    tolerance = set_up["contact_tolerance_m"]
    rule = "" if tolerance is None else f" (contact vertices pay beyond {1000 * tolerance:g} mm)"
    return (
        f"{len(set_up['motions'])} motions {length} in {len(set_up['scenes'])} rooms "
        f"({', '.join(set_up['scenes'])}), body `{set_up['body']}`; preset "
        f"`{evaluation['placement']['preset']}`, interaction `{set_up['interaction']}`, weighting "
        f"`{set_up['weighting']}`, printed scene terms{rule}. {cases['kept']} of {cases['all']} "
        "(scene, motion) were placed by every study method and count. Scores are means over frames, then "
        f"over clips, on the full skin and the unthickened distance, read from cells of {cells}. "
        "Brackets: 95 % percentile bootstrap over motions." + _semantics_off(set_up)
    )


def _semantics_off(set_up: dict[str, Any]) -> str:
    """A sentence on the scenes whose classes did not count, or nothing."""
    scenes = set_up.get("semantics_off", {})
    told = "; ".join(f"{scene} ({reason})" for scene, reason in scenes.items())
    return f" No semantic term in {told}." if told else ""


def _strict(methods: dict[str, Method], published: bool) -> str:
    heads = ["method", "clips", "non-collision", "contact"]
    heads += ["non-collision (published, PROX)", "contact (published, PROX)"] if published else []
    rows = []
    for method in methods.values():
        cells = [*_named(method), *(_with_interval(method, name) for name in STRICT)]
        rows.append(cells + ([_published(method, name) for name in STRICT] if published else []))
    return _table(heads, rows)


def _scores(methods: dict[str, Method], names: Sequence[str]) -> str:
    heads = ["method", *(HEADINGS[name] for name in names)]
    rows = [
        [method["display_name"], *(_number(method, name) for name in names)]
        for method in methods.values()
    ]
    return _table(heads, rows)


def _differences(methods: dict[str, Method]) -> str:
    names = (*STRICT, "contact_1cm", "cv2", "deeper_1cm")
    rows = []
    for method in methods.values():
        if method["difference"]:
            cells = [_difference(method, name) for name in names]
            rows.append([f"{method['display_name']} minus {method['reference']}", *cells])
    heads = ["paired difference", *(HEADINGS[name] for name in names)]
    return _table(heads, rows) if rows else ""


def _classes(methods: dict[str, Method]) -> str:
    heads = ["class", "method", "clips", *(HEADINGS[name] for name in CLASS_SCORES)]
    rows = []
    for name in CLASSES:
        for method in methods.values():
            own = method["by_class"].get(name)
            if own:
                scores = [_number(own, score) for score in CLASS_SCORES]
                rows.append([name, method["display_name"], str(own["clips"]), *scores])
    return _table(heads, rows)


def _dropped(dropped: Sequence[dict[str, Any]]) -> str:
    if not dropped:
        return "Every method placed every motion in every room."
    rows = [[d["scene"], d["motion"], d["method"], d["failure"]] for d in dropped]
    return _table(["scene", "motion", "method", "reason"], rows)


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def _named(method: Method) -> list[str]:
    return [method["display_name"], str(method["clips"])]


def _number(scores: Method, name: str) -> str:
    if name not in scores:
        return "-"
    decimals = _DECIMALS.get(name, 3 if abs(scores[name]) < 10 else 1)
    return f"{round(scores[name], decimals) + 0.0:.{decimals}f}"


def _with_interval(method: Method, name: str) -> str:
    found = method["interval"].get(name, {})
    bounds = f" [{found['low']:.3f}, {found['high']:.3f}]" if "low" in found else ""
    return _number(method, name) + bounds


def _difference(method: Method, name: str) -> str:
    found = method["difference"].get(name)
    if not found:
        return "-"
    bounds = f" [{found['low']:+.3f}, {found['high']:+.3f}]" if "low" in found else ""
    return f"{found['mean']:+.3f}{bounds}"


def _published(method: Method, name: str) -> str:
    return f"{method['published'][name]:.3f}" if name in method["published"] else "-"


def _optimiser(method: Method) -> str:
    failed = method["optimiser"].get("failed", 0)
    if failed:
        return f"optimiser failed in {failed} of {method['clips']}"
    return "reached" if method["optimiser"] else "-"


def _of(methods: dict[str, Method], block: str) -> dict[str, Method]:
    return {name: method for name, method in methods.items() if method["block"] == block}


def _has(methods: dict[str, Method], name: str) -> bool:
    return name in methods and methods[name]["clips"] > 0

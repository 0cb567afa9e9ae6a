"""Cost of placement in CPU seconds of one thread, against the reference engine and against arithmetic.

`python -m tests.benchmarks.bench_placement [--cases 100] [--pairs 6]`. Prints a table with the
arithmetic lower bound beside each figure; the last line is one JSON object.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import resource
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
import torch

from experiments.body.embedded import load_body
from experiments.methods import METHODS
from experiments.motion.library import load_motion, trim
from experiments.placement.candidates import exact_scores, rank_starts
from experiments.placement.engines import ENGINES
from experiments.placement.objectives import alteration_terms, total
from experiments.placement.problem import Problem
from experiments.placement.settings import PRESETS
from experiments.scene.rooms import TEST_ROOMS
from tests.benchmarks.placement_cases import (
    PLAIN,
    WholeBody,
    clip,
    problem_of,
    random_case,
    rooms_of,
)

FRAMES, STARTS, CLOSURE_FRAMES = 60, 1000, 300
PAIRS = (
    ("walk_turn_right", "bedroom"),
    ("sit_stay_stand", "living"),
    ("walk_straight", "library"),
    ("reach_forward", "library"),
    ("lean_table", "bedroom"),
    ("sit_work", "booth"),
    ("stand_idle_look", "booth"),
    ("sofa_sit", "living"),
)
RUN_SECONDS = 5.0
"""150 frames."""


def main() -> None:
    """Measure everything and print the table and the JSON line."""
    parser = argparse.ArgumentParser(description="Benchmark of placement.")
    parser.add_argument("area", nargs="*", help="ignored: the area's name from the common runner")
    parser.add_argument("--cases", type=int, default=12, help="(motion, room) cases of the recall")
    parser.add_argument("--pairs", type=int, default=6, help="pairs of the whole runs")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rates = machine_rates()
    rooms = rooms_of(TEST_ROOMS)
    figures: dict[str, float] = {}
    bounds: dict[str, str] = {}
    for part in (
        lambda: start_figures(rooms["living"], rates),
        lambda: {"pruned_recall": pruned_recall(rooms, options.cases)},
        lambda: closure_figures(rooms["living"], rates),
        lambda: run_figures(rooms, options.pairs, rates),
    ):
        found = part()
        bounds.update({name: value for name, value in found.items() if isinstance(value, str)})
        figures.update({name: value for name, value in found.items() if isinstance(value, float)})
        say(f"... {', '.join(f'{name} {value:.4g}' for name, value in figures.items())}")
    figures["peak_mib"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    report(figures, bounds, options.cases)


def start_figures(room, rates) -> dict[str, float | str]:
    """A start scored: reference, batched exactly, and with pruning; milliseconds each."""
    problem, starts = random_case(np.random.default_rng(1), {"living": room}, FRAMES, STARTS)
    slow = with_engine(problem, "reference")
    few, many = starts.take(np.arange(0, STARTS, 100)), starts.take(np.arange(0, STARTS, 5))
    reference = cpu_ms(lambda: exact_scores(slow, few), 3) / len(few)
    batched = cpu_ms(lambda: exact_scores(problem, many), 3) / len(many)
    pruned = cpu_ms(lambda: rank_starts(problem, starts), 3) / STARTS
    n_points = problem.contact.numel()
    # Nine multiply-adds turn and move a point; a contact vertex reads eight corners besides.
    flops = 2 * n_points * 9 + 2 * int(problem.contact.sum()) * 14
    floor = 1e3 * flops / rates["flops"]
    return {
        "reference_start_ms": reference,
        "start_ms": batched,
        "start_pruned_ms": pruned,
        "start_ratio": reference / batched,
        "start_pruned_ratio": reference / pruned,
        "bound start_ms": f"{floor:.3f} ms of arithmetic, {batched / floor:.0f} times it",
    }


def pruned_recall(rooms, n_cases: int) -> float:
    """Share of random cases in which pruning keeps all of the true ten best starts."""
    rng = np.random.default_rng(7)
    kept_all = []
    for case in range(n_cases):
        problem, starts = random_case(rng, rooms, FRAMES, STARTS)
        best = np.sort(exact_scores(problem, starts))[:10]
        kept = rank_starts(problem, starts).score[:10]
        kept_all.append(bool(np.allclose(best, kept, rtol=1e-4)))
        if (case + 1) % 10 == 0:
            say(f"... recall: {case + 1} of {n_cases} cases, {np.mean(kept_all):.3f}")
    return float(np.mean(kept_all))


def closure_figures(room, rates) -> dict[str, float | str]:
    """One evaluation of PACE's energy and gradient at 300 frames: batched, frame by frame, full mesh."""
    problem = problem_of(clip("sit_stay_stand", CLOSURE_FRAMES), room, PLAIN)
    whole = dataclasses.replace(problem, body=WholeBody(problem.body))
    batched = cpu_ms(lambda: closure(problem, "batched"), 9)
    small = cpu_ms(lambda: closure(problem, "reference"), 1)
    full = cpu_ms(lambda: closure(whole, "reference"), 1)
    floor = 1e3 * closure_flops(problem) / rates["flops"]
    return {
        "closure_ms": batched,
        "reference_closure_ms": small,
        "closure_ratio_small": small / batched,
        "closure_ratio_full": full / batched,
        "bound closure_ms": f"{floor:.1f} ms of arithmetic, {batched / floor:.1f} times it",
    }


def closure(problem: Problem, name: str) -> None:
    """Energy and gradient in place, pose and translation."""
    engine = ENGINES[name]
    placed = torch.tensor([0.3, 0.5, 0.5, 0.0], requires_grad=True)
    delta = torch.zeros_like(problem.pose).requires_grad_(True)
    shift = torch.zeros_like(problem.transl).requires_grad_(True)
    bodies = engine.bodies(problem, placed, delta, shift)
    terms = engine.terms(problem, bodies, 0.003, False)
    costs = alteration_terms(delta, shift, problem.k, problem.step_scale, problem.settings)
    total({**terms, **costs}).backward()


def closure_flops(problem: Problem) -> float:
    """Multiply-adds, twice each, that no program can leave out: skinning, its gradient, corners."""
    n_frames, n_vertices = problem.contact.shape
    skinning = 2 * (3 * 88 + 9) * n_frames * n_vertices
    whitening = 2 * n_frames * n_frames * 69
    corners = 2 * 14 * float(problem.contact.sum())
    return 2 * (skinning + whitening) + 2 * corners


def run_figures(rooms, n_pairs: int, rates) -> dict[str, float | str]:
    """Whole runs of 150 frames: PACE from ten starts, and the preset `fast` against it."""
    ten = dataclasses.replace(
        PRESETS["default"], preset="ten", n_starts=10, n_altered=10, give_up_factor=None
    )
    spent: dict[str, list[float]] = {"ten": [], "fast": []}
    gaps, evaluations = [], []
    for motion_id, name in PAIRS[:n_pairs]:
        motion = trim(load_motion(motion_id), RUN_SECONDS)
        energy = {}
        for settings in (ten, PRESETS["fast"]):
            begin = time.process_time()
            placed = METHODS["pace"].place(motion, rooms[name], load_body(), settings, 0)
            spent[settings.preset].append(time.process_time() - begin)
            energy[settings.preset] = placed.terms["total"]
            if settings is ten:
                evaluations.append(placed.info["evaluations"])
        gaps.append(energy["fast"] / energy["ten"] - 1.0)
        times = ", ".join(f"{key} {values[-1]:.1f} s" for key, values in spent.items())
        say(f"... {motion_id} in {name}: {times}, energy {energy['ten']:.3f}, gap {gaps[-1]:+.3f}")
    motion = trim(load_motion(PAIRS[0][0]), RUN_SECONDS)
    flops = closure_flops(problem_of(motion, rooms[PAIRS[0][1]], PLAIN))
    floor = statistics.median(evaluations) * flops / rates["flops"]
    return {
        "pace_cpu_s": statistics.median(spent["ten"]),
        "fast_cpu_s": statistics.median(spent["fast"]),
        "fast_energy_gap": statistics.median(gaps),
        "bound pace_cpu_s": f"{floor:.1f} s for {statistics.median(evaluations):.0f} evaluations",
    }


def with_engine(problem: Problem, engine: str) -> Problem:
    """The same problem for another engine."""
    settings = dataclasses.replace(problem.settings, engine=engine)
    return dataclasses.replace(problem, settings=settings)


def machine_rates() -> dict[str, float]:
    """Floating-point operations a second that this machine's matrix product reaches on one core."""
    size = 768
    square = torch.ones((size, size))
    return {"flops": 2 * size**3 / (1e-3 * cpu_ms(lambda: square @ square, 5))}


def cpu_ms(call: Callable[[], object], repeats: int) -> float:
    """Median CPU milliseconds of a call, after one to warm up if it is repeated."""
    spent = []
    for _ in range(repeats + (repeats > 1)):
        begin = time.process_time()
        call()
        spent.append(time.process_time() - begin)
    return 1e3 * statistics.median(spent[-repeats:])


KEYS = (
    "start_ratio",
    "start_pruned_ratio",
    "pruned_recall",
    "closure_ratio_small",
    "closure_ratio_full",
    "reference_closure_ms",
    "pace_cpu_s",
    "fast_cpu_s",
    "fast_energy_gap",
    "peak_mib",
)


def report(figures: dict[str, float], bounds: dict[str, str], n_cases: int) -> None:
    """The table, then the JSON line."""
    goals = {
        "start_ratio": "at least 20",
        "start_pruned_ratio": "at least 50",
        "pruned_recall": f"at least 0.95; {n_cases} cases",
        "closure_ratio_small": "at least 10",
        "closure_ratio_full": "at least 20",
        "pace_cpu_s": "at most 150, goal 60",
        "fast_cpu_s": "at most 40, goal 15",
        "fast_energy_gap": "at most 0.05",
        "peak_mib": "under 2048",
    }
    for name, value in figures.items():
        bound = bounds.get(f"bound {name}", "")
        say(f"{name:22s} {value:10.3f}   {goals.get(name, ''):28s} {bound}")
    say(json.dumps({key: round(figures[key], 4) for key in KEYS}))


def say(text: str) -> None:
    """Print at once: the whole takes minutes."""
    print(text)
    sys.stdout.flush()


if __name__ == "__main__":
    main()

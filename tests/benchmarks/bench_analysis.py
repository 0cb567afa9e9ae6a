"""Analysis at paper size and at a million answers, beside choix and statsmodels; CPU seconds.

The last line is one JSON object. choix comes with the extra `check`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import choix
import numpy as np
import pandas as pd
import statsmodels.api as sm

from analysis.bradley_terry import Duels, fit_scale
from analysis.cells import count_cells
from analysis.clustered import logit_variance
from analysis.columns import COLUMN_NAMES
from analysis.glmm import fit_crossed

_CHILD = """
import json, re, sys, time
from pathlib import Path
from analysis.estimate import estimate
began = time.process_time()
results = estimate(Path(sys.argv[1]), bootstraps=int(sys.argv[2]))
# Linux's own high-water mark of this process; getrusage would carry the parent's over.
peak = int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text()).group(1))
print(json.dumps({"cpu_s": time.process_time() - began, "peak_mib": peak / 1024,
                  "answers": results["flow"]["analysed"]}))
"""


def write_study(
    path: Path, people: int, per_person: int, baselines: int, clips: int, seed: int
) -> None:
    """A simulated star study of `people` x `per_person` answers, crossed effects of SD 0.5."""
    rng = np.random.default_rng(seed)
    size = people * per_person
    who, trial = np.divmod(np.arange(size), per_person)
    cell = np.argsort(rng.random((people, baselines * clips)), axis=1)[:, :per_person].ravel()
    base, clip = np.divmod(cell, clips)
    eta = np.linspace(-1, 1, baselines)[base] + rng.normal(0, 0.5, people)[who]
    eta += rng.normal(0, 0.5, (baselines, clips))[base, clip]
    won, first = rng.random(size) < 1 / (1 + np.exp(-eta)), rng.random(size) < 0.5
    names = np.array([f"baseline{i:02d}" for i in range(baselines)])[base]
    shown_first, shown_second = np.where(first, "target", names), np.where(first, names, "target")
    when = pd.Timestamp("2026-01-01") + pd.to_timedelta(rng.integers(0, 10**9, size), unit="ms")
    stamp = pd.Series(when).dt.strftime("%Y-%m-%dT%H:%M:%S.%f").str.slice(0, 23) + "Z"
    text = {
        "scene": "scene" + pd.Series(clip % 4).astype(str),
        "motion": "m" + pd.Series(clip // 4).astype(str),
    }
    frame = pd.DataFrame({
        "study_id": "bench", "study_version": "v1", "mode": "simulated",
        "participant": "P" + pd.Series(who).astype(str), "trial_index": trial + 1, "block": 1,
        "trial_kind": "main", "pair_id": pd.Series(cell).astype(str), **text, "target": "target",
        "baseline": names, "first_method": shown_first, "second_method": shown_second,
        "expected_method": "", "repeat_of": "", "layout": "stacked",
        "chosen_position": np.where(won == first, "first", "second"),
        "chosen_method": np.where(won, "target", names),
        "response_time_ms": rng.gamma(5, 2000, size).astype(int),
        "decision_time_ms": rng.gamma(2, 1000, size).astype(int), "plays_first": 1,
        "plays_second": 2, "viewed_first": "proven", "viewed_second": "proven",
        "started_at": stamp, "answered_at": stamp, "late": "false",
    })  # fmt: skip
    frame[list(COLUMN_NAMES)].to_csv(path, index=False)


def measured(responses: Path, bootstraps: int) -> dict[str, float]:
    """CPU seconds and peak memory of the whole estimate, in a process of its own."""
    child = [sys.executable, "-c", _CHILD, str(responses), str(bootstraps)]
    done = subprocess.run(child, check=True, capture_output=True, text=True)
    answer: dict[str, float] = json.loads(done.stdout)
    return answer


def cpu(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of one call, and what it returned."""
    began = time.process_time()
    result = work()
    return time.process_time() - began, result


def against_choix(size: int = 200_000, methods: int = 20) -> tuple[float, float]:
    """Bradley-Terry of raw answers: choix's seconds and ours; the abilities must agree."""
    rng = np.random.default_rng(0)
    truth = np.linspace(-1, 1, methods)
    first = rng.integers(0, methods, size)
    second = (first + rng.integers(1, methods, size)) % methods
    won = rng.random(size) < 1 / (1 + np.exp(truth[second] - truth[first]))
    pairs = np.column_stack([np.where(won, first, second), np.where(won, second, first)]).tolist()
    theirs, wanted = cpu(lambda: choix.ilsr_pairwise(methods, pairs))
    duels = Duels(first, second, won.astype(int), np.ones(size, dtype=int))
    ours, scale = cpu(lambda: fit_scale(duels, methods))
    np.testing.assert_allclose(
        scale.ability - scale.ability.mean(), wanted - wanted.mean(), atol=1e-6
    )
    return theirs, ours


def against_statsmodels(size: int = 200_000) -> tuple[float, float]:
    """Two-way clustered variance of one rate: statsmodels' seconds and ours; they must agree."""
    rng = np.random.default_rng(1)
    people, clips = rng.integers(0, 1000, size), rng.integers(0, 200, size)
    eta = rng.normal(0.3, 0.5, 1000)[people] + rng.normal(0, 0.5, 200)[clips]
    won = rng.random(size) < 1 / (1 + np.exp(-eta))
    groups = np.column_stack([people, clips])

    def oracle() -> float:
        model = sm.GLM(won.astype(float), np.ones((size, 1)), family=sm.families.Binomial())
        fit = model.fit(cov_type="cluster", cov_kwds={"groups": groups})
        return float(np.asarray(fit.cov_params()).item())

    theirs, wanted = cpu(oracle)
    ours, found = cpu(lambda: logit_variance(count_cells(people, clips, won)))
    np.testing.assert_allclose(found[0], wanted, rtol=1e-7)
    return theirs, ours


def crossed_model() -> float:
    """Seconds for the crossed mixed model of 316 x 24 = 7,584 answers."""
    rng = np.random.default_rng(2)
    people, items = np.divmod(np.arange(316 * 24), 24)
    eta = rng.normal(-0.16, 1.37, 316)[people] + rng.normal(0, 1.13, 24)[items]
    cells = count_cells(people, items, rng.random(len(people)) < 1 / (1 + np.exp(-eta)))
    seconds, fit = cpu(lambda: fit_crossed(cells))
    assert fit.converged
    return seconds


def main() -> None:
    """Print a table and the JSON line."""
    with tempfile.TemporaryDirectory() as folder:
        paper, million = Path(folder) / "paper.csv", Path(folder) / "million.csv"
        write_study(paper, people=42, per_person=60, baselines=3, clips=20, seed=1)
        write_study(million, people=5000, per_person=200, baselines=19, clips=100, seed=2)
        small, large = measured(paper, 10_000), measured(million, 2000)
    choix_s, own_scale = against_choix()
    statsmodels_s, own_variance = against_statsmodels()
    figures = {
        "paper_report_cpu_s": small["cpu_s"], "million_cpu_s": large["cpu_s"],
        "million_peak_mib": large["peak_mib"], "glmm_cpu_s": crossed_model(),
        "vs_choix": choix_s / own_scale, "vs_statsmodels": statsmodels_s / own_variance,
    }  # fmt: skip
    print(
        f"paper size, {small['answers']:,} answers, 10,000 bootstraps  {small['cpu_s']:8.2f} CPU s"
    )
    print(f"{large['answers']:,} answers, 20 methods, 2,000 bootstraps {large['cpu_s']:8.2f} CPU s")
    print(f"  peak memory                                     {large['peak_mib']:8.0f} MiB")
    print(f"crossed mixed model, 7,584 answers                {figures['glmm_cpu_s']:8.2f} CPU s")
    print(f"Bradley-Terry, 200,000 raw answers: choix {choix_s:.2f} s, ours {own_scale:.3f} s")
    print(
        f"two-way variance, 200,000 answers: statsmodels {statsmodels_s:.2f} s, ours {own_variance:.3f} s"
    )
    print(json.dumps({name: round(value, 3) for name, value in figures.items()}))


if __name__ == "__main__":
    main()

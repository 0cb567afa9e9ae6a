from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from scipy import stats

from analysis.cells import count_cells
from analysis.estimate import estimate
from analysis.glmm import fit_crossed
from analysis.plausibility import Linked, clustered_slope, link_metrics, split_ceiling
from analysis.preference import comparisons
from analysis.quality import exposure, order_drift, response_times, side_bias, trial_thirds, viewing
from analysis.responses import Responses, read_responses
from analysis.scenes import heterogeneity, per_scene, per_stimulus, scene_covariance
from renderer.catalogue import Catalogue, Clip, write_catalogue

DATA = Path(__file__).resolve().parents[1] / "data" / "analysis"


@pytest.fixture(scope="module")
def study(
    tmp_path_factory: pytest.TempPathFactory, make_study: Callable, make_answers: Callable
) -> Responses:
    rows = make_study({"PAAK": 150, "POSA-T": 170}, participants=12)
    return read_responses(make_answers(tmp_path_factory.mktemp("s") / "r.csv", rows))


def test_scene_covariance_and_test_equal_r_sandwich() -> None:
    # R: vcovCL(glm(won ~ factor(scene) - 1, binomial), ~ participant, type = "HC0", cadjust = TRUE)
    expected = json.loads((DATA / "r_numbers.json").read_text())["scenes"]
    data = pd.read_csv(DATA / "crossed.csv")
    cells = count_cells(
        data.participant.to_numpy(), data.stimulus.to_numpy(), data.won.to_numpy() == 1
    )
    scene = np.arange(16) // 4
    found = scene_covariance(cells, scene[cells.stimulus])
    np.testing.assert_allclose(found, expected["vcov_participant"], atol=1e-9)
    contrast = np.column_stack([-np.ones(3), np.eye(3)])
    shift, spread = (
        contrast @ expected["logit"],
        contrast @ np.array(expected["vcov_participant"]) @ contrast.T,
    )
    f = shift @ np.linalg.solve(spread, shift) / 3
    test = heterogeneity(cells, scene)
    assert test["f"] == pytest.approx(f, rel=1e-6)
    assert test["p"] == pytest.approx(stats.f.sf(f, 3, 23), rel=1e-6)


def test_scenes_partition_the_answers_and_constant_scenes_have_no_test() -> None:
    people, stimuli = np.divmod(np.arange(12 * 20), 20)
    rng = np.random.default_rng(0)
    won = rng.random(240) < 0.6
    cells, scene = count_cells(people, stimuli, won), np.arange(20) // 5
    rows = per_scene(cells, scene, ["a", "b", "c", "d"], 0.95)
    assert sum(row["k"] for row in rows) == won.sum() and sum(row["n"] for row in rows) == 240
    won[stimuli < 5] = True
    test = heterogeneity(count_cells(people, stimuli, won), scene)
    assert test["p"] is None and test["why"] == "a scene with all or no wins"


def test_pooling_draws_stimuli_towards_the_mean(random_cells: Callable) -> None:
    cells = random_cells(4)
    fit = fit_crossed(cells)
    rows = per_stimulus(cells, [str(i) for i in range(cells.stimuli)], fit)
    raw, pooled = (np.array([row[key] for row in rows]) for key in ("rate", "pooled"))
    centre = 1 / (1 + np.exp(-fit.beta[0]))
    assert np.ptp(pooled) < np.ptp(raw)
    far = np.abs(raw - centre) > 0.15
    assert (np.abs(pooled - centre) < np.abs(raw - centre))[far].all()


@pytest.mark.shared
def test_light_field_side_bias_equals_r(shared_data: Path) -> None:
    expected = json.loads((shared_data / "analysis" / "expected.json").read_text())
    data = pd.read_csv(shared_data / "analysis" / "pwcmp_lf.csv")
    cells = count_cells(
        pd.factorize(data.observer)[0], np.zeros(len(data), int), (data.selected == 1).to_numpy()
    )
    assert (int(cells.wins.sum()), int(cells.answers.sum())) == (12479, 26580)
    fit = fit_crossed(
        cells
    )  # R: glmer(first ~ 1 + (1 | observer)); the single stimulus takes no variance
    wanted = expected["lf_sidebias_glmer"]
    assert fit.beta[0] == pytest.approx(wanted["est"], abs=1e-3)
    assert fit.se[0] == pytest.approx(wanted["se"], abs=1e-3)
    assert fit.sd_participant**2 == pytest.approx(wanted["var"], rel=0.01)


def test_side_bias_counts_first_choices_and_flags_one_sided_people(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rows = [
        make_row(participant=f"P{p}", trial_index=i, motion=f"m{i}", won=True,
                 target_first=True if p == 0 else i % 2 == 0)
        for p in range(11) for i in range(12)
    ]  # fmt: skip
    found = side_bias(read_responses(make_answers(tmp_path / "r.csv", rows)))
    assert (found["k"], found["n"]) == (12 + 10 * 6, 132)
    assert (found["participants_with_bias"], found["participants"]) == (1, 11)


def test_thirds_follow_the_order_of_trials_and_drift_is_a_paired_t(study: Responses) -> None:
    third = trial_thirds(study)
    people, trials = study.codes["participant"], study.numbers["trial_index"]
    for person in range(3):
        order = np.argsort(trials[people == person])
        assert third[people == person][order].tolist() == sorted(third[people == person])
    won = study.codes["chosen_method"] == study.codes["target"]
    expected = (
        pd.Series(won.astype(float)).groupby(study.codes["baseline"]).transform("mean").to_numpy()
    )
    frame = pd.DataFrame({"p": people, "t": third, "w": won - expected})
    means = frame.groupby(["p", "t"])["w"].mean().unstack()
    oracle = stats.ttest_rel(means[2], means[0])
    found = order_drift(study, won, expected)
    assert found["change"] == pytest.approx((means[2] - means[0]).mean())
    assert found["p"] == pytest.approx(oracle.pvalue)


def test_exposure_counts_sides_by_hand(study: Responses) -> None:
    found = exposure(study, comparisons(study))
    for name, record in found.items():
        mine = study.equals("baseline", name)
        first = study.codes["first_method"][mine] == study.codes["target"][mine]
        assert record["target_first"] == first.sum() and record["n"] == mine.sum()
        assert (record["min"], record["max"], record["stimuli"]) == (12, 12, 20)


def test_times_and_viewing_count_what_was_measured(study: Responses) -> None:
    times = response_times(study)["response_time"]
    values = study.numbers["response_time_ms"] / 1000
    assert times["median"] == pytest.approx(np.median(values)) and times["measured"] == len(study)
    seen = viewing(study)
    assert seen["unknown"] == seen["n"] == len(study) and seen["plays_per_clip"]["median"] == 1.5
    unmeasured = replace(
        study, numbers=study.numbers | {"response_time_ms": np.full(len(study), np.nan)}
    )
    assert response_times(unmeasured)["response_time"]["median"] is None


def test_the_metric_slope_equals_statsmodels_with_two_way_clusters() -> None:
    rng = np.random.default_rng(5)
    n = 900
    people, item, group = rng.integers(0, 25, n), rng.integers(0, 30, n), rng.integers(0, 3, n)
    x = rng.normal(size=30)[item]
    won = rng.random(n) < 1 / (1 + np.exp(-(0.4 * x + 0.3 * group - 0.2)))
    beta, se = clustered_slope(x, won, group, (people, item))
    design = np.column_stack([x, np.eye(3)[group]])
    model = sm.GLM(won.astype(float), design, family=sm.families.Binomial())
    fits = [
        model.fit(cov_type="cluster", cov_kwds={"groups": groups})
        for groups in (np.column_stack([people, item]), people, item)
    ]
    small = (n - 1) / (n - 4)  # statsmodels' further correction for the number of parameters
    assert beta == pytest.approx(fits[0].params[0], rel=1e-7)
    assert se == pytest.approx(max(fit.bse[0] for fit in fits) / np.sqrt(small), rel=1e-6)


def test_a_metric_that_decides_every_answer_predicts_all_and_a_constant_one_is_refused() -> None:
    rng = np.random.default_rng(1)
    item = np.tile(np.arange(20), 15)
    people = np.repeat(np.arange(15), 20)
    delta = rng.normal(size=20)
    delta[3] = 0.0
    won = delta[item] > 0
    linked = Linked(won, people, item, item, np.zeros(300, int), {
        "decides": delta, "constant": np.full(20, 0.2), "noise": rng.normal(size=20),
        "absent": np.full(20, np.nan),
    })  # fmt: skip
    found = link_metrics(linked, 0.95, split_ceiling(linked))["metrics"]
    assert found["decides"]["predicted"] == 1.0 and found["decides"]["ties"] == 15
    assert found["decides"]["slope_per_sd"] is None  # separated: no finite slope
    assert (
        "same for all pairs" in found["constant"]["why"]
        and found["constant"]["slope_per_sd"] is None
    )
    assert "fewer than 3" in found["absent"]["why"]
    assert abs(found["noise"]["kendall"]) < 0.5
    assert split_ceiling(linked)["share"] == 1.0


def test_scores_are_joined_by_method_scene_and_motion(
    tmp_path: Path, make_study: Callable, make_answers: Callable
) -> None:
    def clip(method: str, scene: int, motion: int, value: float) -> Clip:
        name = f"{method}-{scene}-{motion}"
        return Clip(
            clip_id=name, file=f"{name}.mp4", sha256="0" * 64, frames_sha256="0" * 64,
            poster=f"{name}.png", role="main", method=method, scene=f"scene{scene}",
            motion=f"clip{motion}", views=("a",), tiling="1x1",
            fps=30.0, n_frames=30, duration_s=1.0, width=64, height=64, codec="h264",
            scores={"contact": value}, placement="p",
        )  # fmt: skip

    clips = tuple(
        clip(m, s, c, 0.1 * s + 0.01 * c if m == "PACE" else 0.0)
        for m in ("PACE", "PAAK") for s in range(4) for c in range(5)
    )  # fmt: skip
    folder = tmp_path / "set"
    folder.mkdir()
    write_catalogue(Catalogue("set", "2026-01-01", {}, (), (), (), (), clips), folder)
    path = make_answers(tmp_path / "r.csv", make_study({"PAAK": 150}, participants=12))
    metrics = estimate(path, catalogue=folder, bootstraps=100)["metrics"]
    assert metrics["set_id"] == "set" and metrics["metrics"]["contact"]["items"] == 20
    assert metrics["metrics"]["contact"]["max"] == pytest.approx(0.34)
    assert metrics["metrics"]["contact"]["slope_per_sd"] is not None


def test_metrics_cluster_by_scene_and_motion_and_refuse_what_cannot_be_measured() -> None:
    """Two comparisons share their 6 clips; rounding is no difference; one kind of answer says nothing."""
    rng = np.random.default_rng(2)
    item = np.tile(np.arange(12), 10)
    people = np.repeat(np.arange(10), 12)
    delta = rng.normal(size=12)
    won = rng.random(120) < 0.5
    linked = Linked(won, people, item, item % 6, item // 6, {
        "score": delta, "rounding": 1e-12 * delta,
    })  # fmt: skip
    found = link_metrics(linked, 0.95, split_ceiling(linked))["metrics"]
    assert found["score"]["clusters"] == 6
    wanted = clustered_slope(delta[item] / delta.std(), won, item // 6, (people, item % 6))
    assert wanted is not None and found["score"]["slope_per_sd"] == pytest.approx(wanted[0])
    half = stats.t.ppf(0.975, 5) * wanted[1]
    assert found["score"]["ci"] == pytest.approx([wanted[0] - half, wanted[0] + half])
    assert "same for all pairs" in found["rounding"]["why"]
    always = link_metrics(replace(linked, won=np.ones(120, bool)), 0.95, {})["metrics"]
    assert always["score"]["why"] == "all answers are the same"

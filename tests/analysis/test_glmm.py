from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import integrate, stats

from analysis.cells import Cells, count_cells
from analysis.clustered import logit_variance
from analysis.glmm import fit_crossed, marginal_rate

DATA = Path(__file__).resolve().parents[1] / "data" / "analysis"


@pytest.fixture(scope="module")
def r_numbers() -> dict:
    """Made by `tests/data/make_r_numbers.R` (lme4 with tight tolerances, sandwich)."""
    return json.loads((DATA / "r_numbers.json").read_text())


@pytest.fixture(scope="module")
def crossed() -> pd.DataFrame:
    return pd.read_csv(DATA / "crossed.csv")


def _cells(data: pd.DataFrame, person: str, stimulus: str, side: str) -> tuple[Cells, np.ndarray]:
    groups = data.assign(n=1).groupby([person, stimulus, side], as_index=False)[["won", "n"]].sum()
    people, things = pd.factorize(groups[person])[0], pd.factorize(groups[stimulus])[0]
    cells = Cells(people, things, groups.won.to_numpy(), groups.n.to_numpy())
    return cells, np.column_stack([np.ones(len(groups)), groups[side]]).astype(float)


def _assert_equals_lme4(fit: object, expected: dict, names: tuple[str, str], se: float) -> None:
    assert fit.beta == pytest.approx(np.atleast_1d(expected["beta"]), abs=1e-3)
    assert fit.se == pytest.approx(np.atleast_1d(expected["se"]), abs=se)
    found = (fit.sd_participant**2, fit.sd_stimulus**2)
    wanted = tuple(expected["variance"][name] for name in names)
    assert found == pytest.approx(wanted, rel=0.01, abs=1e-4)
    assert fit.log_likelihood >= expected["log_likelihood"] - 1e-4
    assert fit.converged


def test_a_crossed_model_equals_lme4(crossed: pd.DataFrame, r_numbers: dict) -> None:
    cells, design = _cells(
        crossed.assign(side=crossed["first"] - 0.5), "participant", "stimulus", "side"
    )
    names = ("participant", "stimulus")
    _assert_equals_lme4(fit_crossed(cells), r_numbers["crossed"]["intercept"], names, 1e-3)
    _assert_equals_lme4(fit_crossed(cells, design), r_numbers["crossed"]["side"], names, 1e-3)


def test_clustered_variances_equal_r_sandwich(crossed: pd.DataFrame, r_numbers: dict) -> None:
    cells = count_cells(
        crossed.participant.to_numpy(), crossed.stimulus.to_numpy(), crossed.won.to_numpy() == 1
    )
    _, person, stimulus, both = logit_variance(cells)
    expected = r_numbers["clustered"]
    assert person == pytest.approx(expected["participant"], rel=1e-8)
    assert stimulus == pytest.approx(expected["stimulus"], rel=1e-8)
    assert person + stimulus - both == pytest.approx(expected["two_way"], rel=1e-8)


@pytest.mark.shared
def test_verbal_aggression_equals_lme4_and_glmmtmb(shared_data: Path) -> None:
    expected = json.loads((shared_data / "analysis" / "expected.json").read_text())
    data = pd.read_csv(shared_data / "analysis" / "verbagg.csv")
    cells = count_cells(data.id.to_numpy(), pd.factorize(data.item)[0], (data.r2 == "Y").to_numpy())
    fit = fit_crossed(cells)
    lme4, tmb = expected["verbagg_intercept_laplace"], expected["verbagg_intercept_glmmTMB"]
    wanted = {"beta": lme4["fixef"]["(Intercept)"], "se": lme4["se"]["(Intercept)"],
              "variance": lme4["var"], "log_likelihood": lme4["loglik"]}  # fmt: skip
    _assert_equals_lme4(fit, wanted, ("id", "item"), 1e-3)
    assert fit.se[0] == pytest.approx(tmb["se"], abs=1e-4)
    assert fit.log_likelihood == pytest.approx(tmb["loglik"], abs=1e-4)


@pytest.mark.shared
def test_tone_mapping_models_equal_lme4_also_at_zero_variance(
    shared_data: Path, r_numbers: dict
) -> None:
    expected = json.loads((shared_data / "analysis" / "expected.json").read_text())
    data = pd.read_csv(shared_data / "analysis" / "pwcmp_tmo.csv")
    for method, tight in r_numbers["tmo"].items():
        mine = data[(data.condition_A == method) | (data.condition_B == method)]
        is_a = mine.condition_A == method
        mine = mine.assign(
            side=np.where(is_a, 0.5, -0.5),
            won=np.where(is_a, mine.is_A_selected, 1 - mine.is_A_selected),
        )
        fit = fit_crossed(*_cells(mine, "observer", "scene", "side"))
        _assert_equals_lme4(fit, tight, ("observer", "scene"), 1e-3)
        loose = expected[f"tmo_{method}_vs_rest"]  # lme4's default tolerance stops a little early
        wanted = {"beta": list(loose["fixef"].values()), "se": list(loose["se"].values()),
                  "variance": loose["var"], "log_likelihood": loose["loglik"]}  # fmt: skip
        _assert_equals_lme4(fit, wanted, ("observer", "scene"), 5e-3)


def test_one_random_intercept_equals_numerical_laplace() -> None:
    """One stimulus: the Laplace integrand of each participant is one-dimensional, done here by hand."""
    wins, answers, sd, beta = np.array([3, 6]), np.array([10, 8]), 0.8, -0.1

    def laplace(k: int, n: int) -> float:
        u = 0.0
        for _ in range(50):
            p = 1 / (1 + math.exp(-(beta + sd * u)))
            u += (sd * (k - n * p) - u) / (1 + sd**2 * n * p * (1 - p))
        eta, p = beta + sd * u, 1 / (1 + math.exp(-(beta + sd * u)))
        return (
            k * eta
            - n * math.log1p(math.exp(eta))
            - u * u / 2
            - math.log(1 + sd**2 * n * p * (1 - p)) / 2
        )

    from analysis.glmm import _Laplace

    model = _Laplace(Cells(np.arange(2), np.zeros(2, int), wins, answers), np.ones((2, 1)))
    expected = -2 * sum(laplace(int(k), int(n)) for k, n in zip(wins, answers, strict=True))
    assert model.deviance(np.array([beta, sd, 0.0])) == pytest.approx(expected, abs=1e-9)


def test_no_clustering_gives_zero_variance_and_the_plain_rate() -> None:
    people, stimuli = np.divmod(np.arange(400), 20)
    cells = count_cells(people, stimuli, (people + stimuli) % 2 == 0)
    fit = fit_crossed(cells)
    assert (fit.sd_participant, fit.sd_stimulus) == (0.0, 0.0)
    assert fit.beta[0] == pytest.approx(0.0, abs=1e-6)
    assert fit.se[0] == pytest.approx(math.sqrt(4 / 400), rel=1e-4)


def test_which_factor_is_eliminated_changes_nothing(random_cells: Callable) -> None:
    cells = random_cells(2, people=9, stimuli=14)
    turned = Cells(cells.stimulus, cells.participant, cells.wins, cells.answers)
    one, other = fit_crossed(cells), fit_crossed(turned)
    assert one.beta == pytest.approx(other.beta, abs=1e-5)
    assert one.sd_participant == pytest.approx(other.sd_stimulus, abs=1e-4)
    assert one.mode_stimulus == pytest.approx(other.mode_participant, abs=1e-4)


@pytest.mark.parametrize(("logit", "variance"), [(0.0, 0.5), (0.7, 0.5), (-2.0, 2.0), (1.0, 0.0)])
def test_the_marginal_rate_is_the_integral(logit: float, variance: float) -> None:
    sd = math.sqrt(variance) or 1e-9
    exact, _ = integrate.quad(
        lambda x: stats.norm.pdf(x) / (1 + math.exp(-(logit + sd * x))), -12, 12
    )
    assert marginal_rate(logit, variance) == pytest.approx(exact, abs=1e-7)

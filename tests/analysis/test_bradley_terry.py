from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.bradley_terry import (
    Duels,
    centred,
    circular_triads,
    clustered_covariance,
    describe_graph,
    fit_scale,
    quasi_variances,
    two_way_covariances,
    with_half_answers,
)
from analysis.cells import Cells
from analysis.clustered import clustered_rate


@pytest.fixture(scope="module")
def expected(shared_data: Path) -> dict:
    return json.loads((shared_data / "analysis" / "expected.json").read_text())


def _tone_mapping(shared_data: Path) -> tuple[Duels, np.ndarray, list[str]]:
    data = pd.read_csv(shared_data / "analysis" / "pwcmp_tmo.csv")
    names = sorted(set(data.condition_A) | set(data.condition_B))  # ferwerda96 is the reference
    first, second = (data[c].map(names.index).to_numpy() for c in ("condition_A", "condition_B"))
    one = np.ones(len(data), dtype=int)
    return (
        Duels(first, second, data.is_A_selected.to_numpy(), one),
        pd.factorize(data.observer)[0],
        names,
    )


@pytest.mark.shared
def test_tone_mapping_scale_equals_bradleyterry2(shared_data: Path, expected: dict) -> None:
    duels, observers, _ = _tone_mapping(shared_data)
    scale = fit_scale(duels, 7)
    wanted = expected["tmo_bt"]
    assert scale.ability[1:] == pytest.approx(list(wanted["coef"].values()), abs=1e-6)
    assert np.sqrt(np.diag(scale.covariance))[1:] == pytest.approx(
        list(wanted["se"].values()), abs=1e-6
    )
    assert scale.log_likelihood == pytest.approx(wanted["loglik"], abs=1e-8)
    robust = np.sqrt(np.diag(clustered_covariance(duels, scale, observers)))[1:]
    assert robust == pytest.approx(
        list(expected["tmo_cluster_CR1"]["vcovCL_HC1"].values()), rel=1e-4
    )
    quasi = [row["quasiVar"] for row in expected["tmo_bt_qv"]]
    assert quasi_variances(scale.covariance) == pytest.approx(quasi, rel=1e-4)


@pytest.mark.shared
def test_order_effect_and_thurstone_equal_r(shared_data: Path, expected: dict) -> None:
    duels, _, _ = _tone_mapping(shared_data)
    scale = fit_scale(duels, 7, order=True)
    *abilities, order = expected["tmo_bt_order"]["coef"].values()
    assert scale.ability[1:] == pytest.approx(abilities, abs=1e-6)
    assert scale.order == pytest.approx(order, abs=1e-6)
    assert scale.order_se == pytest.approx(expected["tmo_bt_order"]["se"]["first"], abs=1e-6)
    probit = fit_scale(duels, 7, link="probit")
    wanted = expected["tmo_thurstone_probit"]
    assert probit.ability[1:] == pytest.approx(list(wanted["coef"].values()), abs=1e-5)
    assert np.sqrt(np.diag(probit.covariance))[1:] == pytest.approx(
        list(wanted["se"].values()), abs=1e-5
    )


@pytest.mark.shared
def test_a_25_method_light_field_scale_equals_bradleyterry2(
    shared_data: Path, expected: dict
) -> None:
    data = pd.read_csv(shared_data / "analysis" / "pwcmp_lf.csv")
    data = data[data.scene == "Car"]
    names = [data[f"dist_type{i}"] + "_" + data[f"dist_level{i}"].astype(str) for i in (1, 2)]
    wanted = expected["lf_car_bt"]
    levels = sorted(set(names[0]) | set(names[1]))
    (reference,) = set(levels) - {name.removeprefix("..") for name in wanted["coef"]}
    levels = [reference, *[name.removeprefix("..") for name in wanted["coef"]]]
    first, second = (column.map(levels.index).to_numpy() for column in names)
    duels = Duels(
        first, second, (data.selected == 1).to_numpy().astype(int), np.ones(len(data), int)
    )
    scale = fit_scale(duels, 25)
    assert scale.ability[1:] == pytest.approx(list(wanted["coef"].values()), abs=1e-6)
    assert np.sqrt(np.diag(scale.covariance))[1:] == pytest.approx(
        list(wanted["se"].values()), rel=1e-4
    )
    assert scale.log_likelihood == pytest.approx(wanted["loglik"], abs=1e-6)


@pytest.mark.shared
def test_sharpened_images_equal_sureal_within_each_content(
    shared_data: Path, expected: dict
) -> None:
    """sureal fixes one sum over all contents, never compared; differences within are free of it."""
    data = pd.read_csv(shared_data / "analysis" / "krasula_sharpened_pc.csv")
    one = np.ones(len(data), dtype=int)
    duels = Duels(data.asset.to_numpy(), data.opponent.to_numpy(), one, one)
    assert describe_graph(duels, 40).components == 5
    for content in range(5):
        mine = data[data.content_id == content]
        first, second = mine.asset.to_numpy() - 8 * content, mine.opponent.to_numpy() - 8 * content
        scale = fit_scale(Duels(first, second, one[: len(mine)], one[: len(mine)]), 8)
        q = np.array(expected["krasula_sureal"]["q"][8 * content : 8 * content + 8])
        assert scale.ability - scale.ability.mean() == pytest.approx(q - q.mean(), abs=1e-5)


def test_two_methods_give_the_log_odds() -> None:
    duels = Duels(np.array([1]), np.array([0]), np.array([30]), np.array([40]))
    scale = fit_scale(duels, 2)
    assert scale.ability == pytest.approx([0, np.log(3)])
    assert scale.covariance[1, 1] == pytest.approx(40 / (30 * 10))
    middle, se = centred(scale, scale.covariance)
    assert middle == pytest.approx([-np.log(3) / 2, np.log(3) / 2])
    assert se == pytest.approx([np.sqrt(40 / 300) / 2] * 2)


def test_a_star_is_saturated_and_a_circle_is_not() -> None:
    one = np.ones(3, dtype=int)
    star = Duels(np.zeros(3, int), np.array([1, 2, 3]), 5 * one, 9 * one)
    assert describe_graph(star, 4).lack_of_fit_df == 0
    circle = Duels(np.array([0, 1, 2]), np.array([1, 2, 0]), 5 * one, 9 * one)
    assert describe_graph(circle, 3).lack_of_fit_df == 1
    assert circular_triads(circle, 3) == (1, 1)
    line = Duels(np.array([0, 1, 0]), np.array([1, 2, 2]), 5 * one, 9 * one)
    assert circular_triads(line, 3) == (0, 1)


def test_separation_and_disconnection_are_found_and_half_answers_make_a_finite_scale() -> None:
    duels = Duels(
        np.array([0, 1, 0]), np.array([1, 2, 2]), np.array([9, 4, 9]), np.array([9, 9, 9])
    )
    graph = describe_graph(duels, 3)
    assert graph.separated and graph.components == 1
    with pytest.raises((ValueError, np.linalg.LinAlgError)):
        fit_scale(duels, 3)
    finite = fit_scale(with_half_answers(duels), 3)
    assert np.isfinite(finite.ability).all() and finite.ability[1:].max() < 0
    apart = Duels(np.array([0, 2]), np.array([1, 3]), np.array([4, 4]), np.array([9, 9]))
    assert describe_graph(apart, 4).components == 2


def test_clusters_of_one_answer_give_nearly_the_independent_covariance() -> None:
    rng = np.random.default_rng(3)
    first = rng.integers(0, 4, 4000)
    second = (first + rng.integers(1, 4, 4000)) % 4
    truth = np.array([0, 0.5, -0.5, 1.0])
    won = rng.random(4000) < 1 / (1 + np.exp(truth[second] - truth[first]))
    duels = Duels(first, second, won.astype(int), np.ones(4000, int))
    scale = fit_scale(duels, 4)
    assert scale.ability == pytest.approx(truth, abs=0.2)
    alone = clustered_covariance(duels, scale, np.arange(4000))
    assert np.diag(alone)[1:] == pytest.approx(np.diag(scale.covariance)[1:], rel=0.1)
    for covariance in two_way_covariances(duels, scale, np.arange(4000), np.arange(4000)):
        np.testing.assert_allclose(covariance, alone, atol=1e-12)


def test_a_pair_has_the_same_error_on_the_scale_as_in_the_preference_table() -> None:
    """Stimuli and participants whose two-way sum falls below its parts included."""
    rng = np.random.default_rng(8)
    people, stimuli = (part.ravel() for part in np.indices((16, 4)))
    for _ in range(20):
        wins = rng.binomial(4, 0.45, 64)
        duels = Duels(np.zeros(64, int), np.ones(64, int), wins, np.full(64, 4))
        scale = fit_scale(duels, 2)
        se = centred(scale, *two_way_covariances(duels, scale, people, stimuli))[1]
        rate = clustered_rate(Cells(people, stimuli, wins, np.full(64, 4)))
        assert rate.se_logit is not None
        assert 2 * se == pytest.approx([rate.se_logit] * 2, rel=1e-9)

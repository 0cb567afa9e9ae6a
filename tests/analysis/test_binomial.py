from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

from analysis import binomial


@pytest.mark.shared
def test_intervals_and_tests_equal_r(shared_data: Path) -> None:
    # R: prop.test(k, n, correct = FALSE), binom.test(k, n)
    expected = json.loads((shared_data / "analysis" / "expected.json").read_text())
    for case in [*expected["binom"], expected["tmo_sidebias"], expected["lf_sidebias"]]:
        k, n = case["k"], case["n"]
        assert binomial.wilson(k, n) == pytest.approx(case["wilson"], abs=1e-9)
        assert binomial.exact(k, n) == pytest.approx(case["cp"], abs=1e-9)
        assert binomial.exact_p(k, n) == pytest.approx(case["p_exact"], rel=1e-8)
    paper = [binomial.exact_p(k, 840) for k in (570, 682, 498)]
    assert binomial.holm(paper) == pytest.approx(expected["holm3"], rel=1e-9)
    demo = expected["holm_demo"]
    assert binomial.holm(demo["p"]) == pytest.approx(demo["holm"], abs=1e-12)
    assert binomial.benjamini_hochberg(demo["p"]) == pytest.approx(demo["bh"], abs=1e-12)


@given(st.integers(1, 400), st.data())
def test_intervals_equal_statsmodels_and_scipy(n: int, data: st.DataObject) -> None:
    k = data.draw(st.integers(0, n))
    assert binomial.wilson(k, n) == pytest.approx(
        proportion_confint(k, n, method="wilson"), abs=1e-9
    )
    assert binomial.exact(k, n) == pytest.approx(proportion_confint(k, n, method="beta"), abs=1e-9)
    assert binomial.exact_p(k, n) == pytest.approx(stats.binomtest(k, n).pvalue, rel=1e-9)
    low, high = binomial.wilson(k, n)
    assert 0 <= low <= k / n <= high <= 1


@given(st.lists(st.floats(0, 1), min_size=1, max_size=12))
def test_adjusted_p_values_equal_statsmodels(p: list[float]) -> None:
    assert binomial.holm(p) == pytest.approx(multipletests(p, method="holm")[1], abs=1e-12)
    assert binomial.benjamini_hochberg(p) == pytest.approx(
        multipletests(p, method="fdr_bh")[1], abs=1e-12
    )


def test_effect_sizes_have_their_closed_forms() -> None:
    assert binomial.jod(0.75) == pytest.approx(1.0)
    assert binomial.jod(0.5) == pytest.approx(0.0)
    assert binomial.jod(1.0) is None
    assert binomial.cohen_h(1.0) == pytest.approx(1.5707963267948966)
    assert binomial.cohen_h(0.5) == pytest.approx(0.0)
    assert binomial.one_sided_exact(1) == pytest.approx(0.05)
    assert binomial.one_sided_exact(59) > 0.95 > binomial.one_sided_exact(58)

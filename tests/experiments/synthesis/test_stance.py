from __future__ import annotations

import pytest
import torch

from experiments.synthesis.stance import find_stances, skating


def stepping() -> torch.Tensor:
    """Left foot stands for 5 frames while the right swings 1 m, then the right for 5 frames."""
    ankles = torch.zeros(10, 2, 3, dtype=torch.float64)
    swing = torch.linspace(0, 1, 6, dtype=torch.float64)
    ankles[:6, 1, 0] = swing
    ankles[5:, 1, 0] = 1.0
    ankles[5:, 0, 0] = torch.linspace(0, 1.2, 5, dtype=torch.float64)
    return ankles


def test_the_slower_ankle_stands() -> None:
    standing = find_stances(stepping()).standing
    assert standing[:5].tolist() == [[True, False]] * 5
    assert standing[5:].tolist() == [[False, True]] * 5


def test_nobody_stands_where_both_ankles_are_about_equally_fast() -> None:
    ankles = stepping()
    ankles[:, 0] = ankles[:, 1] * 0.8
    assert not find_stances(ankles).standing.any()


def test_feet_that_stay_where_they_stand_cost_nothing_but_swing_height() -> None:
    ankles, toes = stepping(), torch.zeros(10, 2, 3, dtype=torch.float64)
    stances = find_stances(ankles)
    assert float(skating(ankles, toes, stances, 0.0)) == pytest.approx(0.0, abs=1e-12)
    toes[..., 2] = 0.2
    assert float(skating(ankles, toes, stances, 0.0)) == pytest.approx(0.05 * 0.2)
    assert float(skating(ankles, toes, stances, 0.3)) == pytest.approx(0.0, abs=1e-12)


def test_a_sliding_stance_costs_its_variance() -> None:
    ankles, toes = stepping(), torch.zeros(10, 2, 3, dtype=torch.float64)
    stances = find_stances(ankles)
    ankles[:5, 0, 1] = torch.tensor([0.0, 0.1, 0.2, 0.3, 0.4])
    # Five of ten standing frames, variance 0.02 m² about their own mean.
    assert float(skating(ankles, toes, stances, 0.0)) == pytest.approx(0.02 * 5 / 10)


def test_two_stances_of_one_foot_have_two_means() -> None:
    ankles = torch.cat([stepping(), stepping() + torch.tensor([2.0, 0.0, 0.0])])
    stances = find_stances(ankles)
    toes = torch.zeros_like(ankles)
    assert float(skating(ankles, toes, stances, 0.0)) < 0.02
    sums = stances.average.sum(-1).T
    assert torch.allclose(sums[stances.standing], torch.ones(1, dtype=sums.dtype))
    assert (sums[~stances.standing] == 0).all()

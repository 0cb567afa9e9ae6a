from __future__ import annotations

import numpy as np
import pytest

from experiments.placement.rigid import clip_floor


def test_a_sleeper_whose_feet_soon_leave_the_floor_still_has_it() -> None:
    lowest = np.where(np.arange(120) < 18, 0.001, 0.46)
    assert clip_floor(lowest) == pytest.approx(0.001)


def test_single_frames_below_the_floor_do_not_lower_it() -> None:
    lowest = np.full(120, 0.002)
    lowest[[10, 50, 51, 90]] = -0.05
    assert clip_floor(lowest) == pytest.approx(0.002)

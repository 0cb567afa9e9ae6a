"""Terms of ours that keep an altered motion steady: no sliding feet, no trembling (`pace_plus`)."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64, Integer
from torch import Tensor

from experiments.body.model import BodyModel
from experiments.placement.problem import Problem
from experiments.placement.rigid import move
from experiments.placement.settings import PlacementSettings

STANCE_HEIGHT_M = 0.015
"""Sole vertices lower than this above the clip's floor stand on it; as in the score of sliding."""


class Steadiness:
    """The extra terms of E_alt for one problem; none where the settings give them no weight."""

    def __init__(self, problem: Problem, weights: PlacementSettings) -> None:
        self._problem, self._weights = problem, weights
        columns, foot = sole_columns(problem.body, problem.vertex_ids)
        height = problem.vertices[:, columns, 2].double().cpu().numpy()
        shares = stance_shares(height, foot, problem.floor)
        self._columns = torch.as_tensor(columns, device=problem.vertices.device)
        self._stance = torch.as_tensor(shares).to(problem.vertices)

    def terms(
        self,
        bodies: Float[Tensor, "T V 3"],
        placed: Float[Tensor, "4"],
        delta: Float[Tensor, "T 22 3"],
        shift: Float[Tensor, "T 3"],
    ) -> dict[str, Float[Tensor, ""]]:
        """`slide` and `bend`, weighted and summed over frames with k; `bodies` are those placed."""
        problem, weights = self._problem, self._weights
        found: dict[str, Float[Tensor, ""]] = {}
        if weights.slide_weight:
            original = move(
                problem.vertices[:, self._columns], placed[0], placed[1:], problem.centre
            )
            error = bodies[:, self._columns] - original
            slide = slide_loss(error, self._stance, problem.step_scale)
            found["slide"] = weights.slide_weight * (slide @ problem.stiffness)
        if weights.bend_weight:
            pose = bend_loss(delta, problem.step_scale)
            root = weights.lambda_tau * bend_loss(shift, problem.step_scale)
            found["bend"] = weights.bend_weight * ((pose + root) @ problem.stiffness)
        return found


def slide_loss(
    error: Float[Tensor, "T S 3"],
    stance: Float[Tensor, "T S"],
    step_scale: Float[Tensor, " T"],
) -> Float[Tensor, " T"]:
    """Sliding that the alteration adds: squared change of horizontal steps of standing soles, m².

    `error` is where the altered sole vertices are minus where the unaltered ones would be, so a
    foot that slid in the recording may go on sliding. `stance` is the share that a vertex has in
    its foot while both this and the frame before stand, else 0; see `stance_shares`.
    """
    steps = torch.diff(error[..., :2], dim=0, prepend=error[:1, :, :2])
    return ((steps * step_scale[:, None, None]).square().sum(-1) * stance).sum(-1)


def bend_loss(
    series: Float[Tensor, "T *S"], step_scale: Float[Tensor, " T"]
) -> Float[Tensor, " T"]:
    """Squared second difference along time of an alteration, summed over its coordinates.

    It costs a kink, not a slope: limbs that touch something in single frames tremble without it.
    The first and the last frame have no second difference.
    """
    steps = torch.diff(series, dim=0) * step_scale[1:].reshape(-1, *[1] * (series.ndim - 1))
    bends = torch.diff(steps, dim=0).flatten(1).square().sum(-1)
    return torch.nn.functional.pad(bends, (1, 1))


def stance_shares(
    sole_height: Float[np.ndarray, "T S"], foot: Int64[np.ndarray, " S"], floor: float
) -> Float[np.ndarray, "T S"]:
    """Share of every sole vertex in its foot in frames that it stands in, the one before included.

    Heights in metres, `foot` 0 or 1 a column. The shares of a foot that stands on all its sole
    sum to 1, so that the number of vertices does not matter.
    """
    low: Bool[np.ndarray, "T S"] = sole_height < floor + STANCE_HEIGHT_M
    standing = low & np.concatenate([np.zeros_like(low[:1]), low[:-1]])
    count = np.bincount(foot, minlength=2)[foot]
    shares: Float[np.ndarray, "T S"] = standing / count
    return shares


def sole_columns(
    body: BodyModel, vertex_ids: Integer[np.ndarray, " V"]
) -> tuple[Int64[np.ndarray, " S"], Int64[np.ndarray, " S"]]:
    """Columns of a vertex list that are sole vertices, and the foot (0 left, 1 right) of each."""
    feet = [
        np.flatnonzero(np.isin(vertex_ids, body.regions[f"{side}_sole"]))
        for side in ("left", "right")
    ]
    return np.concatenate(feet), np.repeat(np.arange(2), [len(part) for part in feet])

"""Variables of the alteration: a change of basis along time that makes E_alt nearly |u|²/2.

E_alt couples neighbouring frames so stiffly (condition number 1 + 4 lambda_mot / lambda_pose for
poses, about T² for translations) that L-BFGS on one variable a frame hardly moves the pose at all.
The objective stays as printed; only the variables change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from experiments.placement.settings import PlacementSettings

_FLOOR = 1e-3
"""Added to the diagonal: keeps the factor finite where all weights vanish."""


@dataclass(frozen=True)
class AlterationBasis:
    """delta = pose @ u_pose and shift = translation @ u_translation, each along time.

    Row 0 of `translation` is zero: the shift is relative to frame 0, whose place the rigid
    translation decides.
    """

    pose: Float[np.ndarray, "T M"]
    translation: Float[np.ndarray, "T N"]


def alteration_basis(
    k: Float[np.ndarray, " T"], step_scale: Float[np.ndarray, " T"], settings: PlacementSettings
) -> AlterationBasis:
    """The basis that `settings.parameterisation` names, for frame weights k."""
    pose_weight, step_weight = settings.lambda_pose, settings.lambda_mot
    shift_weight = step_weight * settings.lambda_tau
    if settings.parameterisation == "raw":
        return AlterationBasis(np.eye(len(k)), np.eye(len(k))[:, 1:])
    if settings.parameterisation == "dct":
        n_waves = max(2, round(settings.dct_per_frame * len(k)))
        waves = _cosines(len(k), n_waves, pose_weight, step_weight)
        ramps = _cosines(len(k), n_waves, 0.0, shift_weight)
        return AlterationBasis(waves, (ramps - ramps[:1])[:, 1:])
    pose = quadratic_form(k, step_scale, pose_weight, step_weight)
    shift = quadratic_form(k, step_scale, 0.0, shift_weight)[1:, 1:]
    zero_row = np.zeros((1, len(k) - 1))
    return AlterationBasis(_whiten(pose), np.concatenate([zero_row, _whiten(shift)]))


def quadratic_form(
    k: Float[np.ndarray, " T"], step_scale: Float[np.ndarray, " T"], value: float, step: float
) -> Float[np.ndarray, "T T"]:
    """A with delta^T A delta = sum_i k_i (value delta_i² + step (scaled difference)_i²)."""
    difference = (np.eye(len(k)) - np.eye(len(k), k=-1)) * step_scale[:, None]
    difference[0] = 0.0
    form: Float[np.ndarray, "T T"] = value * np.diag(k) + step * difference.T @ (
        k[:, None] * difference
    )
    return form


def _whiten(form: Float[np.ndarray, "T T"]) -> Float[np.ndarray, "T T"]:
    """L^-T with 2A + floor = L L^T, so that delta = L^-T u costs |u|²/2."""
    factor = np.linalg.cholesky(2.0 * form + _FLOOR * np.eye(len(form)))
    return np.linalg.inv(factor).T.copy()


def _cosines(n_frames: int, n_waves: int, value: float, step: float) -> Float[np.ndarray, "T M"]:
    """The first cosine vectors, each scaled by the energy that its frequency costs at k = 1."""
    wave = np.arange(n_waves)
    frame = np.arange(n_frames)[:, None]
    vectors = np.cos(np.pi * wave * (frame + 0.5) / n_frames) * np.sqrt(2.0 / n_frames)
    vectors[:, 0] /= np.sqrt(2.0)
    roughness = (2.0 * np.sin(np.pi * wave / (2 * n_frames))) ** 2
    scaled: Float[np.ndarray, "T M"] = vectors / np.sqrt(2.0 * (value + step * roughness) + _FLOOR)
    return scaled

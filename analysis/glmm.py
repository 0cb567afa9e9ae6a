"""Logistic model with crossed random intercepts of participants and stimuli, Laplace approximation.

logit P(win) = x'b + u_participant + v_stimulus, u ~ N(0, s_p^2), v ~ N(0, s_s^2). The likelihood is
the one of lme4's `glmer(..., nAGQ = 1)`: random effects at their conditional mode, fixed effects and
standard deviations maximised outside (Bates, Maechler, Bolker, Walker 2015). The Hessian of the
random effects is diagonal but for the participant x stimulus block, so the larger factor is
eliminated by its Schur complement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy import linalg, optimize, special, stats

from analysis.cells import Cells

MAX_BLOCK = 4_000_000
"""Largest participants x stimuli block that is fitted (32 MB a matrix)."""
MAX_CELLS = 20_000
"""Most distinct (participant, stimulus) cells that are fitted; beyond, the clustered rate stands alone."""


@dataclass(frozen=True)
class MixedFit:
    """Fitted crossed model."""

    beta: Float[np.ndarray, "B"]
    """Fixed effects, log odds."""
    se: Float[np.ndarray, "B"]
    """Their standard errors, from the Hessian over all parameters as in lme4; infinite without a maximum."""
    sd_participant: float
    sd_stimulus: float
    log_likelihood: float
    mode_participant: Float[np.ndarray, "P"]
    """Conditional modes of the participants' intercepts."""
    mode_stimulus: Float[np.ndarray, "S"]
    """Conditional modes of the stimuli's intercepts (partial pooling)."""
    converged: bool


def fit_crossed(cells: Cells, design: Float[np.ndarray, "C B"] | None = None) -> MixedFit:
    """Maximum likelihood fit; `design` holds the fixed effects of each cell (default: intercept).

    Cells may repeat a (participant, stimulus) with different fixed effects. Standard deviations may
    end at zero, then the standard errors are those of the model without that factor.
    """
    model = _Laplace(cells, np.ones((len(cells.wins), 1)) if design is None else design)
    start = np.concatenate([model.pooled_fixed_effects(), [0.5, 0.5]])
    low = np.r_[np.full(model.fixed, -np.inf), 0.0, 0.0]
    bounds = optimize.Bounds(low, np.r_[np.full(model.fixed, np.inf), 20.0, 20.0])
    options: Any = {"ftol": 1e-13, "gtol": 1e-6, "maxiter": 200}
    rough = optimize.minimize(
        model.deviance, start, method="L-BFGS-B", bounds=bounds, options=options
    )
    best = _polish(model, np.asarray(rough.x))
    deviance = model.deviance(best)
    gradient, covariance = _curvature(model, best)
    beta, spread = best[: model.fixed], best[model.fixed :]
    first, second = (model.modes[0], model.modes[1])
    if model.swapped:
        spread, first, second = spread[::-1], second, first
    spreads = np.diag(covariance)[: model.fixed]
    definite = bool((spreads > 0).all())
    return MixedFit(
        beta=beta, se=np.sqrt(np.where(spreads > 0, spreads, np.inf)), sd_participant=float(spread[0]),
        sd_stimulus=float(spread[1]), log_likelihood=-deviance / 2,
        mode_participant=spread[0] * first, mode_stimulus=spread[1] * second,
        converged=definite and bool(np.abs(gradient).max() < 0.05),
    )  # fmt: skip


def marginal_rate(logit: float, variance: float) -> float:
    """Mean of expit(logit + N(0, variance)): the rate over people and stimuli (Gauss-Hermite)."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(61)
    values = special.expit(logit + math.sqrt(variance) * nodes)
    return float(weights @ values / weights.sum())


@dataclass(frozen=True)
class MixedRate:
    """The crossed model's answer to the question of the preference table."""

    rate: float
    """Averaged over participants and stimuli."""
    ci: tuple[float, float]
    """Wald interval of the intercept, averaged with the estimated variances (plug-in)."""
    logit: float
    """Log odds for the typical participant and stimulus."""
    se: float
    p: float
    """Two-sided Wald test of even odds."""
    sd_participant: float
    sd_stimulus: float
    converged: bool


def mixed_rate(fit: MixedFit, level: float = 0.95) -> MixedRate:
    """Preference rate of an intercept-only fit, with its interval."""
    logit, se = float(fit.beta[0]), float(fit.se[0])
    half = float(stats.norm.ppf(0.5 + level / 2)) * se
    variance = fit.sd_participant**2 + fit.sd_stimulus**2
    low, middle, high = (marginal_rate(logit + d, variance) for d in (-half, 0.0, half))
    p = float(2 * stats.norm.sf(abs(logit) / se))
    return MixedRate(
        middle, (low, high), logit, se, p, fit.sd_participant, fit.sd_stimulus, fit.converged
    )


def can_fit(cells: Cells) -> str:
    """Why the crossed model is not fitted to these cells; empty if it can be."""
    wins, answers = int(cells.wins.sum()), int(cells.answers.sum())
    if wins in (0, answers):
        return "all answers agree"
    if min(cells.participants, cells.stimuli) < 3:
        return "fewer than 3 participants or stimuli"
    if cells.participants * cells.stimuli > MAX_BLOCK or len(cells.wins) > MAX_CELLS:
        return f"more than {MAX_CELLS:,} cells"
    return ""


class _Laplace:
    """Deviance of the crossed model as a function of (beta, sd of the larger, sd of the smaller factor)."""

    def __init__(self, cells: Cells, design: Float[np.ndarray, "C B"]) -> None:
        self.swapped = cells.stimuli > cells.participants
        big, small = cells.participant, cells.stimulus
        self.big, self.small = (small, big) if self.swapped else (big, small)
        self.sizes = (int(self.big.max()) + 1, int(self.small.max()) + 1)
        self.block = self.big.astype(np.int64) * self.sizes[1] + self.small
        self.k, self.n = cells.wins.astype(float), cells.answers.astype(float)
        self.design, self.fixed = design, design.shape[1]
        self.modes = (np.zeros(self.sizes[0]), np.zeros(self.sizes[1]))

    def pooled_fixed_effects(self) -> Float[np.ndarray, "B"]:
        """Logistic regression without random effects, a few Newton steps from zero."""
        beta = np.zeros(self.fixed)
        for _ in range(12):
            rate = special.expit(self.design @ beta)
            weight = self.n * rate * (1 - rate) + 1e-9
            step = self.design.T @ (self.k - self.n * rate)
            hessian = (self.design.T * weight) @ self.design + 1e-6 * np.eye(self.fixed)
            beta = beta + linalg.solve(hessian, step, assume_a="pos")
        return np.asarray(beta)

    def deviance(self, parameters: Float[np.ndarray, "Q"]) -> float:
        """-2 log likelihood (Laplace); keeps the modes as the start of the next call."""
        offset = self.design @ parameters[: self.fixed]
        sds = (float(parameters[-2]), float(parameters[-1]))
        u, v, value = *self.modes, -math.inf
        value, eta = self._penalised(offset, sds, u, v)
        for _ in range(60):
            step_u, step_v, _ = self._newton(eta, sds, u, v)
            scale = 1.0
            while True:
                new = u + scale * step_u, v + scale * step_v
                new_value, new_eta = self._penalised(offset, sds, *new)
                if new_value >= value - 1e-10 or scale < 1e-4:
                    break
                scale /= 2
            gain, (u, v), value, eta = new_value - value, new, new_value, new_eta
            if gain < 1e-11 * (1 + abs(value)):
                break
        self.modes = (u, v)
        log_det = self._newton(eta, sds, u, v)[2]
        return float(-2 * value + log_det)

    def _penalised(
        self, offset: Float[np.ndarray, "C"], sds: tuple[float, float],
        u: Float[np.ndarray, "P"], v: Float[np.ndarray, "S"],
    ) -> tuple[float, Float[np.ndarray, "C"]]:  # fmt: skip
        eta = offset + sds[0] * u[self.big] + sds[1] * v[self.small]
        fit = self.k @ eta - self.n @ np.logaddexp(0, eta)
        return float(fit - (u @ u + v @ v) / 2), eta

    def _newton(
        self, eta: Float[np.ndarray, "C"], sds: tuple[float, float],
        u: Float[np.ndarray, "P"], v: Float[np.ndarray, "S"],
    ) -> tuple[Float[np.ndarray, "P"], Float[np.ndarray, "S"], float]:  # fmt: skip
        """Newton step of the spherical random effects and log |Hessian|, by Schur complement."""
        rate = special.expit(eta)
        residual, weight = self.k - self.n * rate, self.n * rate * (1 - rate)
        (rows, columns), (a, b) = self.sizes, sds
        grad_u = a * np.bincount(self.big, residual, rows) - u
        grad_v = b * np.bincount(self.small, residual, columns) - v
        diagonal = a * a * np.bincount(self.big, weight, rows) + 1
        other = b * b * np.bincount(self.small, weight, columns) + 1
        cross = a * b * np.bincount(self.block, weight, rows * columns).reshape(rows, columns)
        scaled = cross / diagonal[:, None]
        factor = linalg.cho_factor(np.diag(other) - cross.T @ scaled, lower=True)
        step_v = linalg.cho_solve(factor, grad_v - scaled.T @ grad_u)
        step_u = (grad_u - cross @ step_v) / diagonal
        log_det = np.log(diagonal).sum() + 2 * np.log(np.diag(factor[0])).sum()
        return step_u, step_v, float(log_det)


def _polish(model: _Laplace, start: Float[np.ndarray, "Q"]) -> Float[np.ndarray, "Q"]:
    """Newton steps on the outer problem with a numerical Hessian, over the parameters off the boundary."""
    best, value = start.copy(), model.deviance(start)
    best[-2:] = np.where(best[-2:] < 1e-3, 0.0, best[-2:])
    free = np.flatnonzero(np.r_[np.ones(model.fixed, bool), best[-2:] > 0])
    for _ in range(4):
        gradient, hessian = _derivatives(model, best, free)
        try:
            step = linalg.solve(hessian, gradient, assume_a="pos")
        except linalg.LinAlgError:
            return best
        trial = best.copy()
        trial[free] -= step
        trial[-2:] = np.abs(trial[-2:])
        new = model.deviance(trial)
        if new > value + 1e-9:
            break
        best, value = trial, new
        if np.abs(step).max() < 1e-6:
            break
    return best


def _curvature(
    model: _Laplace, best: Float[np.ndarray, "Q"]
) -> tuple[Float[np.ndarray, "F"], Float[np.ndarray, "Q Q"]]:
    free = np.flatnonzero(np.r_[np.ones(model.fixed, bool), best[-2:] > 0])
    gradient, hessian = _derivatives(model, best, free)
    covariance = np.zeros((len(best), len(best)))
    covariance[np.ix_(free, free)] = 2 * linalg.pinvh(hessian)
    return gradient, covariance


def _derivatives(
    model: _Laplace, at: Float[np.ndarray, "Q"], free: Float[np.ndarray, "F"]
) -> tuple[Float[np.ndarray, "F"], Float[np.ndarray, "F F"]]:
    """Central differences of the deviance: gradient and Hessian over the `free` parameters."""
    h, count = 1e-3, len(free)
    centre = model.deviance(at)

    def value(*moves: tuple[int, float]) -> float:
        point = at.copy()
        for index, amount in moves:
            point[free[index]] += amount
        return model.deviance(point)

    up = [value((i, h)) for i in range(count)]
    down = [value((i, -h)) for i in range(count)]
    hessian = np.diag([(p - 2 * centre + m) / h**2 for p, m in zip(up, down, strict=True)])
    for i in range(count):
        for j in range(i):
            both, neither = value((i, h), (j, h)), value((i, -h), (j, -h))
            mixed = both + neither - up[i] - down[i] - up[j] - down[j] + 2 * centre
            hessian[i, j] = hessian[j, i] = mixed / (2 * h**2)
    gradient = np.array([(p - m) / (2 * h) for p, m in zip(up, down, strict=True)])
    return gradient, hessian

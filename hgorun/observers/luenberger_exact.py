"""The Luenberger observer of a linear plant that is sampled."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Poles, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Arrival, Flow, PeriodLimit, observer
from hgorun.observers.capabilities import NoiseInformed
from hgorun.observers.intervals import usual_periods
from hgorun.observers.sample_clock import SampleClock
from hgorun.observers.whole_periods import UNEVEN, off_period
from hgorun.symbolic.linear import LinearForm, linear_form
from hgorun.symbolic.smooth import SmoothCopy
from hgorun.symbolic.symbols import Symbols


@observer("luenberger_exact")
class ExactLuenbergerObserver(NoiseInformed, SampleClock[LinearForm, SmoothCopy]):
    """Luenberger observer of samples of a constant period, for linear plants.

    For x' = A x + g(t, u), y = C x + h(t, u) with constant A and C, between samples and at a sample, e = C xhat - y,

        xhat' = A xhat + g(t, u)
        xhat+ = xhat - L e

    so that the error is ((I - L C) e^(AT))^k e(0) after k samples, exactly, whatever the period T. L gives
    (I - L C) e^(AT) the eigenvalues exp(p_i T): ``poles`` p_i are those of the error per time, not scaled by a theta.
    With one output L is unique (Ackermann's formula, in powers of e^(AT) - I, which loses nothing where T is small),
    and poles may be equal; with several it is that of scipy's place_poles, each pole at most as many times as there are
    outputs. On a chain of integrators with all poles at -theta it is ``impulsive``.

    The flow is integrated by the solver, like the plant. The period is that of the measurement, and all outputs must be
    sampled together. A sample that is lost corrects nothing: where all outputs lose theirs, the error is multiplied by
    e^(AT) alone, and poles hold from the next one on; with one of several lost, the columns of L for the others
    correct. Samples that are not whole periods apart are refused. A sample at the start makes no correction, nor does a
    second one at the same time. Late samples are replayed. For nonlinear plants or uneven samples take
    ``impulsive_riccati`` or ``ekf``.
    """

    lacks = {"extend": "it takes any linear model: give the plant a state for the unknown input"}

    reference = "Luenberger 1971; textbook, in discrete time (current observer)"
    form = staticmethod(linear_form)

    poles: Poles = Field(
        description="eigenvalues of the error, per time: a number (for all) or a list of n; real part < 0"
    )
    period: Positive | None = Field(
        default=None, description="T that the gain is for; that of the measurement by default"
    )

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"poles": [-1.0 - 0.2 * i for i in range(len(states))], "period": 0.1}

    def design(self, form: LinearForm) -> dict[str, np.ndarray]:
        n = form.plant.n
        if isinstance(self.poles, tuple) and len(self.poles) != n:
            raise Problem(("poles",), f"expected {n} numbers, or one number for all; found {len(self.poles)}")
        poles = np.resize(np.atleast_1d(np.asarray(self.poles, dtype=complex)), n)
        return {"L": sampled_gain(form.A, form.C, poles, self.whole_periods(form))}

    def whole_periods(self, form: LinearForm) -> float:
        periods = usual_periods(self.period, self._sensors, form, "period")
        if np.ptp(periods) > UNEVEN * periods[0]:
            raise Problem(("period",), f"the outputs have periods from {np.min(periods):.6g} to {np.max(periods):.6g}")
        return float(periods[0])

    def check_times(self, form: LinearForm, times: Mapping[str, np.ndarray], origin: float) -> None:
        why = off_period(times, self.whole_periods(form), origin)
        if why is not None:
            raise Problem(
                ("type",), f"the gain is for one period of all outputs, but {why}: take ekf or impulsive_riccati"
            )

    def equations(self, plant: SmoothCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat), "age": self.ticking(s)})

    def correct(self, plant: SmoothCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        due, _ = self.due(s, arrival)
        return {"xhat": s.xhat - k.L @ (due * (plant.output(s.xhat) - arrival.y)), "age": self.passed(s, arrival)}

    def longest_period(self, form: LinearForm) -> PeriodLimit:
        return PeriodLimit(None, "the gain is for the configured period: the error has the eigenvalues exp(p_i T)")


def sampled_gain(A: np.ndarray, C: np.ndarray, poles: np.ndarray, T: float) -> np.ndarray:
    """L, shape (n, q), with (I - L C) e^(AT) having the eigenvalues exp(p_i T).

    Raises
    ------
    Problem
        Where they cannot be placed.
    """
    from scipy.linalg import expm
    from scipy.signal import place_poles

    step, q = expm(A * T), len(C)
    if q > 1:
        wanted = np.exp(poles * T)
        try:
            found = place_poles(step.T, (C @ step).T, wanted, maxiter=100)
        except ValueError as error:
            raise Problem(("poles",), f"they cannot be placed: {error}") from error
        return np.asarray(found.gain_matrix.T)
    n = len(A)
    change = step - np.eye(n)
    shifted, rows = np.eye(n, dtype=complex), [C[0] @ step]
    for pole in poles:
        shifted = (change - np.expm1(pole * T) * np.eye(n)) @ shifted
    for _ in range(n - 1):
        rows.append(rows[-1] @ change)
    seen = np.array(rows)  # the observability matrix, its rows replaced by their differences
    size = np.max(np.abs(seen), axis=1, keepdims=True)
    if np.min(size) == 0 or np.linalg.matrix_rank(seen / size) < n:
        raise Problem(("type",), f"with samples {T:.6g} apart the plant cannot be observed")
    last = np.linalg.solve(seen / size, np.eye(n)[:, -1] / size[-1])
    return np.asarray((shifted @ last).real)[:, None]

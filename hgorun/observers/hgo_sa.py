"""The high-gain observer of an integrator chain by stochastic approximation."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from hgorun.config.expressions import ExpressionError
from hgorun.config.types import ExpressionText, Positive
from hgorun.errors import KeyPath, Problem
from hgorun.observers.base import SampleSchedule, observer
from hgorun.observers.forward_differences import ForwardDifferences, eigenvalues
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.evaluate import along, compiled

_FIRST = 100_000  # samples whose b(k) are all looked at; then powers of two
_LAST = 100  # 2^100 stands for infinity
_LOGARITHMS = 0.05  # of an exponent: factors log(k) make so little of it at 2^100


@observer("hgo_sa")
class StochasticApproximationObserver(ForwardDifferences):
    """High-gain observer of an integrator chain whose steps get shorter, so that white noise averages out.

    With q = D xhat, D = diag(1, eps, ..., eps^(n-1)),

        q(k+1) = q(k) + (a(k)/eps) (A_0 q(k) + H_0 y_k),    a(k) = alpha eps b(k),    A_0 = A - H_0 C

    The sample k + 1 comes a(k) after the sample k: a(k) is the time between samples, and the sampling is
    ``{steps: alpha*eps*b(k)}``. The observer takes a(k) from the clock, so that a lost sample makes one longer
    step; alpha and b, where they are given, are compared with the schedule. An observer that stepped by
    alpha eps b(k) on samples of constant period would give xhat_2 times 1/b(k).

    Before the run, I + (a(k)/eps) A_0 must be stable for every k, for H_0 = (2, 2) when a(k) < eps: that is
    (36), whose c must depend on k, since its left side is of the order of alpha b(k). The theorem also asks,
    (A.2), that the sum of a(k) diverge and that of a(k)^2 converge: a falls like k^-p with 1/2 < p <= 1. Where
    the schedule is an expression of k, it is evaluated at k = 0 ... 1e5 and at powers of two up to 2^100, where
    p is read off; factors such as log(k), which decide at p = 1/2 and 1, are not told apart. On a periodic
    schedule the observer is hgo_fd, and the noise stays.

    The error's variance falls like b(k); its rate over time stays that of the continuous observer, poles over
    eps. Against noise that is not white, or where samples come at a rate of their own, take a filtered
    observer (fhgo2). (21) of the paper prints b(k) < 1; its own example has b(0) = 1. The paper calls (44) an
    observer "for (41)", which is stepped by T: it is one for the plant stepped by a(k), (23).
    """

    reference = "Lee, Choi, Khalil 2016, (21)-(22), (36), (44)"

    alpha: Positive | None = Field(
        default=None, description="with b: compared with the schedule, a(k) = alpha eps b(k)"
    )
    b: ExpressionText | None = Field(default=None, description="b(k), expression of k, in (0, 1]")

    @property
    def asks_of_gaps(self) -> bool:
        return True

    @property
    def asks_of_numbers(self) -> bool:
        return self.alpha is not None and self.b is not None

    def check_samples(self, form: CanonicalForm, samples: SampleSchedule) -> None:
        steps = samples.intervals
        longest = float(np.max(steps, initial=0.0))
        if samples.steps is not None:
            longest = self._check_steps(samples)
        if self.alpha is not None and self.b is not None and steps.size:
            expected = self.alpha * self.eps * self._values(self.b, samples.number + np.arange(steps.size), ("b",))
            wrong = ~(np.abs(steps - expected) <= 1e-6 * np.abs(steps))
            if wrong.any():
                i = int(np.argmax(wrong))
                k = samples.number + i
                right = "write sampling: {steps: alpha*eps*b(k)} with these numbers"
                if samples.recorded:
                    right = "leave alpha and b out, which are only compared with the times of the samples"
                raise Problem(
                    ("alpha",),
                    f"the schedule has a({k}) = {steps[i]:.6g}, but alpha eps b({k}) = {expected[i]:.6g}; {right}",
                )
        poles = eigenvalues(self.H_0(form.plant.n))
        largest = longest / self.eps
        radius = np.max(np.abs(1 + largest * poles))
        if longest > 0 and not radius < 1 - 1e-12:  # roots are rounded
            bound = np.min(-2 * poles.real / np.abs(poles) ** 2)
            raise Problem(
                ("eps",) if samples.recorded else samples.path,
                f"I + (a/eps) A_0 has spectral radius {radius:.6g} for the longest step: the estimate would not "
                f"stay bounded; found a/eps = alpha b = {largest:.6g}, expected less than {bound:.6g}",
            )

    def _check_steps(self, samples: SampleSchedule) -> float:
        """(A.2), as far as numbers tell; the longest step, a(0)."""
        assert samples.steps is not None
        path = (*samples.path, "steps")
        early, late = np.arange(_FIRST), 2.0 ** np.arange(np.ceil(np.log2(_FIRST)), _LAST + 1)
        k = np.concatenate([early, late])
        a = self._values(samples.steps, k, path)
        rises = a[1:] > a[:-1] * (1 + 1e-12)
        if rises.any():
            i = int(np.argmax(rises))
            raise Problem(
                path, f"the steps must not increase, found a({k[i]:g}) = {a[i]:.6g}, a({k[i + 1]:g}) = {a[i + 1]:.6g}"
            )
        p = np.log2(a[-2] / a[-1]) if a[-1] > 0 else np.inf
        if p > 1 + _LOGARITHMS:
            falls = f"like k^-{p:.3g}" if np.isfinite(p) else "faster than any power"
            raise Problem(
                path,
                f"the steps fall {falls}: their sum converges, and the estimate stops before it has converged (A.2); "
                "expected k^-p with 1/2 < p <= 1",
            )
        if p < 0.5 + 1e-6:
            falls = f"fall like k^-{p:.3g}" if p > 1e-6 else "do not fall"
            raise Problem(
                path,
                f"the steps {falls}: the sum of their squares diverges, the noise does not average out (A.2); "
                "expected k^-p with 1/2 < p <= 1. The observer with a constant step is hgo_fd",
            )
        return float(a[0])

    @staticmethod
    def _values(text: str, numbers: np.ndarray, path: KeyPath) -> np.ndarray:
        try:
            return along(compiled(text, "k"), numbers)
        except ExpressionError as error:
            raise Problem(path, str(error)) from error

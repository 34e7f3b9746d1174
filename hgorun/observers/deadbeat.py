"""The two-step deadbeat reduced-order observer."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from hgorun.observers.base import PeriodLimit, Sample, observer
from hgorun.observers.reduced_order import ReducedOrder
from hgorun.symbolic.strict_feedback import StrictFeedbackCopy, StrictFeedbackForm
from hgorun.symbolic.symbols import Symbols


@observer("deadbeat")
class DeadbeatObserver(ReducedOrder):
    """Two-step deadbeat reduced-order observer for sampled plants of strict-feedback-like form.

    For x' = f_1(x, u) + g(x, u) z, z' = f_2(x, z, u), y(k) = x(t_k), with T = t_(k+1) - t_k,

        zhat(k+1) = Psi + T f_2(y, Psi, u)
        Psi = (g^T g)^-1 g^T ((y(k+1) - y(k)) / T - f_1(y, u))

    y and u are those of sample k. It has no gain: two samples give z(k), and one Euler step z(k+1), whatever
    the estimate was before. It is reduced_sampled with H = I/T. Noise enters divided by T, undamped, so its
    error under noise does not fall with T: take reduced_sampled where there is any.
    """

    reference = "Katayama, (6), (9)"

    def design(self, form: StrictFeedbackForm) -> dict[str, np.ndarray]:
        return {}

    def rates(self, form: StrictFeedbackForm) -> None:
        return None

    def longest_period(self, form: StrictFeedbackForm) -> PeriodLimit:
        return PeriodLimit(None, "the estimate does not depend on earlier ones: no period makes it unstable")

    def jump(
        self,
        plant: StrictFeedbackCopy,
        before: StrictFeedbackCopy,
        s: Symbols,
        sample: Sample,
        k: Symbols,
    ) -> Mapping[str, ca.SX]:
        y = sample.previous
        Psi = before.Psi(y, sample.y, sample.interval)
        return {"xhat": plant.join(sample.y, Psi + sample.interval * before.f_2(y, Psi))}

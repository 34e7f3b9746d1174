"""The Kazantzis-Kravaris/Luenberger observer."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from hgorun.errors import Problem
from hgorun.observers import kkl_map
from hgorun.observers.base import (
    ContinuousObserver,
    Flow,
    HybridObserver,
    Sample,
    SampleSchedule,
    observer,
)
from hgorun.observers.capabilities import BySampling
from hgorun.observers.intervals import usual_periods
from hgorun.observers.kkl_keys import KklObserver
from hgorun.observers.orbits import Escaped
from hgorun.observers.sample_times import BeginsWithASample, OnePeriod
from hgorun.symbolic.drift import DriftForm
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.smooth import SmoothCopy
from hgorun.symbolic.symbols import Symbols

_UNEVEN = 1e-6  # of a period


@observer("kkl")
class ContinuousKkl(BySampling, KklObserver, ContinuousObserver[DriftForm, SmoothCopy]):
    """Kazantzis-Kravaris/Luenberger observer, for any smooth plant without inputs, and for linear ones.

    A linear filter of the output with more states than the plant, and the inverse of the map T that it converges to:

        z' = Lam z + Gam y,    xhat = T^inv(z),    Lam = -theta diag(lam_1, ..., lam_m),    Gam = (1, ..., 1)
        T(x) = int_0^inf e^(Lam s) Gam h(X(x, -s)) ds,    dT/dx f = Lam T + Gam h

    X(x, -s) is the state of the plant a time s before x. z - T(x) decays as e^(Lam t), whatever the plant does and
    however large the initial error is; several outputs have a z each. z(0) = T(xhat(0)). T has an inverse for nearly
    all n + 1 complex eigenvalues (Andrieu, Praly), 2n + 1 real ones (Brivadis et al.), which is what m is by default;
    m >= n is needed.

    A linear plant x' = A x + g(t, u): T A - Lam T = Gam C (Sylvester), exactly, xhat = T^+ z; T g is added to z', which
    is for continuous outputs only: with sampled ones the plant must be free of time and inputs, linear or not.
    With m = n and one output this is Luenberger's observer with L = T^-1 Gam and the poles -theta lam.

    Other plants: T is known at points of ``box``, by integrating the plant backwards until e^(-20) is left, and
    T^inv is a polynomial of ``degree`` in the standardised z, by least squares. Its error remains in the estimate:
    ``analyze`` gives it at the points of the fit and at others (``inverse_error``), and the largest coefficient.
    The fit knows nothing of noise: where coefficients are large an accurate inverse amplifies noise and model
    errors; take ``ridge``, a lower degree or a smaller m then. theta scales the bandwidth. A plant that diverges
    backwards in time on the box is refused; with ``outside: saturate`` it is clipped to the box there, and T is
    right where the past has been inside. Inputs of a nonlinear plant are refused, since each would need another T.

    Sampled outputs, all with one period T_s, have a T of their own, in which nothing is neglected:

        z_(k+1) = Lam_d z_k + Gam y_k,    Lam_d = exp(-theta lam T_s),    T(x) = sum_j Lam_d^j Gam h(X(x, -(j+1) T_s))

    z_(k+1) belongs to the next sample, when xhat = T^inv(z_(k+1)); in between xhat follows f. The first z belongs to
    the first sample, at t_1: it is T(xhat(t_1)), where f has carried the initial estimate by then, so that a right
    start stays right. t_1 is that of the configuration, of the recording, or of the first sample of a stream. A
    linear plant with constant terms takes a box, like nonlinear ones. Late outputs are refused: z belongs to the time
    when outputs were taken, and no copy of the plant is integrated from there to now. Choose it for plants that are
    not chains; for chains ``shgo`` needs no map and no box.
    """

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        return self.inverted(s.z, k)

    def of_samples(self) -> SampledKkl:
        return SampledKkl.model_construct(self.model_fields_set, **dict(self))

    def require_times(self, form: DriftForm) -> None:
        for name, sensor in zip(form.plant.outputs, self._sensors, strict=False):
            if sensor.interval is not None:
                raise Problem(
                    ("type",),
                    f"{name} is sampled and others are continuous: z is a filter of continuous outputs, or of samples",
                )

    def eigenvalues(self, form: DriftForm) -> np.ndarray:
        return -self.numbers(form)

    def is_exact(self, form: DriftForm) -> bool:
        return form.A is not None

    def _matrix(self, form: DriftForm) -> np.ndarray:
        assert form.A is not None
        assert form.C is not None
        return kkl_map.of_linear_plant(form.A, form.C, self.eigenvalues(form))

    def _mapped(self, form: DriftForm, x: Floats) -> Floats:
        field, reach = self.backwards(form)
        return kkl_map.of_points(field, x, self.eigenvalues(form), reach)

    def equations(self, plant: SmoothCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        """xhat of the state is where it started: the estimate is a function of z."""
        y = plant.output(self.estimate(s, k)) - e
        entering = [one for one in ca.vertsplit(y) for _ in range(s.z.numel() // y.numel())]
        rate = k.Lam * s.z + ca.vertcat(*entering)
        if "T" in vars(k):
            origin = ca.SX.zeros(s.xhat.numel())
            still = [one for one in ca.vertsplit(plant.output(origin)) for _ in range(s.z.numel() // y.numel())]
            rate += k.T @ plant.copy(origin) - ca.vertcat(*still)
        return Flow({"xhat": ca.SX.zeros(s.xhat.numel()), "z": rate})

    @property
    def not_linear(self) -> str | None:
        return "its error is that of z, which decays as exp(-theta lam t), seen through the inverse of a map"

    def fastest_rate(self, form: DriftForm) -> float:
        return float(np.max(self.numbers(form)))


class SampledKkl(OnePeriod, BeginsWithASample, KklObserver, HybridObserver[DriftForm, SmoothCopy]):
    """The observer of samples; see :class:`ContinuousKkl`."""

    without_box = "linear plants without constant terms"

    def require_times(self, form: DriftForm) -> None:
        _ = self._period(form)
        if not form.autonomous:
            raise Problem(("type",), "time or inputs enter the plant: the map of samples is that of one without")

    @property
    def begins(self) -> float:
        return self._first

    def begun(self, form: DriftForm, xhat: np.ndarray) -> Mapping[str, np.ndarray]:
        return {} if "z" in self.internal else {"z": self.of_estimate(form, xhat)}

    @property
    def _first(self) -> float:
        """When the first sample is due, counted from the start of the run."""
        return self._sensors[0].first if self._sensors else 0.0

    def at_first(self, form: DriftForm, x: np.ndarray) -> np.ndarray:
        """Where the observer's own flow has carried the estimate when the first sample comes."""
        bounds = np.array([self.saturation.get(name, (-np.inf, np.inf)) for name in form.plant.states])
        low, high = bounds.T
        try:
            return kkl_map.carried(lambda x: form.values(np.clip(x, low, high)), x, self._first)
        except Escaped as escaped:
            raise Problem(
                ("initial",),
                f"the first sample comes at {self._first:.6g}, and the estimate is lost before that, after "
                f"{escaped.after:.4g}",
            ) from None

    def _period(self, form: DriftForm) -> float:
        periods = usual_periods(None, self._sensors, form, None)
        if np.ptp(periods) > _UNEVEN * periods[0]:
            raise Problem(("type",), f"the outputs have periods from {np.min(periods):.6g} to {np.max(periods):.6g}")
        return float(periods[0])

    def check_samples(self, form: DriftForm, samples: SampleSchedule) -> None:
        gaps = samples.intervals
        if gaps.size and np.ptp(gaps) > _UNEVEN * float(np.max(gaps)):
            raise Problem(
                ("type",),
                f"its map is that of one period, but samples are {np.min(gaps):.6g} to {np.max(gaps):.6g} apart",
            )
        if abs(samples.first - self._first) > _UNEVEN * self._period(form):
            raise Problem(
                ("type",),
                f"z begins with the sample that is due {self._first:.6g} after the start, but the first one comes "
                f"{samples.first:.6g} after it",
            )

    def one_period(self, form: DriftForm) -> float:
        return self._period(form)

    def eigenvalues(self, form: DriftForm) -> np.ndarray:
        return np.asarray(np.exp(-self.numbers(form) * self._period(form)))

    def is_exact(self, form: DriftForm) -> bool:
        return form.A is not None and not form.offset

    def _matrix(self, form: DriftForm) -> np.ndarray:
        from scipy.linalg import expm

        assert form.A is not None
        assert form.C is not None
        return kkl_map.of_linear_plant(expm(form.A * self._period(form)), form.C, self.eigenvalues(form))

    def _mapped(self, form: DriftForm, x: Floats) -> Floats:
        field, reach = self.backwards(form)
        return kkl_map.of_samples(field, x, self.eigenvalues(form), self._period(form), reach)

    def equations(self, plant: SmoothCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat), "z": ca.SX.zeros(s.z.numel())})

    def jump(
        self, plant: SmoothCopy, before: SmoothCopy, s: Symbols, sample: Sample, k: Symbols
    ) -> Mapping[str, ca.SX]:
        entering = [one for one in ca.vertsplit(sample.previous) for _ in range(s.z.numel() // sample.y.numel())]
        z = k.Lam * s.z + ca.vertcat(*entering)
        return {"z": z, "xhat": self.inverted(z, k)}

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        return s.xhat

    @property
    def not_linear(self) -> str | None:
        return (
            "its error is that of z, which a sample multiplies by exp(-theta lam T), seen through the inverse of a map"
        )

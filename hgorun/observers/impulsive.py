"""The impulsive observer of samples at any period."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb, factorial

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial
from pydantic import Field

from hgorun.config.types import Poles, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Arrival, Flow, PeriodLimit, observer
from hgorun.observers.capabilities import HighGain
from hgorun.observers.extension import Extendable
from hgorun.observers.sample_clock import SampleClock
from hgorun.observers.uneven import refuse_of_uneven_chains
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.symbols import Symbols


@observer("impulsive")
class ImpulsiveObserver(HighGain, Extendable[CanonicalForm, PlantCopy], SampleClock[CanonicalForm, PlantCopy]):
    """Impulsive high-gain observer, for uniformly observable plants with sampled outputs.

    Between samples it is a copy of the plant, and at a sample t_k, T = t_k - t_(k-1), e = C xhat - y,

        xhat' = f(xhat, u)
        z+    = z - D_T kappa(w) e,    D_T = diag(1, 1/T, ..., 1/T^(n-1)),    w = 1 - exp(-theta T)

    in the coordinates z of the chain. kappa gives all eigenvalues of (I - kappa C) e^A the value exp(-theta T), A the
    chain of n integrators: with binom(r - 1, m) as a polynomial in r,

        kappa_i(w) = sum_(m = i-1..n-1) binom(n, m+1) w^(m+1) (d/dr)^(i-1) binom(r - 1, m) at r = 0

    which is (1 - z^2, (1-z)^2) for n = 2 and (1 - z^3, 1.5 (1-z)^2 (1+z), (1-z)^3) for n = 3, z = exp(-theta T). These
    are the gains of discounted least squares (fading memory), the weight of a sample falling as exp(-theta) per time.
    With ``poles`` p_1 .. p_n the eigenvalues are exp(theta p_i T), and kappa has the elementary symmetric polynomial
    e_(m+1)(w_1, .., w_n), w_i = 1 - exp(theta p_i T), in place of binom(n, m+1) w^(m+1). Butterworth poles, for n = 2
    ``[-0.71+0.71j, -0.71-0.71j]``, are near those of a Kalman filter whose process noise stands at the end of the
    chain: of a given speed in z_1 they correct z_2 more.

    For phi = 0 the error falls exactly as exp(-theta) per unit time, up to powers of t, whatever theta T: there is no
    longest period. As theta T falls it becomes ``shgo`` with its poles at -1, sampled. T of the first sample counts
    from the start, and a sample at the start makes no jump, nor does a second one at the same time. Each output has T
    and kappa of its own; a lost sample makes one longer T. For samples at uneven times there is no proof: with T drawn
    between 1/5 and 5 times a mean of 0.2, theta = 1, the error falls as exp(-0.99 t) for n = 2, exp(-0.75 t) for n = 3.
    With a proof for any times: ``impulsive_riccati``; where the noise is known: ``ekf``.

    With ``coordinates: canonical`` the jump is made in z. In the plant's own, the default, it is xhat - J^-1 D_T kappa
    e, the first order of that, J the Jacobian of Phi at the estimate; where z are the plant's states both are the same.
    Late samples are replayed.

    The idea is quoted from memory of the publications; the gain is derived here.
    """

    reference = "Raff, Allgower 2007; Dinh, Andrieu, Nadri, Serres 2015; gain: fading-memory polynomials, Morrison 1969"

    theta: Positive = Field(description="high gain theta > 0: the error of a chain falls as exp(-theta t), whatever T")
    poles: Poles = Field(
        default=complex(-1),
        description="a number (for all) or a list, real part < 0: the eigenvalues of a chain are exp(theta T pole)",
    )

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta": 2.0}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        if not form.square:
            raise Problem(
                ("type",),
                "outputs that measure the same share the states of one chain, and this observer corrects a chain for "
                "each: leave out the outputs that are not needed, or take impulsive_riccati or ekf",
            )
        numbers = {"theta": np.array(self.theta)}
        return numbers if self._equal else numbers | {"poles": self._placed(form)}

    @property
    def _equal(self) -> bool:
        """Whether all eigenvalues are exp(-theta T)."""
        return self.poles == -1

    def _placed(self, form: CanonicalForm) -> np.ndarray:
        """Real and imaginary parts of the poles of all chains, shape (sum of their lengths, 2)."""
        chains = form.chains
        refuse_of_uneven_chains("poles", self.poles, form, chains, "write one number for all")
        for n in set(chains):
            if isinstance(self.poles, tuple) and len(self.poles) != n:
                raise Problem(("poles",), f"expected {n} numbers, or one number for all; found {len(self.poles)}")
        poles = np.concatenate([self.nominal_poles(n) for n in chains])
        return np.column_stack([poles.real, poles.imag])

    def nominal_poles(self, order: int) -> np.ndarray:
        return np.resize(np.asarray(self.poles, dtype=complex), order)

    @property
    def settling_rate(self) -> float:
        return self.theta * float(np.min(-np.real(self.poles)))

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        return Flow({"xhat": plant.copy(s.xhat), "age": self.ticking(s)})

    def correct(self, plant: PlantCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        error, (due, T) = plant.output(s.xhat) - arrival.y, self.due(s, arrival)
        kappa, first = [], 0
        for i, n in enumerate(plant.chains):
            if self._equal:
                gain = fading_memory_gain(n, 1 - ca.exp(-k.theta * T[i]))
            else:
                gain = placed_gain([_decay(k.theta * T[i] * k.poles[j, :]) for j in range(first, first + n)])
            first += n
            kappa += [due[i] * error[i] * one / T[i] ** j for j, one in enumerate(gain)]
        return {"xhat": s.xhat - plant.lift(s.xhat, ca.vertcat(*kappa)), "age": self.passed(s, arrival)}

    def longest_period(self, form: CanonicalForm) -> PeriodLimit:
        return PeriodLimit(None, "on a chain a sample multiplies the error by exp(-theta T): stable at every period")


def _decay(exponent: ca.SX) -> tuple[ca.SX, ca.SX]:
    """1 - exp of a complex number, real and imaginary part."""
    size = ca.exp(exponent[0])
    return 1 - size * ca.cos(exponent[1]), -size * ca.sin(exponent[1])


def fading_memory_gain(n: int, w: ca.SX) -> list[ca.SX]:
    """kappa of a chain of n integrators, T = 1, that places all eigenvalues of (I - kappa C) e^A at 1 - w.

    Ackermann's formula for (e^A, C e^A), powers of e^A - I in place of those of e^A: kappa_i begins with w^i, without
    cancellation where w is small.
    """
    kappa = []
    newton = _newton(n)
    for i in range(n):
        weights = [comb(n, m + 1) * factorial(i) * float(newton[m].coef[i]) for m in range(i, n)]
        value = ca.SX(0)
        for weight in reversed(weights):
            value = value * w + weight
        kappa.append(value * w ** (i + 1))
    return kappa


def placed_gain(w: Sequence[tuple[ca.SX, ca.SX]]) -> list[ca.SX]:
    """The same with eigenvalues at 1 - w_1, 1 - w_2, .., real and imaginary parts; complex ones come in pairs."""
    n = len(w)
    e = [(ca.SX(1), ca.SX(0)), *[(ca.SX(0), ca.SX(0))] * n]  # elementary symmetric polynomials of those so far
    for re, im in w:
        e[1:] = [(a + re * c - im * d, b + re * d + im * c) for (a, b), (c, d) in zip(e[1:], e[:-1], strict=True)]
    newton = _newton(n)
    terms = [[factorial(i) * float(newton[m].coef[i]) * e[m + 1][0] for m in range(i, n)] for i in range(n)]
    return [sum(some, ca.SX(0)) for some in terms]


def _newton(n: int) -> list[Polynomial]:
    """binom(r - 1, m) as polynomials in r, m = 0 .. n-1."""
    newton = [Polynomial([1.0])]
    for j in range(1, n):
        newton.append(newton[-1] * Polynomial([-1.0, 1 / j]))
    return newton

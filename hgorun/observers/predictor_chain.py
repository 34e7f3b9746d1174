"""The chain of predictors for outputs that are late by a constant time."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.errors import Problem
from hgorun.observers.base import Flow, PeriodLimit, Role, observer
from hgorun.observers.capabilities import NoiseInformed
from hgorun.observers.constant_gain import ConstantGain
from hgorun.observers.extension import Extendable
from hgorun.observers.recalling import LAGS, RecallingObserver
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols

_SHARE = 0.6  # of the limit of a copy: near it every copy amplifies
_MOST = 50  # copies


@observer("predictor_chain")
class PredictorChain(NoiseInformed, Extendable, ConstantGain, RecallingObserver[CanonicalForm, PlantCopy]):
    """Chain of high-gain predictors, for uniformly observable plants whose outputs are late by a constant time d.

    A single observer is stable up to theta d of about 1. A longer delay is divided into m steps of delta = d/m: of m
    + 1 copies of the plant, copy j follows x(t - d + j delta), with the inputs of that time. Copy 0 is ``shgo`` on
    the arriving outputs, which are not late in its own time, and each other copy observes the one before:

        x_0' = f(x_0, u) - theta Delta^-1 G e_0,    e_0 = C x_0 - y(t - d)
        x_j' = f(x_j, u) - theta Delta^-1 G e_j,    alpha_j' = -theta g_1 e_j
        e_j  = C x_j(t - delta) - C x_(j-1)(t) + alpha_j(t) - alpha_j(t - delta)

    and xhat = x_m; outside chains corrections are lifted by J^-1. alpha_j takes what copy j has corrected since out of
    the comparison, as everywhere in hgorun; ``corrected: false`` leaves it out (Germani, Manes, Pepe). Before the start
    all copies and outputs are constant. Sampled outputs enter copy 0 by the common innovation.

    For phi = 0 the chain is block triangular: it is stable exactly as long as each copy is, d < m delta_max. With poles
    at -1, theta delta_max is 2.7425, 0.9273, 0.5237 for n = 2, 3, 4, without alpha 0.6474, 0.4071, 0.2968: the phase
    margin of s^n + g_1 s^(n-1) + e^(-s delta) (g_2 s^(n-2) + ...), without alpha of s^n + e^(-s delta) (g_1 s^(n-1) +
    ...). Near it every copy amplifies: by default m is the smallest number with theta d/m up to 0.6 of the limit. Where
    the plant itself is fast or unstable, take more copies or a smaller theta.

    Without delay m = 0, and it is ``shgo``. A delay that changes is refused, since it changes the time that each copy
    belongs to: take its largest value and buffer the output. Every copy costs n states and alpha, and noise passes
    through all of them: for short delays choose ``shgo``. Among given steps, one that divides delta keeps the order
    of the solver while kinks of the start come back.

    The structure is quoted from memory of the publications; with alpha in it the form is our own. Limits are derived.
    """

    reference = "Germani, Manes, Pepe 2002; Farza et al. 2015; alpha in each copy: our own"

    m: int | None = Field(
        default=None,
        ge=0,
        le=_MOST,
        strict=True,
        description="copies beside the first, m >= 0; by default as many as theta d asks for",
    )
    corrected: bool = Field(default=True, description="false: without alpha in the copies")

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        if self.coordinates == "canonical":
            raise Problem(("coordinates",), "the copies are in the plant's coordinates: leave this key out")
        if not form.square:
            raise Problem(
                ("type",), "outputs that measure the same have one chain between them: leave out some of them"
            )
        d, m = self.crossed(), self.copies(form)
        if (d == 0) != (m == 0):
            if m == 0:
                raise Problem(("m",), f"a delay of {d:g} takes a copy or more; found 0")
            message = (
                f"a delay of 0 takes m: 0, which is shgo; found {m}. Copies cross a delay that is constant and known, "
                "the measurement.delay of a simulation; samples of data or a stream are late by other times each, and "
                "enter the innovation of shgo"
            )
            raise Problem(("m",), message)
        _, G = self.chain_gains(form)
        lags = np.full(m * len(form.chains), d / max(m, 1))
        return {"theta": np.array(self.theta), "G": G, LAGS: lags}

    def crossed(self) -> float:
        """d.

        Raises
        ------
        Problem
            Where the outputs have no delay in common.
        """
        delays = {sensor.delay for sensor in self._sensors} or {0.0}
        if len(delays) > 1:
            raise Problem(("type",), "its copies cross one delay, but the outputs have several: take shgo or ekf")
        (d,) = delays
        if d is None:
            raise Problem(
                ("type",),
                "the delay changes, and with it the time in which each copy lives: buffer the output up to the longest "
                "delay, or take shgo, whose innovation takes a delay that changes, or ekf",
            )
        return d

    def copies(self, form: CanonicalForm) -> int:
        """m."""
        if self.m is not None:
            return self.m
        d, limit = self.crossed(), self.longest_step(form)
        if d == 0:
            return 0
        m = max(int(np.ceil(d / (_SHARE * limit) - 1e-9)), 1)
        if m > _MOST:
            raise Problem(("theta",), f"theta d = {self.theta * d:.4g} takes {m} copies, more than {_MOST}")
        return m

    def longest_step(self, form: CanonicalForm) -> float:
        """delta_max of a copy, phi = 0; infinity where every one is stable."""
        limits = [copy_limit(self.gain(length), corrected=self.corrected) for length in form.chains]
        return min(limits) / self.theta

    def longest_delay(self, form: CanonicalForm) -> PeriodLimit:
        """The longest delay that so many copies bear on chains of integrators."""
        m, limit = self.copies(form), self.longest_step(form)
        if m == 0:
            return PeriodLimit(None, "there is no delay to cross")
        if not np.isfinite(limit):
            return PeriodLimit(None, "stable at every delay")
        return PeriodLimit(m * limit, f"chains of integrators, phi = 0, {m} copies beside the first")

    def states(self, form: CanonicalForm) -> Mapping[str, np.ndarray | Symmetric]:
        m = self.copies(form)
        if m == 0:
            return {}
        start = np.array([self.initial.get(name, 0.0) for name in form.plant.states])
        return {"copies": np.tile(start, (m, 1)), "corrections": np.zeros((m, len(form.chains)))}

    def roles(self, form: CanonicalForm) -> Mapping[str, Role]:
        return {"copies": "signal", "corrections": "filter"} if self.copies(form) else {}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        copies = _copies(plant, s, k)
        errors = [e]
        if len(copies) > 1:
            before = ca.vertcat(*[at.output(x) for at, x in copies[:-1]])
            compared = s.past + ca.vec(s.corrections.T) - before
            errors += ca.vertsplit(compared, len(plant.chains))
        rates, felt = [], []
        for (at, x), error in zip(copies, errors, strict=True):
            kappa = k.theta * at.inv_Delta(k.theta) @ (k.G * at.along_chains(error))
            rates.append(at.copy(x) - at.lift(x, kappa, k.theta))
            felt.append(at.felt(x, kappa, k.theta))
        derivatives = {"xhat": rates[-1]}
        if len(copies) > 1:
            derivatives["copies"] = ca.horzcat(*rates[:-1]).T
            derivatives["corrections"] = -ca.horzcat(*felt[1:]).T * float(self.corrected)
        return Flow(derivatives, correction=felt[0])

    def signals(self, plant: PlantCopy, s: Symbols, k: Symbols) -> ca.SX:
        """C x_j - alpha_j of the copies j = 1..m, each output by output."""
        outputs = [at.output(x) for at, x in _copies(plant, s, k)[1:]]
        return ca.vertcat(*outputs) - ca.vec(s.corrections.T) if outputs else ca.SX(0, 1)

    def compared(self, plant: PlantCopy, s: Symbols, k: Symbols) -> ca.SX:
        """C x_0, in its own time."""
        at, x = _copies(plant, s, k)[0]
        return at.output(x)

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self._rate(form)


def _copies(plant: PlantCopy, s: Symbols, k: Symbols) -> list[tuple[PlantCopy, ca.SX]]:
    """The copies x_0, ..., x_m, each with the plant at its time."""
    if "copies" not in vars(s):
        return [(plant, s.xhat)]
    x = [row.T for row in ca.vertsplit(s.copies)] + [s.xhat]
    return [(plant.earlier((len(x) - 1 - j) * k.lags[0]) if j < len(x) - 1 else plant, one) for j, one in enumerate(x)]


def copy_limit(gain: np.ndarray, *, corrected: bool) -> float:
    """theta delta up to which a copy is stable on a chain of integrators, phi = 0; infinity where it always is.

    The phase margin of P(s) + e^(-s delta) Q(s): the smallest delta at which a root reaches the imaginary axis, at a
    frequency where |P| = |Q|.

    Parameters
    ----------
    gain : ndarray, shape (n,)
        G at theta = 1.
    corrected : bool
        Whether alpha takes the copy's own correction out of the comparison: then P = s^n + g_1 s^(n-1).
    """
    n, own = len(gain), int(corrected)
    P = np.concatenate([[1.0], gain[:own], np.zeros(n - own)])
    Q = np.concatenate([np.zeros(1 + own), gain[own:]])
    sizes = np.polysub(_squared(P), _squared(Q))
    roots = np.roots(sizes)
    found = [np.sqrt(r.real) for r in roots if r.real > 0 and abs(r.imag) <= 1e-9 * abs(r)]
    at = np.array(found, dtype=float)
    angles = np.angle(-np.polyval(Q, 1j * at) / np.polyval(P, 1j * at)) % (2 * np.pi)
    return float(np.min(angles / at, initial=np.inf))


def _squared(polynomial: np.ndarray) -> np.ndarray:
    """|p(j omega)|^2 as a polynomial in omega^2."""
    powers = np.arange(len(polynomial))[::-1]
    on_axis = polynomial * 1j**powers
    whole = np.polymul(on_axis, np.conj(on_axis)).real
    return np.asarray(whole[(len(whole) - 1) % 2 :: 2])

"""The high-gain observer behind a low-pass filter."""

from __future__ import annotations

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Number, Poles, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Flow, observer
from hgorun.observers.capabilities import FilterOrder
from hgorun.observers.constant_gain import ConstantGain
from hgorun.observers.extension import Extendable
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.matrices import A, B, C
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


@observer("lowpass")
class LowPassObserver(FilterOrder, Extendable, ConstantGain):
    """High-gain observer with r equal low-pass filters on the innovation, for uniformly observable plants.

    The correction uses the innovation e after r filters of time constant rho/theta,

        eta'  = theta/rho ((-I_r + A_r^T) eta + C_r^T e)
        xhat' = A_n xhat + phi^s(u, xhat) - theta Delta_n^-1(theta) G eta_r

    or xhat' = f(xhat, u) - theta J^-1(xhat) Delta_n^-1(theta) G eta_r in the plant's own coordinates. The n
    poles are those of A_n - G C_n; those of the error are theta times the eigenvalues of

        F(rho) = [[-(I_r - A_r^T)/rho, C_r^T C_n/rho], [-G B_r^T, A_n]],

    which approach them as rho goes to 0. A rho for which F(rho) is not Hurwitz is refused. Noise of high
    frequency omega reaches component i with amplitude theta^(r+i) g_i / (rho^r omega^(r+1)). r = 0 is the
    standard observer. With several outputs there is one filter a chain. Choose it where a tuned standard
    observer is to be kept and filtered: rho is the only new number. fhgo2 has the same noise exponents and
    places all r + n poles.

    (3.31) prints C_r eta = eta_1, the least filtered component, with which the noise falls like 1/omega^2
    for every r: the highest relative degree, which its text asks for, is that of eta_r. It lacks
    Delta_n^-1(theta), without which theta is not a high gain, and its F(rho) has C_r for B_r^T too.
    """

    reference = "Astolfi, Zaccarian, Jungers 2021; Robles Magdaleno 2023, (3.31)"

    theta: Positive = Field(description="high gain theta > 0: the error's eigenvalues are theta times those of F(rho)")
    poles: Poles = Field(default=complex(-1), description="eigenvalues of A - G C: a number (for all) or a list of n")
    gains: tuple[Number, ...] | None = Field(default=None, description="G, n numbers, instead of poles")
    r: int = Field(default=1, ge=0, le=20, strict=True, description="order of the filter, r >= 0; 0 is the SHGO")
    rho: Positive = Field(description="time constant of each filter times theta; F(rho) must be Hurwitz")

    @classmethod
    def example(cls, states: tuple[str, ...]) -> dict[str, object]:
        return {"theta": 2.0, "rho": 0.2}

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        _, G = self.chain_gains(form)
        self._require_hurwitz(form)
        return {"theta": np.array(self.theta), "rho": np.array(self.rho), "G": G}

    def states(self, form: CanonicalForm) -> dict[str, np.ndarray | Symmetric]:
        return {"eta": np.zeros((self.r, len(form.chains)))} if self.r else {}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        r, derivatives, filtered = self.r, {}, e
        if r > 0:  # one column of eta a chain
            filtered = (B(r).T @ s.eta).T
            derivatives["eta"] = k.theta / k.rho * ((A(r).T - ca.DM.eye(r)) @ s.eta + C(r).T @ e.T)
        kappa = k.theta * plant.inv_Delta(k.theta) @ (k.G * plant.along_chains(filtered))
        derivatives["xhat"] = plant.copy(s.xhat) - plant.lift(s.xhat, kappa, k.theta)
        return Flow(derivatives, correction=plant.felt(s.xhat, kappa, k.theta))

    def fastest_rate(self, form: CanonicalForm) -> float:
        spectra = [np.linalg.eigvals(F(self.rho, self.r, self.gain(length))) for length in form.chains]
        return self.theta * max(float(np.max(np.abs(spectrum))) for spectrum in spectra)

    def _require_hurwitz(self, form: CanonicalForm) -> None:
        if self.r == 0:
            return
        gains = [self.gain(length) for length in set(form.chains)]
        if self.gains is not None and any(_abscissa(F(1.0, 0, G)) >= 0 for G in gains):
            raise Problem(("gains",), "A - G C is not Hurwitz with these gains, so that F(rho) is not for small rho")
        limits = [largest_rho(self.rho, self.r, G) for G in gains if _abscissa(F(self.rho, self.r, G)) >= 0]
        if limits:
            raise Problem(
                ("rho",),
                f"F(rho) is not Hurwitz with rho = {self.rho:g}; filter order r = {self.r} with these "
                f"{'poles' if self.gains is None else 'gains'} needs 0 < rho < {min(limits):.5g}",
            )


def F(rho: float, r: int, G: np.ndarray) -> np.ndarray:
    """The error's matrix at theta = 1; r = 0: A_n - G C_n."""
    n = len(G)
    if r == 0:
        return np.asarray(A(n)) - np.outer(G, np.asarray(C(n)))
    return np.block(
        [
            [(np.asarray(A(r).T) - np.eye(r)) / rho, np.outer(np.asarray(C(r)), np.asarray(C(n))) / rho],
            [-np.outer(G, np.asarray(B(r))), np.asarray(A(n))],
        ]
    )


def largest_rho(unstable: float, r: int, G: np.ndarray) -> float:
    """Where F(rho) stops being Hurwitz below a rho for which it is not."""
    low, high = unstable / 2, unstable
    while _abscissa(F(low, r, G)) >= 0 and low > 1e-12 * unstable:
        low, high = low / 2, low
    while low < (middle := (low + high) / 2) < high:
        if _abscissa(F(middle, r, G)) < 0:
            low = middle
        else:
            high = middle
    return low


def _abscissa(matrix: np.ndarray) -> float:
    return float(np.max(np.linalg.eigvals(matrix).real))

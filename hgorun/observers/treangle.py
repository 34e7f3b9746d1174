"""The filtered high-gain observer of Tréangle, Farza and M'Saad, with one filter state an estimate."""

from __future__ import annotations

from decimal import Decimal, localcontext

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Number
from hgorun.errors import Problem
from hgorun.observers.base import Flow, observer
from hgorun.observers.constant_gain import ConstantGain
from hgorun.observers.extension import Extendable
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.matrices import C
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols


@observer("treangle")
class TreangleObserver(Extendable, ConstantGain):
    """Filtered high-gain observer with a cascade of n first-order filters, for uniformly observable plants.

    Component i is corrected by the innovation e_y after i filters,

        xhat' = A_n xhat + phi^s(u, xhat) - theta K e
        e'    = -theta D e + theta^2 A_n^T e + theta C_n^T e_y,    e(0) = 0

    or xhat' = f(xhat, u) - theta J^-1(xhat) K e in the plant's own coordinates, K = diag(k_1..k_n),
    D = diag(delta_1..delta_n). M_n = [[A_n, -K], [C_n^T C_n, -D + A_n^T]] has the 2n poles, any stable set;
    the error decays at theta times their value. All poles at -1: delta_i = 2, k_i = binomial(n, i). ``gains``
    are (delta_1..delta_n, k_1..k_n), with M_n Hurwitz. With several outputs there is one cascade a chain.

    Noise of high frequency omega reaches component i like 1/omega^(i+1); like 1/omega^min(i+1, n+3-i) if
    phi_n depends on x_1, and 1/omega^min(i+1, 3) if every phi_i does. theta appears to the power 2 at most.
    Choose it where the last components are the noisy ones; fhgo2 filters all equally, to any order.

    The thesis prints A_n for A_n^T in the matrix below (3.30); theta (C^T C xtilde - v) for
    theta C^T (C xtilde - v) in (2.25); D + A_3^T for -D + A_3^T in (2.27), and Delta_3(theta) v for C_3^T v
    at the end of (2.27) and (2.28). The relative degree of xhat_i with respect to y is i + 1, not i as below
    (3.30), and that of e_3 with respect to xtilde_1 is 3, not 2 as below (2.32).
    """

    reference = "Tréangle, Farza, M'Saad 2019; Robles Magdaleno 2023, (2.17)-(2.20), (3.30)"

    gains: tuple[Number, ...] | None = Field(
        default=None, description="delta_1..delta_n, then k_1..k_n, instead of poles"
    )

    def design(self, form: CanonicalForm) -> dict[str, np.ndarray]:
        self.gains_of_orders(form, [2 * length for length in form.chains])  # refuses what fits no chain
        diagonals = [self._diagonals(length) for length in form.chains]
        delta, K = (np.concatenate(part) for part in zip(*diagonals, strict=True))
        return {"theta": np.array(self.theta), "delta": delta, "K": K}

    def states(self, form: CanonicalForm) -> dict[str, np.ndarray | Symmetric]:
        return {"e": np.zeros(sum(form.chains))}

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        A_n = plant.form.shift
        C_n = ca.diagcat(*[C(length) for length in plant.chains])
        kappa = k.theta * k.K * s.e
        return Flow(
            {
                "xhat": plant.copy(s.xhat) - plant.lift(s.xhat, kappa, k.theta),
                "e": -k.theta * k.delta * s.e + k.theta**2 * (A_n.T @ s.e) + k.theta * (C_n.T @ e),
            },
            correction=plant.felt(s.xhat, kappa, k.theta),
        )

    def characteristics(self, form: CanonicalForm) -> list[np.ndarray]:
        return [characteristic(*self._diagonals(length)) for length in form.chains]

    def fastest_rate(self, form: CanonicalForm) -> float:
        return self.theta * max(float(np.max(np.abs(np.roots(p)))) for p in self.characteristics(form))

    def _diagonals(self, length: int) -> tuple[np.ndarray, np.ndarray]:
        """(delta, k) of a chain."""
        numbers = self.gain(2 * length)
        if self.gains is not None:
            return numbers[:length], numbers[length:]
        return cascade(np.array([1.0, *numbers]))


def characteristic(d: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Coefficients of p_m, where p_0 = 1 and p_i = s (s + d_i) p_(i-1) + c_i.

    With d = delta and c = k it is det(s I - M_n), n = m: expand it by the rows of A_n^T.
    """
    p = np.ones(1)
    for d_i, c_i in zip(d, c, strict=True):
        p = np.append(np.polymul(p, [1.0, d_i]), [0.0])
        p[-1] = c_i
    return p


def cascade(target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(d, c), shapes (m,), with which :func:`characteristic` is a stable polynomial of degree 2m.

    From i = m down: c_i = p_i(0); -d_i is a real root of (p_i - c_i)/s, which has one, its degree being odd;
    p_(i-1) is the quotient.

    Raises
    ------
    Problem
        When a coefficient is beyond the range of double precision.
    """
    if not np.all(np.isfinite(target)) or target[-1] == 0:
        raise Problem(
            ("poles",),
            f"the product of these {len(target) - 1} poles is beyond the range of double precision; choose "
            "poles near -1 and put the speed into theta",
        )
    d, c = [], []
    with localcontext() as context:  # each division loses digits: all sixteen for a wide set of order 16
        context.prec = 60
        p = [Decimal(float(coefficient)) for coefficient in target]
        while len(p) > 1:
            *q, last = p
            root = _real_root(q)
            c.append(float(last))
            d.append(-float(root))
            p = _quotient(q, root)[:-1]
    return np.array(d[::-1]), np.array(c[::-1])


def _quotient(q: list[Decimal], root: Decimal) -> list[Decimal]:
    """Horner's scheme: the coefficients of q/(s - root), then q(root)."""
    values = [q[0]]
    for coefficient in q[1:]:
        values.append(values[-1] * root + coefficient)
    return values


def _real_root(q: list[Decimal]) -> Decimal:
    """A real root of a monic polynomial of odd degree, by bisection of Cauchy's bound."""
    high = 1 + max(abs(coefficient) for coefficient in q)
    low = -high
    while (middle := (low + high) / 2) not in (low, high) and high - low > abs(middle) * Decimal("1e-50"):
        if _quotient(q, middle)[-1] < 0:
            low = middle
        else:
            high = middle
    return middle

"""The error's matrices at theta = 1 of every observer that has constant ones.

In z = (xhat - x, filters) with the plant's nonlinearity phi, noise v and disturbance eps, every observer of
constant gain here has, after a scaling zbar_i = theta^(-s_i) z_i,

    zbar' = theta (A~ zbar + B~ v) + Phi~ - D~ eps,      s_i = i - 1 for the i-th state of a chain

A~ and B~ are found from the observer's own equations on chains without phi at theta = 1, and the s_i of its
filters from what another theta makes of them; nothing here knows one family from another.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.analysis.chains import on_chains
from hgorun.analysis.convergence.chain_matrices import chain_matrices
from hgorun.analysis.convergence.lyapunov import Lyapunov
from hgorun.analysis.reasons import CORRECTED, RECALLS, NoValue
from hgorun.memo import Memo
from hgorun.observers.base import AnyObserver, ContinuousObserver, CorrectedObserver
from hgorun.observers.capabilities import HighGain, NotLinear, SettlingGain
from hgorun.observers.constant_gain import PlacedGain
from hgorun.observers.eso import LinearExtendedStateObserver
from hgorun.observers.forward_differences import ForwardDifferences
from hgorun.observers.recalling import LAGS, RecallingObserver
from hgorun.observers.riccati import RiccatiGain
from hgorun.symbolic.forms import BlockForm, ChainForm, Form

_LYAPUNOV: Memo[Lyapunov] = Memo(256)  # by matrix and poles: what is found of one is kept with it


@dataclass(frozen=True)
class ErrorDynamics:
    """zbar' = theta (A zbar + B v) on a chain, the estimate's errors first.

    Attributes
    ----------
    A, B : ndarray, shapes (N, N), (N, q)
    flux : ndarray, shape (q, N)
        (C xhat)' + c at theta = 1: what moves the output apart from the correction.
    powers : ndarray of int, shape (N,)
        s: zbar_i = theta^(-s_i) z_i.
    n : int
        How many of the N are the estimate's.
    known : ndarray or None
        The poles, where they are what the configuration asks for: eig() loses digits of multiple ones.
    """

    A: np.ndarray
    B: np.ndarray
    flux: np.ndarray
    powers: np.ndarray
    n: int
    known: np.ndarray | None = None

    @cached_property
    def lyapunov(self) -> Lyapunov:
        """What decays."""
        known = None if self.known is None else (self.known.dtype.char, self.known.tobytes())
        return _LYAPUNOV.get((self.A.shape, self.A.tobytes(), known), lambda: Lyapunov(self.A, self.known))

    @cached_property
    def push(self) -> float:
        """|B|."""
        return float(np.linalg.norm(self.B, 2))

    @cached_property
    def motion(self) -> float:
        """The norm of what moves the output."""
        return float(np.linalg.norm(self.flux, 2))

    @cached_property
    def energy(self) -> float:
        """|P^(1/2) B|^2."""
        return float(np.linalg.norm(self.B.T @ self.lyapunov.P @ self.B, 2))

    @cached_property
    def weights(self) -> np.ndarray:
        """sqrt((P^-1)_ii): what sqrt V is to the i-th entry of zbar, shape (N,)."""
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(self.lyapunov.P))))

    def scale(self, theta: float) -> np.ndarray:
        """theta^(-s), shape (N,)."""
        return np.asarray(float(theta) ** -self.powers.astype(float))


def error_dynamics(observer: AnyObserver, form: Form) -> ErrorDynamics:
    """The error's matrices at theta = 1 on the chains that an observer sees in the plant.

    Raises
    ------
    NoValue
        Where there are no such matrices.
    """
    if isinstance(observer, NotLinear) and observer.not_linear is not None:
        raise NoValue(observer.not_linear)
    if isinstance(observer, LinearExtendedStateObserver):
        return _extended(observer, form)
    chains = _chains(observer, form)
    if isinstance(observer, ForwardDifferences):
        return _differences(observer, form)
    if "gain" in observer.roles(form).values() and not isinstance(observer, SettlingGain):
        raise NoValue(
            "its gain follows a differential equation, and its class declares no rest of it on chains (SettlingGain): "
            "there is no constant matrix"
        )
    observer = on_chains(observer, form.plant.outputs)
    A, E, flux, powers = chain_matrices(observer, chains)
    return ErrorDynamics(A, -E, flux, powers, sum(chains), _asked_for(observer, A))


def _asked_for(observer: AnyObserver, A: np.ndarray) -> np.ndarray | None:
    """The poles that the configuration or the theory names, if A has their characteristic polynomial."""
    if isinstance(observer, HighGain):
        poles = observer.nominal_poles(len(A))
    elif isinstance(observer, PlacedGain):
        poles = observer.placed_poles(len(A))
    else:
        return None
    size = np.poly(-np.abs(np.linalg.eigvals(A)))
    return poles if np.all(np.abs(np.poly(poles) - np.poly(A)) <= 1e-8 * np.abs(size)) else None


def _chains(observer: AnyObserver, form: Form) -> tuple[int, ...]:
    """Lengths of the chains."""
    if isinstance(form, ChainForm):
        if isinstance(observer, CorrectedObserver):
            raise NoValue(CORRECTED)
        if isinstance(observer, RecallingObserver) and observer.design(form)[LAGS].size:
            raise NoValue(RECALLS)
        if isinstance(observer, ForwardDifferences) or _is_flow(observer):
            return form.chains
    elif isinstance(form, BlockForm) and isinstance(observer, RiccatiGain):
        if _is_constant_chain(form):
            return (form.model.n,)
        raise NoValue(
            "the gain follows F(u, xhat) of a plant that is not a chain of integrators: there is no constant matrix"
        )
    raise NoValue(f"the error of {observer.type} is not that of chains of integrators with a constant gain")


def _is_flow(observer: AnyObserver) -> bool:
    """Whether it is a differential equation of one constant high gain, with a slope everywhere."""
    return isinstance(observer, HighGain) and isinstance(observer, ContinuousObserver)


def _is_constant_chain(form: BlockForm) -> bool:
    """One output, and F = A_n whatever the input."""
    if len(form.measured) != 1 or form.block != tuple(range(form.model.n)):
        return False
    jacobian = ca.jacobian(form.model.dynamics, form.model.x)
    links = [ca.simplify(jacobian[i, i + 1]) for i in range(form.model.n - 1)]
    return all(link.is_constant() and float(link) == 1.0 for link in links)


def _differences(observer: ForwardDifferences, form: Form) -> ErrorDynamics:
    """Observers in forward differences: A_0 = A - H_0 C of the differential equation that they step."""
    n = form.plant.n
    H_0 = observer.gain(n)
    first = np.eye(n)[:1]
    A_0 = np.eye(n, k=1) - np.outer(H_0, first)
    return ErrorDynamics(A_0, H_0[:, None], np.eye(n, k=1)[:1], np.arange(n), n, _asked_for(observer, A_0))


def _extended(observer: LinearExtendedStateObserver, form: Form) -> ErrorDynamics:
    """The chain of n + 1 that the linear extended-state observer takes every plant for, at omega_o = 1."""
    n = form.plant.n
    G = observer.gain(n + 1)
    A = np.eye(n + 1, k=1) - np.outer(G, np.eye(n + 1)[0])
    return ErrorDynamics(A, G[:, None], np.eye(n + 1, k=1)[:1], np.arange(n + 1), n, _asked_for(observer, A))

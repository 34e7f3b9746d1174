"""The error's matrix at theta = 1, its poles, and the Lyapunov matrix P that shows its decay.

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

from hgorun.analysis.chains import on_chains, outputs_of_chains
from hgorun.analysis.reasons import CORRECTED, RECALLS, NoValue, Outcome, outcome
from hgorun.config.reads import Reads
from hgorun.errors import Problem
from hgorun.memo import Memo, same
from hgorun.observers.base import AnyObserver, ContinuousObserver, CorrectedObserver
from hgorun.observers.capabilities import HighGain, NotLinear, SettlingGain
from hgorun.observers.constant_gain import PlacedGain
from hgorun.observers.eso import LinearExtendedStateObserver
from hgorun.observers.forward_differences import ForwardDifferences
from hgorun.observers.recalling import LAGS, RecallingObserver
from hgorun.observers.riccati import RiccatiGain
from hgorun.simulation.design import Design
from hgorun.simulation.observer_block import ObserverBlock
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.forms import BlockForm, ChainForm, Form
from hgorun.symbolic.parameters import Parameters
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.triangular import TriangularForm

_ELSEWHERE = 2.0  # another theta, whose powers are read off
_LYAPUNOV: Memo[Lyapunov] = Memo(256)  # by matrix and poles: what is found of one is kept with it
_LINEAR: Memo[Outcome[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]] = Memo(256)  # by observer and chains
_FORMS: Memo[Form] = Memo(64)  # of chains
_EQUATIONS: Memo[list[_Equations]] = Memo(64)  # of a structure: those that differ in keys that equations read
_BUCKET = 16
MU = 1.0  # of P A~ + A~^T P = -2 mu I


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


@dataclass(frozen=True)
class Lyapunov:
    """What P A~ + A~^T P = -2 mu I with mu = 1 says of a matrix A~.

    beta = mu/(2 lambda_max(P)) and chi = cond(P), (3.23) and (3.35) of Robles Magdaleno 2023. With
    V = zbar^T P zbar and |Phi~| <= c |zbar|

        V' <= -2 theta mu |zbar|^2 + 2 |P zbar| |Phi~| <= -2 (theta mu - c lambda_max(P)) |zbar|^2
        (sqrt V)' <= -(2 beta theta - c) sqrt V

    and |zbar(t)| <= sqrt(chi) exp(-(2 beta theta - c) t) |zbar(0)|. The thesis keeps half of the decay for Phi~:
    c <= beta theta leaves exp(-beta theta t). It has chi for sqrt(chi) from (3.44) on, which is true, too.
    """

    A: np.ndarray
    known: np.ndarray | None = None

    @cached_property
    def poles(self) -> np.ndarray:
        """Eigenvalues, by real part, then imaginary part."""
        values = np.linalg.eigvals(self.A) if self.known is None else self.known
        return np.asarray(values[np.lexsort((values.imag, values.real.round(9)))])

    @property
    def hurwitz(self) -> bool:
        return bool(np.max(self.poles.real) < 0)

    @cached_property
    def P(self) -> np.ndarray:
        """The solution, symmetric and positive definite.

        Raises
        ------
        NoValue
            When A~ is not Hurwitz, or too near to it for double precision.
        """
        from scipy.linalg import solve_continuous_lyapunov

        if not self.hurwitz:
            raise NoValue("the error's matrix is not Hurwitz: no P exists")
        right = -2 * MU * np.eye(len(self.A))
        P = solve_continuous_lyapunov(self.A.T, right)
        P = 0.5 * (P + P.T)
        for _ in range(2):  # refined: its condition number is high for long filters
            rest = right - (P @ self.A + self.A.T @ P)
            P = P + solve_continuous_lyapunov(self.A.T, 0.5 * (rest + rest.T))
            P = 0.5 * (P + P.T)
        off = np.max(np.abs(P @ self.A + self.A.T @ P - right))
        if not (np.all(np.isfinite(P)) and off < 1e-3 and np.min(np.linalg.eigvalsh(P)) > 0):
            raise NoValue("the Lyapunov equation of the error's matrix has no solution in double precision")
        return np.asarray(P)

    @cached_property
    def eigenvalues(self) -> tuple[float, float]:
        """(smallest, largest) of P."""
        values = np.linalg.eigvalsh(self.P)
        return float(values[0]), float(values[-1])

    @property
    def beta(self) -> float:
        return MU / (2 * self.eigenvalues[1])

    @property
    def chi(self) -> float:
        return self.eigenvalues[1] / self.eigenvalues[0]


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
        raise NoValue("its gain follows the plant and comes to rest on no chain: there is no constant matrix")
    observer = on_chains(observer, form.plant.outputs)
    A, E, flux, powers = _LINEAR.get(
        (type(observer), repr(_plain(observer, 1.0)), chains), lambda: outcome(lambda: _scaled(observer, chains))
    ).value
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


def _chain_model(chains: tuple[int, ...]) -> PlantModel:
    """Chains of integrators."""
    n = sum(chains)
    states = tuple(f"x{i + 1}" for i in range(n))
    x = ca.vertcat(*[ca.SX.sym(name) for name in states])
    heads = np.cumsum([0, *chains])[:-1]
    shift = ca.diagcat(*[ca.DM(np.eye(length, k=1)) for length in chains])
    y = ca.vertcat(*[x[int(i)] for i in heads])
    return PlantModel(
        states=states,
        outputs=outputs_of_chains(len(chains)),
        inputs=(),
        parameters=(),
        t=ca.SX.sym("t"),
        x=x,
        u=ca.SX(0, 1),
        p=ca.SX(0, 1),
        dynamics=shift @ x,
        output=y,
    )


def _plain(observer: AnyObserver, theta: float) -> AnyObserver:
    """An observer with another theta, and without what makes no difference on chains."""
    neutral: dict[str, object] = {"saturation": {}, "clip_estimate": None, "coordinates": "original", "initial": {}}
    if isinstance(observer, HighGain):
        return observer.with_theta(theta).model_copy(update=neutral)
    return observer.model_copy(update={"theta": theta, **neutral})


def _scaled(observer: AnyObserver, chains: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, E and the flux of an observer on chains at theta = 1, and its powers of theta."""
    at_one, other = (_linear(_plain(observer, theta), chains) for theta in (1.0, _ELSEWHERE))
    A, E, flux = at_one
    return A, E, flux, _powers(A, other[0], chains)


@dataclass(frozen=True, eq=False)
class _Equations:
    """Of observers on chains that differ in numbers only: what there is of their equations where no error is."""

    form: Form
    reads: Reads[AnyObserver]
    block: ObserverBlock
    derivatives: ca.Function


def _linear(plain: AnyObserver, chains: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, E and the flux of an observer on chains."""
    form = _FORMS.get((chains, isinstance(plain, RiccatiGain)), lambda: _form(plain, chains))
    try:
        design = Design.of("observer", plain, form)
    except Problem as problem:  # its keys name the plant's own states or outputs
        raise NoValue(f"the observer does not take chains of integrators: {problem.message}") from problem
    known = _EQUATIONS.get((same(form), type(plain), design.structure), list)
    equations = next((one for one in known if one.reads.hold_for(plain)), None)
    if equations is None:
        equations = _derived(design, form, len(chains))
        known.append(equations)
        del known[:-_BUCKET]
    found = equations.derivatives(design.numbers, _settled(plain, equations), np.zeros(len(chains)))
    A0, E, H, F0, F1 = (np.asarray(v.full()) for v in found)
    return A0 + E @ H, E, F0 + F1 @ H


def _form(plain: AnyObserver, chains: tuple[int, ...]) -> Form:
    model = _chain_model(chains)
    if isinstance(plain, RiccatiGain):
        return TriangularForm(model, model, tuple(range(model.n)), (0,))
    return CanonicalForm(model, chains, model.x, ca.SX.eye(model.n), identity=True)


def _derived(design: Design, form: Form, outputs: int) -> _Equations:
    model, parameters, reads = form.plant, Parameters(), Reads(design.observer)
    block = ObserverBlock.place(design, 0, False, parameters, reads.watched)
    z, e = ca.SX.sym("z", block.end), ca.SX.sym("e", outputs)
    copy = block.copy(model.t, model.u, model.p)
    s = block.symbols(z)
    derivatives, correction = block.equations(copy, s, e)
    roles = reads.watched.roles(form)
    names = [name for name in block.states if roles.get(name) != "gain"]
    moving = [block.states[name] for name in names]
    rate = ca.vertcat(*[state.flat(derivatives[name]) for name, state in zip(names, moving, strict=True)])
    xi = ca.vertcat(*[z[state.start : state.start + state.size] for state in moving])
    H = ca.jacobian(copy.output(s.xhat), xi)
    flux = H @ rate + correction
    parts = [ca.jacobian(rate, xi), ca.jacobian(rate, e), H, ca.jacobian(flux, xi), ca.jacobian(flux, e)]
    values = ca.Function("linear", [parameters.symbol, z, e], [ca.densify(part) for part in parts])
    return _Equations(form, reads, block, values)


def _settled(observer: AnyObserver, equations: _Equations) -> np.ndarray:
    """No error, and the matrices of a time-varying gain where they settle on chains of integrators."""
    z = np.zeros(equations.block.end)
    matrices = observer.settled(equations.form) if isinstance(observer, SettlingGain) else {}
    for name, values in matrices.items():
        if name in equations.block.states:
            state = equations.block.states[name]
            z[state.start : state.start + state.size] = state.numbers(values)
    return z


def _powers(A: np.ndarray, other: np.ndarray, chains: tuple[int, ...]) -> np.ndarray:
    """s, from A(theta)_ij = theta^(1 + s_i - s_j) A(1)_ij, s known along the chains."""
    tiny = 1e-9 * np.max(np.abs(A))
    linked = np.abs(A) > tiny
    with np.errstate(divide="ignore", invalid="ignore"):
        differences = np.log(other / A) / np.log(_ELSEWHERE) - 1  # s_i - s_j
    known = dict(enumerate(position for length in chains for position in range(length)))
    waiting = list(known)
    while waiting:
        i = waiting.pop()
        for j in range(len(A)):
            for step in ([-differences[i, j]] if linked[i, j] else []) + ([differences[j, i]] if linked[j, i] else []):
                if (
                    not np.isfinite(step)
                    or abs(step - round(step)) > 1e-6
                    or known.get(j, known[i] + round(step)) != (known[i] + round(step))
                ):
                    raise NoValue("no scaling with powers of theta makes the error's matrix theta times another")
                if j not in known:
                    known[j] = known[i] + round(step)
                    waiting.append(j)
    return np.array([known.get(i, 0) for i in range(len(A))])

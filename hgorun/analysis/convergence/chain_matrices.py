"""The matrices of an observer's error on chains of integrators at theta = 1, from the observer's own equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import casadi as ca
import numpy as np

from hgorun.analysis.chains import outputs_of_chains
from hgorun.analysis.reasons import NoValue, Outcome, outcome
from hgorun.config.reads import Reads
from hgorun.errors import Problem
from hgorun.memo import Memo, same
from hgorun.observers.base import AnyObserver
from hgorun.observers.capabilities import HighGain, SettlingGain
from hgorun.observers.riccati import RiccatiGain
from hgorun.simulation.design.design import Design
from hgorun.simulation.error_dynamics.filters_at_rest import not_at_zero, rates_and_sizes, values_of
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.forms import Form
from hgorun.symbolic.parameters import Parameters
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.states import StateBlock
from hgorun.symbolic.triangular import TriangularForm

_ELSEWHERE = 2.0  # another theta, whose powers are read off
_LINEAR: Memo[Outcome[ChainMatrices]] = Memo(256)  # by observer and chains
_FORMS: Memo[Form] = Memo(64)  # of chains
_EQUATIONS: Memo[list[_Equations]] = Memo(64)  # of a structure: those that differ in keys that equations read
_BUCKET = 16


class ChainMatrices(NamedTuple):
    """z' = A z + E v at theta = 1 in z = (xhat - x, filters), without the plant's nonlinearity.

    Attributes
    ----------
    A, E : ndarray, shapes (N, N), (N, q)
        E is the slope by e = C xhat - y.
    flux : ndarray, shape (q, N)
        (C xhat)' + c: what moves the output apart from the correction.
    powers : ndarray of int, shape (N,)
        s: zbar_i = theta^(-s_i) z_i.
    """

    A: np.ndarray
    E: np.ndarray
    flux: np.ndarray
    powers: np.ndarray


def chain_matrices(observer: AnyObserver, chains: tuple[int, ...]) -> ChainMatrices:
    """Those of an observer whose keys name chains of these lengths.

    Raises
    ------
    NoValue
        Where the observer does not take chains, or no scaling with powers of theta exists.
    """
    key = type(observer), repr(_plain(observer, 1.0)), chains
    return _LINEAR.get(key, lambda: outcome(lambda: _scaled(observer, chains))).value


def _scaled(observer: AnyObserver, chains: tuple[int, ...]) -> ChainMatrices:
    at_one, other = (_linear(_plain(observer, theta), chains) for theta in (1.0, _ELSEWHERE))
    A, E, flux = at_one
    return ChainMatrices(A, E, flux, _powers(A, other[0], chains))


def _plain(observer: AnyObserver, theta: float) -> AnyObserver:
    """An observer with another theta, and without what makes no difference on chains."""
    neutral: dict[str, object] = {"saturation": {}, "clip_estimate": None, "coordinates": "original", "initial": {}}
    if isinstance(observer, HighGain):
        return observer.with_theta(theta).model_copy(update=neutral)
    return observer.model_copy(update={"theta": theta, **neutral})


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
    found = equations.derivatives(design.numbers, _at_rest(design, equations), np.zeros(len(chains)))
    A0, E, H, F0, F1 = (np.asarray(v.full()) for v in found)
    return A0 + E @ H, E, F0 + F1 @ H


def _form(plain: AnyObserver, chains: tuple[int, ...]) -> Form:
    model = _chain_model(chains)
    if isinstance(plain, RiccatiGain):
        return TriangularForm(model, model, tuple(range(model.n)), (0,))
    return CanonicalForm(model, chains, model.x, ca.SX.eye(model.n), identity=True)


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


@dataclass(frozen=True, eq=False)
class _Equations:
    """Of observers on chains that differ in numbers only: what there is of their equations where no error is."""

    form: Form
    reads: Reads[AnyObserver]
    block: ObserverBlock
    filters: dict[str, StateBlock]
    derivatives: ca.Function
    rates: ca.Function


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
    filters = {name: state for name, state in block.states.items() if roles.get(name) == "filter" and state.size}
    still, _ = block.equations(copy, s, ca.SX.zeros(outputs))
    rates = ca.Function("filters", [parameters.symbol, z], rates_and_sizes(still, filters, z))
    return _Equations(form, reads, block, filters, values, rates)


def _at_rest(design: Design, equations: _Equations) -> np.ndarray:
    """No error, and the matrices of a time-varying gain where they settle on chains of integrators.

    Raises
    ------
    NoValue
        Where a filter does not rest at zero, so that it is none.
    """
    observer, z = design.observer, np.zeros(equations.block.end)
    matrices = observer.settled(equations.form) if isinstance(observer, SettlingGain) else {}
    for name, values in matrices.items():
        if name in equations.block.states:
            state = equations.block.states[name]
            z[state.start : state.start + state.size] = state.numbers(values)
    if equations.filters:
        evaluate = partial(values_of, equations.rates, design.numbers)
        wrong = not_at_zero(equations.filters, design.defaults, z, evaluate)
        if wrong:
            raise NoValue(
                f"its state {', '.join(wrong)} does not come to rest at 0 while the estimate is right, as a filter "
                "does: its class has to declare the role (roles), and of a gain where it comes to rest (SettlingGain)"
            )
    return z

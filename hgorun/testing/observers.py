"""What every observer must keep, whatever its equations."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from functools import partial
from typing import get_args

import casadi as ca
import numpy as np

from hgorun.errors import HgorunError, PluginError, raised
from hgorun.observers.base import (
    AnyObserver,
    Arrival,
    ContinuousObserver,
    CorrectedObserver,
    DecidedObserver,
    Role,
    Sample,
    SampledObserver,
)
from hgorun.observers.capabilities import Differentiator, NotLinear, SlidingMode
from hgorun.simulation.preparation.preparation import prepare
from hgorun.symbolic.states import Symmetric
from hgorun.testing.cases import CHAINS, WRONG_PLANTS, Case, Keys, Subject, as_tuple, built, lent
from hgorun.testing.contract import Broken, Law, NotApplicable, Report, hold_to, keys_are_described
from hgorun.testing.decay import decays
from hgorun.testing.equations import Equations, numbers_of, points, shaped
from hgorun.testing.roles import filters_rest_at_zero
from hgorun.testing.runs import RUN_LAWS

CORRECTION = 1e-9  # relative difference of two ways to the same number
RATE = 0.05  # of a rate: what it may lack


def check_observer(
    cls: type[AnyObserver],
    block: Keys | None = None,
    *,
    plants: Iterable[Keys] | None = None,
    skip: Collection[str] = (),
) -> Report:
    """Hold a class of observers to the laws that the rest of hgorun relies on.

    Parameters
    ----------
    cls : type
        The class; it need not be registered.
    block : mapping, optional
        Keys of its block, as in a configuration. They go before those of ``cls.example``; keys that have a
        default may be left out.
    plants : iterable of mapping, optional
        Plant blocks, as in a configuration, all of which the observer must take. Where it is left out, the
        first ones of a few common plants that it takes.
    skip : collection of str
        Names of laws that are not checked.

    Returns
    -------
    Report
        The laws that it keeps, and those that are not for it.

    Raises
    ------
    ContractError
        For the first law that is broken: its name, what was found and what would be right.
    """
    keys = dict(block or {})
    with lent(cls, keys) as name:
        return hold_to(cls.__name__, Subject(cls, name, keys, as_tuple(plants)), LAWS, skip)


def _takes_a_plant(subject: Subject) -> None:
    for case in subject.cases:
        case.observer()


def _finite_design(subject: Subject) -> None:
    for case in subject.cases:
        for name, value in case.equations().design.items():
            if value.dtype.kind not in "fiub" or not np.all(np.isfinite(value)):
                raise Broken(f"{name} = {value} {case.equations().where}", "finite numbers in all of its design")


def _repeatable(subject: Subject) -> None:
    """Whatever was designed before: designs for other plants and numbers leave nothing behind."""
    for case in subject.cases:
        one, other = case.equations(), case.equations()
        for earlier, later in ((case.first, one), (one, other)):
            for name, value in earlier.design.items():
                if not np.array_equal(value, later.design[name]):
                    raise Broken(f"{name} = {value}, then {later.design[name]}", "the same design every time")
        numbers = numbers_of(other)
        of_others = [partial(each.equations) for each in subject.cases if each is not case]
        for design_another in (partial(case.equations, **case.other_numbers), *of_others):
            again = case.equations()
            design_another()
            found = numbers_of(again)  # which is asked for its equations only now
            if not np.array_equal(numbers, found, equal_nan=True):
                gap = np.nanmax(np.abs(numbers - found))
                raise Broken(f"equations that differ by {gap:.3g} when they are built again", "the same equations")


def _states(subject: Subject) -> None:
    for case in subject.cases:
        equations = case.equations()
        for name, value in equations.defaults.items():
            if name in ("xhat", "alpha"):
                raise Broken(f"a state called {name}", "a name of its own: xhat and alpha are hgorun's")
            values = value.values if isinstance(value, Symmetric) else value
            if values.ndim > 2 or not np.all(np.isfinite(values)):
                raise Broken(f"{name} starting at {values}", "a finite number, vector or matrix")
            if isinstance(value, Symmetric) and not np.array_equal(values, values.T):
                raise Broken(f"{name} starting at {values.tolist()}", "a symmetric matrix")
        roles = equations.observer.roles(equations.form)
        unknown = sorted({str(role) for role in roles.values()} - set(get_args(Role)))
        if unknown:
            raise Broken(f"the roles {unknown}", f"roles among {list(get_args(Role))}")
        if set(roles) != set(equations.defaults):
            raise Broken(f"roles of {sorted(roles)}", f"one role each of {sorted(equations.defaults)}")


def _equations(subject: Subject) -> None:
    for case in subject.cases:
        equations = case.equations()
        if isinstance(equations.observer, ContinuousObserver):
            _same_shapes(equations, equations.rates, "equations(): the derivative", whole=True)
            c = equations.correction
            if c is not None:
                shaped(c, (equations.outputs, 1), "equations(): the correction, one an output,")
        if isinstance(equations.observer, DecidedObserver):
            _same_shapes(equations, equations.decided(), "decide(): the value", whole=False)
        if isinstance(equations.observer, SampledObserver):
            sample = Sample(ca.SX.sym("y", equations.outputs), ca.SX.sym("y_", equations.outputs), ca.SX.sym("T"))
            _same_shapes(equations, equations.jump(sample), "jump(): the value", whole=False)
        if isinstance(equations.observer, CorrectedObserver):
            arrival = Arrival(ca.SX.sym("y", equations.outputs), ca.SX.sym("fresh", equations.outputs))
            _same_shapes(equations, equations.corrected(arrival), "correct(): the value", whole=False)
        for values in numbers_of(equations):
            if not np.all(np.isfinite(values)):
                raise Broken(
                    f"{values.ravel()} near the start {equations.where}",
                    "finite numbers (of a symbol, math.sin and the like make nan: casadi.sin does not)",
                )


def _same_shapes(equations: Equations, found: dict[str, ca.SX], what: str, *, whole: bool) -> None:
    known = set(equations.states)
    if set(found) - known or (whole and known - set(found)):
        raise Broken(f"{what} of {sorted(found)}", f"{'all' if whole else 'some'} of {sorted(known)}")
    for name, value in found.items():
        shaped(value, equations.states[name].matrix, f"{what} of {name}")


def _arguments(subject: Subject) -> None:
    """A number that equations read from the block is compiled into them."""
    for case in subject.cases:
        equations = case.equations()
        numbers = [key for key, value in case.observer() if isinstance(value, float)]
        read = [key for key in numbers if key in equations.read_by_equations()]
        if read:
            raise Broken(
                f"equations that read self.{read[0]}, a number",
                f"k.{read[0]}, from design: what equations read themselves is compiled, once for every value",
            )


def _correction(subject: Subject) -> None:
    for case in subject.cases:
        equations = case.equations()
        if not isinstance(equations.observer, ContinuousObserver):
            raise NotApplicable("it has no flow")
        if equations.correction is None:
            if equations.felt is None:
                raise Broken("no correction in its Flow", "one, since there is no copy of the plant to derive it from")
            continue
        if isinstance(equations.observer, Differentiator) or equations.felt is None:
            # what it does by itself is not known from outside; what the innovation does is
            _compare(equations, *equations.pulls, "slope of the correction in e", "-C_x d xhat'/de")
        else:
            _compare(equations, equations.correction, equations.felt, "correction", "C_x (copy(xhat) - xhat')")


def _compare(equations: Equations, declared: ca.SX, derived: ca.SX, what: str, formula: str) -> None:
    both = equations.function("both", declared, derived)
    for z, e in points(equations):
        one, other = equations.evaluate(both, 0.3, z, e)
        size = float(np.max(np.abs(one)) + np.max(np.abs(other)))
        if not np.max(np.abs(one - other)) <= CORRECTION * size + 1e-12:
            raise Broken(
                f"the {what} {one.ravel()} declared {equations.where}",
                f"{other.ravel()}, what the output of the estimate feels: {formula}",
            )


def _rate(subject: Subject) -> None:
    """Sharply on integrators, whose eigenvalues are those of the design; elsewhere the plant's slopes move them."""
    chains = [equations for n in CHAINS if (equations := subject.on_integrators(n)) is not None]
    for equations in [*chains[:1], *(case.equations() for case in subject.cases)]:
        declared = float(equations.observer.fastest_rate(equations.form))
        if not (np.isfinite(declared) and declared >= 0):
            raise Broken(f"fastest_rate = {declared}", "a finite number, 0 where it is not known")
        if not isinstance(equations.observer, ContinuousObserver):
            raise NotApplicable("it has no flow: only that the rate is a number was looked at")
        if declared == 0:
            raise NotApplicable("fastest_rate is 0, unknown: step: auto goes by the plant alone")
        if isinstance(equations.observer, NotLinear) and equations.observer.not_linear is not None:
            raise NotApplicable(equations.observer.not_linear)
        if isinstance(equations.observer, SlidingMode):
            raise NotApplicable("its right-hand side has no slope where the error is zero")
        found, rounding = fastest(equations)
        sharp = equations in chains
        allowed = declared * (1 + RATE + rounding) if sharp else 2 * (declared + _slopes(equations))
        if found > allowed:
            raise Broken(
                f"fastest_rate = {declared:.6g}, but eigenvalues up to {found:.6g} {equations.where}",
                f"a rate not below that of the linearised error dynamics, {found:.6g}",
            )


def fastest(equations: Equations) -> tuple[float, float]:
    """The largest modulus of an eigenvalue of the linearised error at the truth, and its relative rounding.

    Equal eigenvalues, N of them, are found to about the N-th root of the precision.
    """
    z = equations.start(equations.plant.initial)
    _, slope = equations.evaluate(equations.flow, 0.0, z, np.zeros(equations.outputs))
    kept = equations.places("estimate", "filter")
    error = slope[np.ix_(kept, kept)]
    if not np.all(np.isfinite(error)):
        raise NotApplicable("its equations have no finite slope where the error is zero")
    return float(np.max(np.abs(np.linalg.eigvals(error)), initial=0.0)), 3 * 1e-15 ** (1 / len(kept))


def _slopes(equations: Equations) -> float:
    """The norm of the plant's Jacobian at the start."""
    model, plant = equations.plant.model, equations.plant
    slope = ca.substitute(ca.jacobian(model.dynamics, model.x), model.u, plant.inputs)
    values = ca.Function("A", [model.t, model.x, model.p], [ca.densify(slope)])(0.0, plant.initial, plant.parameters)
    return float(np.linalg.norm(np.asarray(values.full()), 2))


def _refuses(subject: Subject) -> None:
    for keys in (dict(plant) for plant in WRONG_PLANTS):
        states = built(keys).model.states
        case = Case(subject.cls, subject.name, {**subject.cls.example(states), **subject.keys}, keys)
        try:
            prepare(case.experiment({"it": {"initial": case.aside}}))
        except HgorunError as error:
            fault = error.__cause__ if isinstance(error, PluginError) else None
        except Exception as error:
            fault = error
        else:
            continue
        if fault is not None:
            raise Broken(
                f"{raised(fault)}, for the plant {keys['dynamics']}, output {keys['output']}",
                "an HgorunError that says why the plant is not one for this observer, or an observer that works",
            ) from fault


def _explains_itself(subject: Subject) -> None:
    cls = subject.cls
    if not cls.__doc__:  # its own: inspect.getdoc would find that of a base
        raise Broken("no docstring", "one with the equations, the class of plants and the meaning of each gain")
    if not cls.reference:
        raise Broken("an empty `reference`", "the publication that the equations are from")
    keys_are_described(cls)


LAWS: tuple[Law[Subject], ...] = (
    Law("takes a plant", "an example block on a plant", _takes_a_plant),
    Law("finite design", "the numbers of its design are finite", _finite_design),
    Law("states", "its states have names and starts of their own", _states),
    Law("equations", "its equations fit its states and are finite near the start", _equations),
    Law("numbers are arguments", "its equations read numbers from its design", _arguments),
    Law("repeatable", "built again it is the same", _repeatable),
    Law("roles", "its filters come to rest at zero while the estimate is right", filters_rest_at_zero),
    Law("correction", "the correction is what the output of the estimate feels", _correction),
    Law("refusal", "a plant that is not for it is refused by an HgorunError", _refuses),
    *RUN_LAWS,
    Law("the error decays", "a small error decays on a plant at rest", decays),
    Law("declared rate", "fastest_rate is not below the linearised error dynamics", _rate),
    Law("documentation", "it explains itself", _explains_itself),
)

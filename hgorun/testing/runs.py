"""Laws of observers that are seen in simulations."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hgorun.errors import HgorunError
from hgorun.observers.base import ContinuousObserver
from hgorun.observers.capabilities import Averaged, Differentiator, Punctual, SlidingMode
from hgorun.result.records.observer import ObserverResult
from hgorun.result.result import Result
from hgorun.simulation.passes.passes import as_given, integrate, integrate_lanes
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.simulate import simulate
from hgorun.symbolic.forms import ModelCopy
from hgorun.symbolic.states import Symmetric
from hgorun.testing.cases import Case, Keys, Subject
from hgorun.testing.contract import Broken, Law, NotApplicable

STAYS = 1e-6  # of 1 + max |x|: what rounding and the solver may make of an estimate that is right
STARTS = 1e-9  # relative
LANES = 8


def _starts(subject: Subject) -> None:
    case = subject.cases[0]
    result = simulate(case.experiment({"it": {"initial": case.aside}}))
    found = result.observers["it"]
    wanted = np.array([case.aside[name] for name in result.states])
    if not np.allclose(found.xhat[0], wanted, rtol=STARTS, atol=STARTS):
        raise Broken(f"xhat(0) = {found.xhat[0]}", f"{wanted}, as initial says")
    for name, value in case.equations(initial=case.aside).defaults.items():
        start = value.values if isinstance(value, Symmetric) else value
        if not np.array_equal(np.ravel(found.internal[name][0]), np.ravel(start)):
            raise Broken(f"{name}(0) = {found.internal[name][0]}", f"{start}, as its states say")
        _given(case, name, value)


def _given(case: Case, name: str, value: np.ndarray | Symmetric) -> None:
    """``internal: {name: 1.5}``; an observer may refuse it."""
    try:
        result = simulate(case.experiment({"it": {"initial": case.aside, "internal": {name: 1.5}}}, end=0.1))
    except HgorunError:
        return
    wanted = 1.5 * (np.eye(len(value.values)) if isinstance(value, Symmetric) else np.ones_like(value))
    found = result.observers["it"].internal[name][0]
    if not np.array_equal(np.ravel(found), np.ravel(wanted)):
        raise Broken(f"{name}(0) = {found} with internal: {{{name}: 1.5}}", f"{wanted}")


def _in_company(subject: Subject) -> None:
    case = subject.cases[0]
    late = {} if isinstance(case.observer(), Punctual) else {"delay": 0.04}
    measurement = None if case.sampled else {"sampling": {"period": 0.1}, **late}
    own = {"initial": case.aside}
    other = {"initial": {name: value - 0.03 for name, value in case.aside.items()}, **_numbers(case, measurement)}
    alone = simulate(case.experiment({"it": own}, measurement=measurement))
    again = simulate(case.experiment({"it": own}, measurement=measurement))
    _same_bits(alone, again, "the second time", "the same bits every time")
    company = case.experiment({"before": other, "it": own, "after": other}, measurement=measurement)
    _same_bits(alone, simulate(company), "beside two others", "the same bits alone and in company")


def _numbers(case: Case, measurement: Keys | None) -> Keys:
    """Numbers with which an observer is another one: those that a run takes, as it may not take another period."""

    def taken(numbers: Keys) -> bool:
        try:
            prepare(case.experiment({"it": {"initial": case.aside, **numbers}}, measurement=measurement))
        except HgorunError:
            return False
        return True

    numbers: Keys = case.other_numbers
    return numbers if taken(numbers) else {key: value for key, value in numbers.items() if taken({key: value})}


def _in_lanes(subject: Subject) -> None:
    """Eight starts side by side in vector registers against each of them alone."""
    case = subject.cases[0]
    starts = [{name: value * (1 + 0.01 * k) for name, value in case.aside.items()} for k in range(LANES)]
    runs = [prepare(case.experiment({"it": {"initial": start}})) for start in starts]
    together = integrate_lanes(runs, as_given(runs[0]))
    for lane, run in enumerate(runs):
        alone = integrate(run, as_given(run))
        if not np.array_equal(together.rows[..., lane], alone.rows[..., 0], equal_nan=True):
            gap = float(np.nanmax(np.abs(together.rows[..., lane] - alone.rows[..., 0])))
            raise Broken(f"states that differ by {gap:.3g} in lane {lane} of {LANES}", "the same bits in every lane")


def _same_bits(one: Result, other: Result, where: str, expected: str) -> None:
    first, second = _arrays(one.observers["it"]), _arrays(other.observers["it"])
    for name, values in first.items():
        if not np.array_equal(values, second[name], equal_nan=True):
            gap = float(np.nanmax(np.abs(values - second[name])))
            raise Broken(f"{name} that differs by {gap:.3g} {where}", expected)


def _arrays(found: ObserverResult) -> Mapping[str, np.ndarray]:
    return {"xhat": found.xhat, **{name: np.asarray(values) for name, values in found.internal.items()}}


def _stays(subject: Subject) -> None:
    for case in subject.cases:
        observer = case.observer()
        if isinstance(observer, Differentiator):
            raise NotApplicable("it does without the plant's equations")
        if isinstance(observer, SlidingMode):
            raise NotApplicable("its correction is discontinuous at the truth, and rounding makes it chatter about it")
        if isinstance(observer, Averaged):
            raise NotApplicable("it follows a mean of the plant's field, which is another one where that is curved")
        if isinstance(observer, ContinuousObserver) and not isinstance(case.equations().copy(0.0), ModelCopy):
            raise NotApplicable("it has no copy of the plant")
        # a difference equation copies the plant's Euler model
        stepped = {} if isinstance(observer, ContinuousObserver) else {"discretise": "euler"}
        sampled = {"sampling": {"period": 0.1}}
        for measurement in (sampled,) if case.sampled else ({}, sampled):
            experiment = case.experiment({"it": {"initial": case.truth}}, measurement=measurement, end=2.0, **stepped)
            _not_moved(simulate(experiment), "sampled" if measurement else "continuous")


def _not_moved(result: Result, how: str) -> None:
    error = np.max(np.abs(result.observers["it"].xhat - result.x))
    limit = STAYS * (1 + np.max(np.abs(result.x)))
    if not error <= limit:
        raise Broken(
            f"an error of {error:.3g} after starting at the truth, the output {how} and without noise",
            f"an estimate that stays right, to {limit:.3g}",
        )


RUN_LAWS: tuple[Law[Subject], ...] = (
    Law("initial values", "it starts where initial, internal and its states say", _starts),
    Law("company", "the same bits alone and beside others", _in_company),
    Law("lanes", "the same bits in one lane and in eight", _in_lanes),
    Law("fixed point", "started at the truth, without noise, it stays there", _stays),
)
